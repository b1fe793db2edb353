"""The script that makes the environment, as far as it can be tried without installing anything."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

SCRIPT = ROOT / ".ci/install.py"
PROGRAMS = ("nginx", "openssl", "strace", "fiu-ctrl", "systemd-analyze")


def install(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(SCRIPT), *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def ready(tmp_path: Path) -> Path:
    """An environment whose stamp says that everything is there, and the programs that are no browsers."""
    stamp = runpy.run_path(str(SCRIPT))["fingerprint"]()
    (tmp_path / ".installed").write_text(stamp, encoding="utf-8")
    for name in PROGRAMS:
        (tmp_path / name).touch(mode=0o755)
    return tmp_path


def test_where_the_stamp_matches_nothing_is_done(ready: Path) -> None:
    finished = install("--environment", str(ready))
    assert (finished.returncode, finished.stdout, finished.stderr) == (0, "", "")
    assert {path.name for path in ready.iterdir()} == {".installed", *PROGRAMS}


def test_browsers_that_are_named_are_taken(ready: Path) -> None:
    named = ready / "my-browser"
    named.touch()
    nowhere = {"PATH": str(ready), "HOME": str(ready), "XAR_CHROMIUM": str(named), "XAR_FIREFOX": str(named)}
    assert install("--environment", str(ready), "--browser", **nowhere).returncode == 0


@pytest.mark.parametrize(("missing", "there"), [("CHROMIUM", "FIREFOX"), ("FIREFOX", "CHROMIUM")])
def test_without_a_browser_and_a_way_to_get_one_it_says_what_to_do(ready: Path, missing: str, there: str) -> None:
    named = ready / "my-browser"
    named.touch()
    nowhere = {"PATH": str(ready), "HOME": str(ready), f"XAR_{there}": str(named), f"XAR_{missing}": "missing"}
    finished = install("--environment", str(ready), "--browser", **nowhere)
    assert finished.returncode == 2
    assert finished.stderr.startswith(f"install: the tests need {missing.capitalize()} (Debian, as root: ")
    assert there.capitalize() not in finished.stderr
    assert len(finished.stderr.splitlines()) == 1


@pytest.mark.parametrize("program", ["openssl", "systemd-analyze"])
def test_without_a_program_of_the_deployment_it_says_which(ready: Path, program: str) -> None:
    for name in ("chromium", "firefox"):
        (ready / name).touch(mode=0o755)
    (ready / program).unlink()
    finished = install("--environment", str(ready), "--browser", PATH=str(ready), HOME=str(ready))
    assert finished.returncode == 2
    assert finished.stderr.startswith(f"install: the tests need {program} (Debian, as root: ")


def test_without_any_browser_it_says_so_once(ready: Path) -> None:
    nowhere = {"PATH": str(ready), "HOME": str(ready), "XAR_CHROMIUM": "", "XAR_FIREFOX": "missing"}
    finished = install("--environment", str(ready), "--browser", **nowhere)
    assert finished.returncode == 2
    assert "Chromium" in finished.stderr
    assert "Firefox" in finished.stderr
    assert len(finished.stderr.splitlines()) == 1


@pytest.mark.parametrize("browser", ["chromium", "firefox"])
def test_a_browser_that_is_named_and_missing_is_not_replaced_by_another(ready: Path, browser: str) -> None:
    for name in ("chromium", "firefox"):
        (ready / name).touch(mode=0o755)
    nowhere = {"PATH": str(ready), "HOME": str(ready)}
    assert install("--environment", str(ready), "--browser", **nowhere).returncode == 0
    named = {f"XAR_{browser.upper()}": "missing"}
    assert install("--environment", str(ready), "--browser", **nowhere, **named).returncode == 2


def test_the_stamp_follows_the_lock(tmp_path: Path) -> None:
    for name in ("pyproject.toml", "constraints.txt", ".ci/install.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    fingerprint = runpy.run_path(str(tmp_path / ".ci/install.py"))["fingerprint"]
    before = fingerprint()
    assert fingerprint() == before
    with (tmp_path / "constraints.txt").open("a", encoding="utf-8") as lock:
        lock.write("# another\n")
    assert fingerprint() != before


def test_without_postgres_it_says_what_to_do_where_postgres_is_asked_for(ready: Path) -> None:
    nowhere = {"PATH": str(ready), "XAR_POSTGRES": str(ready / "missing")}
    assert install("--environment", str(ready), **nowhere).returncode == 0
    finished = install("--environment", str(ready), "--postgres", **nowhere)
    assert finished.returncode == 2
    assert finished.stderr.startswith("install: the tests need PostgreSQL 13 or later (Debian, as root: ")
    assert len(finished.stderr.splitlines()) == 1
