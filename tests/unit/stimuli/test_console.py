"""`xar build` as a terminal shows it."""

import io
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from rich.console import Console

from tests.unit.stimuli.study_folders import (
    change,
    copy_study,
    plan_and_build,
    set_languages,
    small_study,
    study_of_all_kinds,
)
from webapp.cli import main
from webapp.stimuli.build import Built
from webapp.stimuli.console import render_report, shown_progress


def xar_build(study: str, instance: Path) -> Result:
    return CliRunner().invoke(main, ["build", study], env={"XAR_INSTANCE": str(instance)})


def test_a_study_that_is_not_there_is_refused_in_one_line(tmp_path: Path) -> None:
    result = xar_build("nowhere", tmp_path / "instance")
    assert (result.exit_code, result.stdout) == (2, "")
    (line,) = result.stderr.splitlines()
    assert line.startswith("xar: there is no study 'nowhere'; use sakai2021")
    assert line.endswith(", or a folder that holds a study.toml")
    assert not (tmp_path / "instance").exists()


def test_one_problem_of_a_study_is_one_line(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    change(study / "study.toml", "num_draws = 10", "num_draw = 10")
    result = xar_build(str(study), tmp_path / "instance")
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"xar: {study}/study.toml, line ")
    assert line.endswith("explanation.num_draw: is not a setting here; did you mean 'num_draws'?")


def test_several_problems_have_a_line_each(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    change(study / "study.toml", "num_draws = 10", "num_draw = 10")
    change(study / "study.toml", "seed = 2021", "seed = -2021")
    result = xar_build(str(study), tmp_path / "instance")
    assert result.exit_code == 2
    *problems, last = result.stderr.splitlines()
    assert last == "xar: the study cannot be used; 2 problems are listed above"
    assert len(problems) == 2
    assert all(problem.startswith(f"{study}/study.toml, line ") for problem in problems)


@pytest.mark.parametrize("width", [80, 200])
def test_the_report_has_a_line_for_each_layout_and_names_the_version(width: int, tmp_path: Path) -> None:
    built = plan_and_build(small_study(tmp_path), tmp_path / "instance")
    text = report_of(built, width)
    assert "experiment1-a    17  4 14 17                0e+00" in text
    assert built.catalogue.version in text
    assert all(len(line.rstrip()) <= width for line in text.splitlines())


def report_of(built: Built, width: int = 100) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(render_report(built))
    return console.export_text()


def row_of(text: str, kind: str) -> str:
    (row,) = [line for line in text.splitlines() if line.split()[:1] == [kind]]
    return " ".join(row.split())


def test_the_report_tells_how_many_pictures_each_kind_shows(tmp_path: Path) -> None:
    first, second = report_of(plan_and_build(study_of_all_kinds(tmp_path), tmp_path / "instance")).split(
        "pictures in experiment 2"
    )
    assert row_of(first, "full") == "full 18 20 16"
    for kind in ("subgoals", "placebic", "highlights", "landmarks", "evenly_spaced"):
        assert row_of(first, kind) == f"{kind} 6 6 6"
    assert row_of(first, "none") == "none 1 1 1"
    assert row_of(first, "random") == "random 6-7 6-7 6-7"
    assert row_of(first, "tailored_first") == "tailored_first 2-6 2-6 2-6"
    assert row_of(second, "first_key_point") == "first_key_point 3 3"


def test_an_arm_that_happens_to_show_the_subgoals_is_marked(tmp_path: Path) -> None:
    """On `experiment2-a` evenly spaced steps are the subgoals 8, 14 and 17, as good as everywhere else they are not."""
    marked = report_of(plan_and_build(study_of_all_kinds(tmp_path), tmp_path / "instance"))
    assert "evenly_spaced = 6 6" in " ".join(marked.split())
    assert "the arm happens to choose the very steps that are the subgoals" in " ".join(marked.split())
    (tmp_path / "other").mkdir()
    plain = report_of(plan_and_build(small_study(tmp_path / "other"), tmp_path / "instance"))
    assert "happens" not in plain


def test_an_unvalidated_translation_is_told_until_a_back_translation_is_cited(tmp_path: Path) -> None:
    study = small_study(tmp_path)
    set_languages(study, "en", "ja")
    wish = "ja: rating items are an unvalidated translation; [translations.ja] back_translation cites one"
    assert wish in report_of(plan_and_build(study, tmp_path / "instance"))
    with (study / "study.toml").open("a", encoding="utf-8") as file:
        file.write('\n[translations.ja]\nback_translation = "doi:10.1000/1"\n')
    assert "unvalidated" not in report_of(plan_and_build(study, tmp_path / "instance"))


def test_progress_is_shown_stage_by_stage() -> None:
    console = Console(width=80, record=True, file=io.StringIO(), force_terminal=True)
    with shown_progress(console) as report:
        for stage in ("training", "drawing pictures"):
            report(stage, 0.0)
            report(stage, 1.0)
    text = console.export_text()
    assert text.rindex("training") < text.rindex("drawing pictures")
    assert text.count("100%") >= 2
