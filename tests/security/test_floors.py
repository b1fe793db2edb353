"""The floors of what the program needs are not below the versions in which known faults were mended."""

import re
import subprocess
import sys
import tomllib

import pytest

from tests.conftest import ROOT

DOCUMENT = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
FLOORS = dict(re.findall(r"^\| ([\w.-]+) \| ([\d.]+) \| (?:GHSA|CVE)", DOCUMENT, re.MULTILINE))
REQUIRED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DECLARED = [*REQUIRED["dependencies"], *(one for some in REQUIRED["optional-dependencies"].values() for one in some)]


def version(text: str) -> tuple[int, ...]:
    """A version without its trailing noughts."""
    numbers = [int(part) for part in text.split(".")]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)


def floor_of(name: str) -> str:
    (found,) = {
        match[1] for line in DECLARED if (match := re.match(rf"{re.escape(name)}(?:\[[^\]]*\])?>=([\d.]+)", line))
    }
    return found


def test_the_table_names_what_faces_the_network() -> None:
    assert {"flask", "werkzeug", "jinja2", "waitress", "gunicorn", "pillow", "torch", "urllib3"} <= set(FLOORS)


@pytest.mark.parametrize("name", FLOORS)
def test_no_floor_is_below_the_advisory(name: str) -> None:
    assert version(floor_of(name)) >= version(FLOORS[name])


@pytest.mark.parametrize("name", FLOORS)
def test_what_is_locked_is_not_below_its_floor(name: str) -> None:
    lock = (ROOT / "constraints.txt").read_text(encoding="utf-8") + (ROOT / "pyproject.toml").read_text(
        encoding="utf-8"
    )
    locked = re.search(rf"(?m)^\W*(?:constraint-dependencies = \[\")?{re.escape(name)}==([\d.]+)", lock)
    assert locked is not None, name
    assert version(locked[1].rstrip(".")) >= version(FLOORS[name])


def test_versions_are_compared_by_their_numbers() -> None:
    assert version("3.1.10") > version("3.1.9")
    assert version("13") == version("13.0.0") > version("12.3")


def test_workers_load_nothing_of_the_parser_that_an_advisory_is_about() -> None:
    """CVE-2026-134820 is in `gunicorn.asgi`; what reads requests for our workers is `gunicorn.http`."""
    kind = re.search(
        r'^worker_class = "(\w+)"', (ROOT / "webapp/gunicorn_settings.py").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert kind is not None
    told = {name: _loaded(name) for name in (kind[1], "gasgi")}
    assert "gunicorn.http.message" in told["gthread"]
    assert "gunicorn.asgi" not in told["gthread"]
    # The control: a worker that has that parser.
    assert "gunicorn.asgi" in told["gasgi"]


def test_no_text_is_drawn_with_pillow() -> None:
    """CVE-2026-112893 is of text with an outline."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in sorted((ROOT / "webapp").rglob("*.py"))}
    used = [name for name, text in texts.items() if "PIL" in text]
    drawn = [name for name in used if re.search(r"ImageFont|\.(multiline_)?text\(", texts[name])]
    assert len(used) >= 3
    assert drawn == []


def _loaded(worker: str) -> str:
    """Return the modules of gunicorn that a process holds with a kind of worker."""
    code = f"import sys, gunicorn.arbiter, gunicorn.app.wsgiapp, gunicorn.workers.{worker}; print(sorted(sys.modules))"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
