"""`xar build` as a terminal shows it."""

import io
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from rich.console import Console

from tests.unit.stimuli.study_folders import change, copy_study, plan_and_build, small_study
from webapp.cli import main
from webapp.stimuli.console import render_report, shown_progress


def xar_build(study: str, instance: Path) -> Result:
    return CliRunner().invoke(main, ["build", study], env={"XAR_INSTANCE": str(instance)})


def test_a_study_that_is_not_there_is_refused_in_one_line(tmp_path: Path) -> None:
    result = xar_build("nowhere", tmp_path / "instance")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == "xar: there is no study 'nowhere'; use sakai2021, or a folder that holds a study.toml\n"
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
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(render_report(built))
    text = console.export_text()
    assert "experiment1-a    17  4 14 17                0e+00" in text
    assert built.catalogue.version in text
    assert all(len(line.rstrip()) <= width for line in text.splitlines())


def test_progress_is_shown_stage_by_stage() -> None:
    console = Console(width=80, record=True, file=io.StringIO(), force_terminal=True)
    with shown_progress(console) as report:
        for stage in ("training", "drawing pictures"):
            report(stage, 0.0)
            report(stage, 1.0)
    text = console.export_text()
    assert text.rindex("training") < text.rindex("drawing pictures")
    assert text.count("100%") >= 2
