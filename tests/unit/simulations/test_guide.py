"""docs/simulations.md: what it shows in Python runs, and what it names is there."""

import re
import types
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.conftest import ROOT
from webapp.cli import main

GUIDE = (ROOT / "docs/simulations.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_example_in_python_runs_and_leaves_a_complete_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (program,) = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
    exec(program, types.ModuleType("guide").__dict__)  # noqa: S102 - that it runs is what is promised.
    assert (tmp_path / "my-run" / "run.json").exists()
    assert "2 (8 12)" in capsys.readouterr().out


def test_every_option_that_the_guide_names_exists() -> None:
    helps = "".join(CliRunner().invoke(main, ["simulate", verb, "--help"]).stdout for verb in ("importance", "count"))
    options = set(re.findall(r"`(?:xar simulate [a-z]+ )?(--[a-z]+)", GUIDE))
    assert options >= {"--settings", "--quick", "--layout", "--run", "--workers", "--scheduler"}
    assert {option for option in options if option not in helps} == set()
