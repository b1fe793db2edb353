"""`xar analyse`, as people at a terminal use it."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pandas as pd
import pytest
from click.testing import CliRunner, Result

from tests.conftest import ROOT, XAR
from tests.unit.reports.exported import VERSION, export_crowd
from webapp.cli import main
from webapp.commands.runs import stoppable

PEOPLE = 16
SEED = 3
"""Of whom three did not complete."""


def analyse(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["analyse", *map(str, arguments)])


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def only_run(out: Path) -> Path:
    (folder,) = (out / "analysis").iterdir()
    return folder


def refused(result: Result) -> str:
    """Return the one line in which a mistake is told."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    return line


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of a few people."""
    return export_crowd(tmp_path_factory.mktemp("crowd"), PEOPLE, seed=SEED)


@pytest.fixture(scope="module")
def finished(export: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """Where the report on them is, and what was printed."""
    out = tmp_path_factory.mktemp("results")
    return out, analyse(export, "--out", out)


def test_the_terminal_tells_who_was_analysed_what_was_found_and_where_the_report_is(
    finished: tuple[Path, Result],
) -> None:
    out, result = finished
    assert result.exit_code == 0, result.output
    assert "13 participants with 195 ratings are analysed, of 16 who agreed to take part; 3 are not" in result.stdout
    assert "comparisons" in result.stdout
    assert result.stdout.splitlines()[-1] == f"The report: {only_run(out) / 'report.html'}"
    assert only_run(out).name.startswith(f"sakai2021-{VERSION[:8]}-")


def test_every_byte_is_the_same_in_another_process_from_another_folder_into_another_one(
    export: Path, finished: tuple[Path, Result], tmp_path: Path
) -> None:
    copy = shutil.copytree(export, tmp_path / "a copy" / "of the data")
    environment = {**os.environ, "PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo", "LC_ALL": "C"}
    command = [str(XAR), "analyse", str(copy), "--out", str(tmp_path / "out")]
    subprocess.run(command, check=True, env=environment, cwd=tmp_path, capture_output=True)
    again, before = only_run(tmp_path / "out"), only_run(finished[0])
    assert again.name == before.name
    assert contents(again) == contents(before)


def test_a_report_that_is_there_is_not_made_again(export: Path, finished: tuple[Path, Result]) -> None:
    out, _ = finished
    before = {path: path.stat().st_mtime_ns for path in only_run(out).rglob("*")}
    result = analyse(export, "--out", out)
    assert result.exit_code == 0
    assert result.stdout == f"The report on these data is there already: {only_run(out) / 'report.html'}\n"
    assert {path: path.stat().st_mtime_ns for path in only_run(out).rglob("*")} == before


def test_another_analysis_does_not_overwrite_a_report_of_that_name(export: Path, finished: tuple[Path, Result]) -> None:
    out, _ = finished
    name = only_run(out).name
    told = refused(analyse(export, "--out", out, "--run", name, "--include-incomplete"))
    assert "never overwritten" in told
    assert "--run" in told


def test_the_run_says_what_was_read_and_what_came_out(export: Path, finished: tuple[Path, Result]) -> None:
    folder = only_run(finished[0])
    about = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    settings = json.loads((folder / "settings.json").read_text(encoding="utf-8"))
    assert set(about["files"]) == set(contents(folder)) - {"run.json", "settings.json"}
    assert settings["analysis"]["mode"] == "live"
    assert all((export / name).is_file() for name in settings["input"])
    assert not (folder / "journal.jsonl").exists()


def test_incomplete_people_are_analysed_on_demand_and_the_report_says_so(export: Path, tmp_path: Path) -> None:
    result = analyse(export, "--out", tmp_path, "--include-incomplete", "--run", "all")
    assert result.exit_code == 0, result.output
    assert "15 participants with" in result.stdout
    assert "left before the first rating (1)" in result.stdout
    assert "--include-incomplete was given" in result.stdout
    assert "--include-incomplete was given" in (tmp_path / "analysis/all/report.html").read_text(encoding="utf-8")


def test_files_that_were_changed_are_refused_unless_that_is_meant(export: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(export, tmp_path / "data")
    ratings = copy / "data/description-ratings_data.csv"
    lines = ratings.read_bytes().splitlines(keepends=True)
    ratings.write_bytes(b"".join([*lines[:-5]]))
    told = refused(analyse(copy, "--out", tmp_path))
    assert "description-ratings_data.csv" in told
    assert "changed after the export" in told
    assert not (tmp_path / "analysis").exists()
    result = analyse(copy, "--out", tmp_path, "--changed-data-ok", "--run", "changed")
    assert result.exit_code == 0, result.output
    assert "changed after the export" in (tmp_path / "analysis/changed/methods.txt").read_text(encoding="utf-8")


def test_what_cannot_be_analysed_is_told_in_a_line(export: Path, tmp_path: Path) -> None:
    assert "is not there" in refused(analyse(tmp_path / "nowhere", "--out", tmp_path))
    assert "holds no ratings" in refused(analyse(tmp_path, "--out", tmp_path))
    assert "mode bot" in refused(analyse(export, "--mode", "bot", "--out", tmp_path))
    assert "other" in refused(analyse(export, "--study", "other", "--out", tmp_path))
    assert "not 'a/b'" in refused(analyse(export, "--run", "a/b", "--out", tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_several_problems_get_a_line_each(tmp_path: Path) -> None:
    rows = [["p1", "1", 1, "a", "full", "general", "six"], ["p2", "1", 1, "a", "full", "general", "seven"]]
    names = ["participant", "experiment", "trial", "layout", "kind", "item", "rating"]
    pd.DataFrame(rows, columns=names).to_csv(tmp_path / "ratings.csv", index=False)
    result = analyse(tmp_path / "ratings.csv", "--out", tmp_path / "out")
    assert result.exit_code == 2
    *problems, last = result.stderr.splitlines()
    assert len(problems) == 2
    assert "line 2" in problems[0]
    assert "2 problems are listed above" in last


def test_one_person_in_one_file_gets_a_report_of_statements(tmp_path: Path) -> None:
    rows = [["p1", "1", trial, "a", kind, "general", 3] for trial, kind in enumerate(("full", "subgoals"), 1)]
    names = ["participant", "experiment", "trial", "layout", "kind", "item", "rating"]
    pd.DataFrame(rows, columns=names).to_csv(tmp_path / "ratings.csv", index=False)
    result = analyse(tmp_path / "ratings.csv", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "not tested" in result.stdout
    assert (only_run(tmp_path / "out") / "report.html").read_text(encoding="utf-8").count("No number:") >= 3


def test_a_quick_verb_loads_nothing_of_the_analysis() -> None:
    code = "import sys, webapp.cli; print({'pandas', 'numpy', 'scipy', 'jinja2', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("is_begun", [False, True])
def test_an_analysis_that_is_told_to_stop_says_so_in_a_line_and_leaves_nothing(
    number: signal.Signals, is_begun: bool, export: Path, tmp_path: Path
) -> None:
    out = tmp_path / "new" / "results"
    words = [str(XAR), "analyse", str(export), "--out", str(out)]
    with subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as running:
        if is_begun:
            deadline = time.monotonic() + 60
            while not list(out.glob("analysis/*/settings.json")):
                assert time.monotonic() < deadline
                time.sleep(0.01)
        else:
            while "pandas" not in Path(f"/proc/{running.pid}/maps").read_text(encoding="utf-8"):
                time.sleep(0.01)
        running.send_signal(number)
        told, error = running.communicate(timeout=60)
    assert (running.returncode, told, error.strip()) == (130, "", "Stopped. Nothing was written.")
    assert list(tmp_path.iterdir()) == []


def test_folders_that_were_there_before_stay_when_an_analysis_is_stopped(tmp_path: Path) -> None:
    kept, made = tmp_path / "results" / "analysis" / "kept", tmp_path / "results" / "analysis" / "made"
    kept.mkdir(parents=True)

    def stop_in(folder: Path, number: signal.Signals) -> None:
        with stoppable(folder, *folder.parents):
            folder.mkdir(exist_ok=True)
            (folder / "settings.json").touch()
            signal.raise_signal(number)

    for folder, number in ((made, signal.SIGTERM), (kept, signal.SIGINT)):
        with pytest.raises(click.exceptions.Exit) as stopped:
            stop_in(folder, number)
        assert stopped.value.exit_code == 130
    assert list(kept.parent.iterdir()) == [kept]
    assert list(kept.iterdir()) == [kept / "settings.json"]
