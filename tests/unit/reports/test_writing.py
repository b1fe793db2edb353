"""The folder of a report: the same bytes from the same input, complete or not there, never overwritten."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import pytest

from tests.unit.reports.made_up import ORIGIN, made_up_plan, made_up_report, made_up_study
from webapp.reports.assembly import Assembled
from webapp.reports.origin import origin_of
from webapp.reports.writing import is_there, name_of_run, write
from webapp.runs.run_folders import RunFolderError, check_run_name


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results") / "analysis" / "first"
    write(folder, made_up_study(), ORIGIN, made_up_report)
    return folder


def test_the_same_input_gives_the_same_bytes_in_every_file_wherever_it_is_written(folder: Path, tmp_path: Path) -> None:
    write(tmp_path / "elsewhere", made_up_study(), ORIGIN, made_up_report)
    assert contents(tmp_path / "elsewhere") == contents(folder)


def test_a_folder_holds_report_tables_figures_methods_and_where_they_come_from(folder: Path) -> None:
    files = contents(folder)
    assert {"report.html", "methods.txt", "settings.json", "run.json", "tables/assumptions.csv"} <= set(files)
    assert {"figures/bars.svg", "figures/bars.png", "figures/box.svg", "tables/wide.csv"} <= set(files)
    assert "plan.txt" not in files
    about = json.loads(files["run.json"])
    assert about["files"] == {
        name: hashlib.sha256(content).hexdigest()
        for name, content in files.items()
        if name not in {"run.json", "settings.json"}
    }
    assert about["participants_analysed"] == 24
    assert json.loads(files["settings.json"])["input"] == dict(ORIGIN.files)


def test_nothing_tells_the_time_or_a_place(folder: Path) -> None:
    for name, content in contents(folder).items():
        assert str(folder).encode() not in content, name
        assert folder.parent.parent.name.encode() not in content, name


def test_the_registered_plan_is_a_file_of_its_own(tmp_path: Path) -> None:
    data = made_up_study(plan=made_up_plan(text="# Plan\n"))
    write(tmp_path / "run", data, ORIGIN, lambda: made_up_report(data, {}))
    assert (tmp_path / "run/plan.txt").read_text(encoding="utf-8") == "# Plan\n"


def test_a_complete_report_is_known_again_and_never_overwritten(folder: Path) -> None:
    assert is_there(folder, ORIGIN)
    assert not is_there(folder, replace(ORIGIN, code="5e" * 32))
    before = contents(folder)
    with pytest.raises(RunFolderError, match="never overwritten"):
        write(folder, made_up_study(), ORIGIN, made_up_report)
    assert contents(folder) == before


@pytest.mark.parametrize("name", ["report.html", "tables/summary.csv"])
def test_a_report_whose_files_were_changed_is_not_passed_off_as_the_report(tmp_path: Path, name: str) -> None:
    data = made_up_study()
    write(tmp_path / "run", data, ORIGIN, lambda: made_up_report(data, {}))
    assert is_there(tmp_path / "run", ORIGIN)
    (tmp_path / "run" / name).write_bytes(b"better numbers")
    with pytest.raises(RunFolderError, match=f"{name} was changed or removed"):
        is_there(tmp_path / "run", ORIGIN)
    (tmp_path / "run" / name).unlink()
    with pytest.raises(RunFolderError, match=f"{name} was changed or removed"):
        is_there(tmp_path / "run", ORIGIN)


def test_a_defect_leaves_no_complete_report_and_the_next_try_writes_one(folder: Path, tmp_path: Path) -> None:
    def defective() -> Assembled:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write(tmp_path / "run", made_up_study(), ORIGIN, defective)
    assert not is_there(tmp_path / "run", ORIGIN)
    write(tmp_path / "run", made_up_study(), ORIGIN, made_up_report)
    assert contents(tmp_path / "run") == contents(folder)


def test_the_name_of_a_run_follows_from_all_that_its_bytes_depend_on() -> None:
    data = made_up_study()
    name = name_of_run(data, ORIGIN)
    study, version, given, settings = name.split("-")
    assert (study, version, given) == ("sakai2021", "4d4d4d4d", ORIGIN.input_hash[:8])
    assert len(settings) == 8
    assert name_of_run(data, replace(ORIGIN, asked={**ORIGIN.asked, "mode": "bot"})) != name
    assert name_of_run(data, replace(ORIGIN, code="5e" * 32)) != name
    assert name_of_run(data, replace(ORIGIN, files={"data/a.csv": "00" * 32})) != name
    assert name_of_run(made_up_study(study_version=""), ORIGIN).count("-") == 2


@pytest.mark.parametrize("study", ["", "..", "a study/of mine", "研究", "s" * 300])
def test_the_name_of_a_run_is_one_of_a_folder_whatever_the_study_is_called(study: str) -> None:
    assert check_run_name(name_of_run(made_up_study(study=study), ORIGIN))


def test_an_origin_holds_program_and_versions_and_is_ready_for_json() -> None:
    found = origin_of({"data/a.csv": "00" * 32}, {"mode": "live"}, ["a.csv was changed"])
    assert set(found.versions) >= {"python", "xar", "statsmodels", "scipy"}
    assert json.loads(json.dumps(found.settings())) == found.settings()
