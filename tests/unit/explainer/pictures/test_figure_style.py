"""Figures with numbers, where no home can be written to."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

DRAW = """
import os
from webapp.explainer.pictures.figure_style import drawn
assert drawn(lambda figure: figure.add_subplot().plot([1, 2]), (2, 2), ".svg", "x")
print(os.environ.get("MPLCONFIGDIR", ""))
"""


def draw(home: Path, scratch: Path, **more: str) -> subprocess.CompletedProcess[str]:
    away = ("MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME")
    environment = {name: value for name, value in os.environ.items() if name not in away}
    environment |= {"HOME": str(home), "TMPDIR": str(scratch), **more}
    return subprocess.run(
        [sys.executable, "-c", DRAW], check=True, cwd=ROOT, env=environment, capture_output=True, text=True
    )


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    folder = tmp_path / "scratch"
    folder.mkdir()
    return folder


def test_without_a_home_a_figure_is_drawn_without_a_word_and_nothing_is_left(tmp_path: Path, scratch: Path) -> None:
    no_folder = tmp_path / "file"
    no_folder.touch()
    done = draw(no_folder / "home", scratch)
    assert done.stderr == ""
    assert done.stdout.startswith(str(scratch))
    assert list(scratch.iterdir()) == []


def test_a_home_that_can_be_written_to_is_used_as_matplotlib_does(tmp_path: Path, scratch: Path) -> None:
    done = draw(tmp_path / "home", scratch)
    assert (done.stdout, list(scratch.iterdir())) == ("\n", [])
    assert (tmp_path / "home" / ".cache" / "matplotlib").is_dir()


def test_a_folder_that_was_set_for_matplotlib_stays_set(tmp_path: Path, scratch: Path) -> None:
    wanted = str(tmp_path / "mine")
    assert draw(tmp_path / "home", scratch, MPLCONFIGDIR=wanted).stdout == f"{wanted}\n"
