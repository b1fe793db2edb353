import json
import shutil
from datetime import date
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import change, copy_study, files_of, plan_and_build, without_plan
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.checking import Check, check_study
from webapp.stimuli.sources import STUDIES
from webapp.study.problems import StudyError

NO_TEXT = (
    "layouts/experiment2-a.txt: cannot be read as UTF-8 text: "
    "'utf-8' codec can't decode byte 0xff in position 0: invalid start byte"
)
TODAY = date(2026, 11, 27)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return copy_study(tmp_path)


def check(folder: Path) -> Check:
    return check_study(folder, folder.parent / "instance", TODAY)


def problems_of(folder: Path) -> list[str]:
    with pytest.raises(StudyError) as error:
        check(folder)
    return [problem.removeprefix(f"{folder}/") for problem in error.value.problems]


def declare(folder: Path, section: str) -> None:
    change(folder / "study.toml", "[explanation]\n", f"{section}\n\n[explanation]\n")


def test_a_check_of_a_study_that_was_not_built_says_so_and_leaves_nothing_behind(folder: Path) -> None:
    before = files_of(folder.parent)
    found = check(folder)
    assert (found.agents, found.full_round, [report.experiment for report in found.arms]) == ("planner", 6, ["1", "2"])
    assert files_of(folder.parent) == before
    json.dumps(found.to_json())


def test_a_check_of_a_built_study_looks_at_what_was_built(folder: Path) -> None:
    instance = folder.parent / "instance"
    plan_and_build(folder, instance)
    before = files_of(instance)
    assert check_study(folder, instance, TODAY, planner_agents).agents == "learned"
    assert files_of(instance) == before
    change(folder / "study.toml", "seed = 2021", "seed = 2022")
    assert check_study(folder, instance, TODAY, planner_agents).agents == "planner"


def test_what_is_missing_before_data_are_collected_is_noted(folder: Path) -> None:
    assert check(folder).notes == (
        "before `xar serve --live`, fill in contact, ethics_approval, retention_until",
        "no exclusion rules are declared; declare them in [quality] before there are data",
        "no planned analysis in words is frozen with the study; name its file in [analysis]",
        "ja: rating items are an unvalidated translation; [translations.ja] cites one",
    )


def test_a_study_with_all_of_that_has_nothing_to_note(folder: Path) -> None:
    file = folder / "study.toml"
    change(file, '"<name and e-mail address of the responsible researcher>"', '"a@example.org"')
    change(file, '"<name of the ethics committee and number of the approval>"', '"Committee, 1"')
    change(file, '"<date, such as 2030-12-31>"', '"2030-12-31"')
    change(file, 'languages = ["en", "ja"]', 'languages = ["en"]')
    declare(folder, "[quality]\nstraight_lining = true")
    change(file, '# plan = "analysis_plan.md"', 'plan = "plan.md"')
    (folder / "plan.md").write_text("A t-test.", encoding="utf-8")
    assert check(folder).notes == ()
    change(file, '"2030-12-31"', '"2026-11-27"')
    assert check(folder).notes == ("retention_until is 2026-11-27, which is not in the future",)


@pytest.mark.parametrize(
    ("section", "note"),
    [
        ("[quality]\nmin_total_minutes = 30.0", "quality.min_total_minutes is 30, and the quickest may take "),
        ("", "no exclusion rules are declared"),
    ],
)
def test_rules_are_compared_with_what_is_expected(section: str, note: str, folder: Path) -> None:
    declare(folder, section)
    assert any(told.startswith(note) for told in check(folder).notes)


@pytest.mark.parametrize(("quota", "note"), [(60, None), (50, 48), (3, 6)])
def test_a_quota_that_leaves_a_round_unfinished_is_noted(quota: int, note: int | None, folder: Path) -> None:
    change(folder / "study.toml", "lease_minutes = 60", f"lease_minutes = 60\nquota = {quota}")
    wanted = (
        [] if note is None else [f"quota is {quota}, no multiple of the 6 of a full round; {note} would be balanced"]
    )
    assert [told for told in check(folder).notes if told.startswith("quota")] == wanted


def test_a_single_kind_is_noted(folder: Path) -> None:
    without_plan(folder)
    change(folder / "study.toml", 'kinds = ["full", "subgoals", "random"]', 'kinds = ["full"]')
    assert "no comparisons are planned; declare them in [analysis] before there are data" in check(folder).notes
    assert "experiment '1' has a single kind, so nothing is compared within it" in check(folder).notes


def test_problems_of_other_files_are_told_although_the_study_file_is_wrong_too(folder: Path) -> None:
    change(folder / "study.toml", "num_draws = 10", "num_drawz = 10")
    change(folder / "layouts" / "experiment1-b.txt", "#.K.#..#", "#...#..#")
    (folder / "layouts" / "experiment1-c.txt").unlink()
    (folder / "layouts" / "experiment2-a.txt").write_bytes(b"\xff\xfe")
    (folder / "texts" / "ja.toml").write_text("[welcome]\ntitle = 3\n", encoding="utf-8")
    (folder / "texts" / "en.toml").unlink()
    assert problems_of(folder) == [
        "study.toml, line 53: explanation.num_drawz: is not a setting here; did you mean 'num_draws'?",
        "layouts/experiment1-b.txt, line 8, column 8: there is no key (K); put one on the map",
        "layouts/experiment1-c.txt: is missing",
        NO_TEXT,
        "texts/en.toml: is missing",
        "texts/ja.toml, line 2: welcome.title: is 3; write a text or a list of texts, none empty",
    ]


def test_a_study_file_that_is_no_toml_is_told_alone(folder: Path) -> None:
    change(folder / "study.toml", "seed = 2021", "seed 2021")
    (folder / "texts" / "ja.toml").unlink()
    (problem,) = problems_of(folder)
    assert problem.startswith(
        "study.toml, line 9, column 6: not a TOML file: Expected '=' after a key in a key/value pair"
    )
    assert problem.endswith("; write a setting as key = value")


def test_a_missing_plan_is_told_together_with_missing_texts(folder: Path) -> None:
    change(folder / "study.toml", '# plan = "analysis_plan.md"', 'plan = "plan.md"')
    (folder / "texts" / "ja.toml").unlink()
    assert problems_of(folder) == ["texts/ja.toml: is missing", "plan.md: is missing; analysis.plan names it"]


@pytest.mark.parametrize("name", ["sakai2021", "understanding"])
def test_the_shipped_studies_pass(name: str, tmp_path: Path) -> None:
    study = Path(shutil.copytree(STUDIES / name, tmp_path / name))
    assert check(study).study.name == name
