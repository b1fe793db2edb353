"""Folders of runs: resumed after whatever interruption, never overwritten."""

import json
import os
from pathlib import Path

import pytest

from webapp.runs.run_folders import RunFolderError, check_run_name, open_run

SETTINGS = {"seed": 1, "learning": {"rate": 0.5, "units": 64}}
ROWS = [{"run_id": "a", "episodes": 3, "first_goal": None}]
MAKER = {"torch": "2.13.0", "processor": "x86_64"}


def begun(path: Path, *units: int) -> Path:
    with open_run(path, SETTINGS) as folder:
        for unit in units:
            folder.keep(unit, ROWS, MAKER)
    return path


def test_a_finished_unit_is_there_when_the_run_is_taken_up_again(tmp_path: Path) -> None:
    begun(tmp_path / "run", 0, 2)
    with open_run(tmp_path / "run", SETTINGS) as folder:
        assert folder.finished == {0: ROWS, 2: ROWS}


@pytest.mark.parametrize("cut", [1, 5, 20])
def test_a_line_that_was_cut_off_counts_for_nothing_and_is_written_anew(tmp_path: Path, cut: int) -> None:
    journal = begun(tmp_path / "run", 0, 1) / "journal.jsonl"
    os.truncate(journal, journal.stat().st_size - cut)
    with open_run(tmp_path / "run", SETTINGS) as folder:
        assert folder.finished == {0: ROWS}
        folder.keep(1, ROWS, MAKER)
    with open_run(tmp_path / "run", SETTINGS) as folder:
        assert folder.finished == {0: ROWS, 1: ROWS}


def test_nothing_after_a_line_that_cannot_be_read_counts(tmp_path: Path) -> None:
    journal = begun(tmp_path / "run", 0) / "journal.jsonl"
    with journal.open("a") as file:
        file.write('{"unit": 1, "ro\n{"unit": 2, "rows": [], "maker": {}}\n')
    with open_run(tmp_path / "run", SETTINGS) as folder:
        assert folder.finished == {0: ROWS}


def test_a_complete_run_has_its_files_and_is_never_opened_again(tmp_path: Path) -> None:
    path = tmp_path / "run"
    with open_run(path, SETTINGS) as folder:
        folder.keep(0, ROWS, MAKER)
        folder.complete({"rows.csv": b"run_id\na\n"}, {"commit": "abc"})
    assert (path / "rows.csv").read_bytes() == b"run_id\na\n"
    assert json.loads((path / "run.json").read_text()) == {"commit": "abc"}
    assert json.loads((path / "settings.json").read_text()) == SETTINGS
    assert sorted(file.name for file in path.iterdir()) == ["rows.csv", "run.json", "settings.json"]
    with pytest.raises(RunFolderError, match=r"run holds a complete run and is never overwritten; give another --run"):
        begun(path)
    assert (path / "rows.csv").read_bytes() == b"run_id\na\n"


def test_a_run_with_other_settings_is_refused_and_the_difference_named(tmp_path: Path) -> None:
    begun(tmp_path / "run", 0)
    other = {"seed": 1, "learning": {"rate": 0.25, "units": 64}}
    with (
        pytest.raises(RunFolderError, match=r"unfinished run with other settings: rate was 0\.5 and is 0\.25"),
        open_run(tmp_path / "run", other),
    ):
        pass
    with open_run(tmp_path / "run", SETTINGS) as folder:
        assert folder.finished == {0: ROWS}


def test_a_run_that_other_code_began_is_not_gone_on_with(tmp_path: Path) -> None:
    with open_run(tmp_path / "run", {"code": "abc"}):
        pass
    with (
        pytest.raises(
            RunFolderError, match="run holds an unfinished run of another version of xar; give another --run"
        ),
        open_run(tmp_path / "run", {"code": "def"}),
    ):
        pass


def test_two_processes_cannot_write_to_one_run(tmp_path: Path) -> None:
    with (
        open_run(tmp_path / "run", SETTINGS),
        pytest.raises(RunFolderError, match="is in use by another process"),
        open_run(tmp_path / "run", SETTINGS),
    ):
        pass


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(RunFolderError, match="is not empty and holds no run"), open_run(tmp_path, SETTINGS):
        pass
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(RunFolderError, match="file/run cannot be written: Not a directory"),
        open_run(tmp_path / "file" / "run", SETTINGS),
    ):
        pass


def test_what_made_the_rows_is_known_however_often_a_run_was_taken_up(tmp_path: Path) -> None:
    begun(tmp_path / "run", 0, 1)
    other = {"torch": "2.14.0", "processor": "arm64"}
    with open_run(tmp_path / "run", SETTINGS) as folder:
        folder.keep(2, ROWS, other)
        assert folder.all_makers == sorted([MAKER, other], key=lambda maker: maker["processor"])


def test_settings_that_were_never_written_whole_do_not_stand_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / ".settings.json.part").write_text('{"seed"')
    begun(tmp_path / "run", 0)
    with open_run(tmp_path / "run", SETTINGS) as folder:
        assert folder.finished == {0: ROWS}


@pytest.mark.parametrize("content", ["{", "[]", "null"])
def test_broken_settings_are_named(tmp_path: Path, content: str) -> None:
    begun(tmp_path / "run")
    (tmp_path / "run" / "settings.json").write_text(content)
    with pytest.raises(RunFolderError, match=r"settings\.json cannot be read"), open_run(tmp_path / "run", SETTINGS):
        pass


@pytest.mark.parametrize("name", ["", "..", "a/b", "-x", "x" * 81, "a b", "ü"])
def test_a_name_that_could_lead_elsewhere_is_refused(name: str) -> None:
    with pytest.raises(RunFolderError, match="a run is named by"):
        check_run_name(name)


def test_ordinary_names_are_taken() -> None:
    assert check_run_name("paper-2026.1_b") == "paper-2026.1_b"
