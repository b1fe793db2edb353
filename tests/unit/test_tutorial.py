"""docs/tutorial.md, read as its readers use it: block after block in one session, printing what stands below."""

import contextlib
import io
import re
import types
from pathlib import Path

import pytest

from tests.conftest import ROOT

TUTORIAL = ROOT / "docs" / "tutorial.md"
BLOCK = re.compile(r"```python\n(?P<code>.*?)```\n(?:\n```text\n(?P<output>.*?)```\n)?", re.DOTALL)


def printed(code: str, session: types.ModuleType, name: str) -> str:
    """Run one block in the session and return what it prints."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(code, name, "exec"), session.__dict__)  # noqa: S102 - the code is ours.
    return output.getvalue()


def plain(text: str) -> list[str]:
    """Return the lines without the spaces at their ends, which editors remove."""
    return [line.rstrip() for line in text.splitlines()]


@pytest.mark.slow
def test_each_block_of_the_tutorial_prints_what_stands_below_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    session = types.ModuleType("tutorial")
    blocks = list(BLOCK.finditer(TUTORIAL.read_text(encoding="utf-8")))
    for number, block in enumerate(blocks, start=1):
        name = f"block {number} of {TUTORIAL.name}"
        assert (name, plain(printed(block["code"], session, name))) == (name, plain(block["output"] or ""))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lift-comparison.svg", "lift-stability.svg"]


def test_no_block_of_the_tutorial_is_overlooked() -> None:
    text = TUTORIAL.read_text(encoding="utf-8")
    found = list(BLOCK.finditer(text))
    assert len(found) == text.count("```python") > 10
    assert sum(block["output"] is not None for block in found) == text.count("```text") > 10
    assert text.count("```") == 2 * (text.count("```python") + text.count("```text"))


def test_the_tutorial_needs_nothing_but_the_public_names() -> None:
    homes = re.findall(r"^from (\S+) import", TUTORIAL.read_text(encoding="utf-8"), re.MULTILINE)
    assert {home for home in homes if home.startswith("webapp")} == {"webapp.explainer"}
