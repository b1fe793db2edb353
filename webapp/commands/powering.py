"""`xar power`: how many participants the planned analysis needs, by simulating the declared design."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from webapp.command_line import CommandError, show
from webapp.commands.runs import complete_run, opened_run, run_name_of, run_refusals

if TYPE_CHECKING:
    from webapp.power.settings import PowerSettings
    from webapp.study.analysis_plan import Plan
    from webapp.study.protocol import Study


class _Numbers(click.ParamType[tuple[float, ...]]):
    """Numbers separated by commas, in any order; they are sorted, and each counts once."""

    name = "numbers"

    def __init__(self, number: Callable[[str], float], example: str) -> None:
        self._number = number
        self._example = example

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:  # noqa: ANN401 - whatever click hands on.
        """Read them."""
        if isinstance(value, tuple):
            return value
        try:
            return tuple(sorted({self._number(part.strip()) for part in value.split(",")}))
        except ValueError:
            self.fail(f"{value!r} is no list of numbers; write such as {self._example}", param, ctx)


@click.command()
@click.argument("study", required=False, metavar="[STUDY]")
@click.option(
    "--effects",
    type=_Numbers(float, "0.3,0.5,0.8"),
    default="0.3,0.5,0.8",
    metavar="D,...",
    help="Latent differences d.",
)
@click.option(
    "--participants",
    type=_Numbers(int, "10,20,40"),
    default="10,20,30,40,60,80,120,160,240,320,400",
    metavar="N,...",
    help="Numbers of participants.",
)
@click.option(
    "--studies",
    "num_studies",
    type=click.IntRange(min=2),
    default=400,
    metavar="S",
    help="Simulated studies for each N and d.",
)
@click.option("--sd", "between_sd", type=float, default=0.6, metavar="SD", help="Between people, of 1 in total.")
@click.option("--power", "wanted", type=float, default=0.8, metavar="P", help="The power that is asked for.")
@click.option("--seed", type=click.IntRange(min=0), default=2021, metavar="SEED", help="Of all that is drawn.")
@click.option("--workers", type=click.IntRange(1, 1024), metavar="W", help="Processes; one per core if not given.")
@click.option("--run", "run_name", metavar="RUN", help="The run's folder; from study and settings if not given.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("results"),
    metavar="DIR",
    help="The folder of results.",
)
def power(study: str | None, *, workers: int | None, run_name: str | None, out: Path, **options: Any) -> None:  # noqa: ANN401
    """Simulate the planned analysis of STUDY, and tell how many participants it needs.

    STUDY is the name of a declared study, or a folder that holds a study file (XAR_STUDY). Participants are drawn for
    its design, a difference d is planted in the first kind of each planned contrast, and the planned model is fitted.
    `xar study check` tells the result until the design or the plan changes. A run of the same settings that is there
    already is told again, and nothing is overwritten.
    """
    from webapp.config import read_config
    from webapp.power.console import paper_table, required_table
    from webapp.power.design import planned_questions
    from webapp.power.required import required_samples
    from webapp.storage.instance import prepare_instance
    from webapp.study.required_sample import design_digest, write_required

    with run_refusals():
        config = read_config(os.environ)
        declared, plan = read_plan(config.study if study is None else study)
        settings = _settings(options)
        if not planned_questions(declared, plan):
            raise CommandError(f"the plan of {declared.name} compares nothing, so there is no power to simulate")
        folder, found, required = _simulated(declared, plan, settings, workers or os.cpu_count() or 1, run_name, out)
        prepare_instance(config.instance)
        samples = required_samples(required, settings)
        write_required(config.instance, design_digest(declared, plan), samples)
    pages = (required_table(required, settings), paper_table(found), str(samples))
    show(*(page for page in pages if page is not None), f"Everything is in {folder}; begin with summary.md.")


def read_plan(name: str) -> tuple["Study", "Plan"]:
    """Read a study and its plan without building anything.

    Args:
        name: Of a declared study, or its folder.

    Raises:
        StudyError: The study file cannot be used.
    """
    from webapp.stimuli.sources import find_study
    from webapp.study.analysis_plan import plan_of
    from webapp.study.protocol import parse_study

    file = find_study(name) / "study.toml"
    declared = parse_study(file.read_text(encoding="utf-8"), str(file))
    return declared, plan_of(declared)


def _settings(options: dict[str, Any]) -> "PowerSettings":
    from webapp.power.settings import PowerSettings

    return PowerSettings(
        effects=options["effects"],
        participants=options["participants"],
        num_studies=options["num_studies"],
        between_sd=options["between_sd"],
        power=options["wanted"],
        seed=options["seed"],
    )


def _simulated(
    study: "Study", plan: "Plan", settings: "PowerSettings", workers: int, run_name: str | None, out: Path
) -> Any:  # noqa: ANN401 - the folder and two tables of pandas, which is loaded only here.
    from rich.console import Console

    from webapp.power.console import shown_studies
    from webapp.power.design import planned_questions
    from webapp.power.required import power_table, required_table
    from webapp.power.simulation import Levels, simulate
    from webapp.power.summary import files_of, read_tables
    from webapp.study.required_sample import design_digest

    questions = planned_questions(study, plan)
    levels = Levels(plan.alpha / plan.num_tests, plan.alpha)
    known: Mapping[str, object] = {
        "study": study.name,
        "design_and_plan": design_digest(study, plan),
        "settings": settings.to_dict(),
    }
    name = run_name_of(study.name, known) if run_name is None else run_name
    if (there := complete_run("power", name, known, out)) is not None:
        click.echo("The complete run of these settings is there already, and this is what it found.\n")
        return there, *read_tables(there)
    with opened_run("power", name, known, out) as (folder, finish):
        with shown_studies(Console(stderr=True)) as report:
            counts = simulate(questions, settings, levels, folder, workers, report)
        found = power_table(counts, questions, settings, levels)
        required = required_table(found, settings.power)
        finish(files_of(study.name, plan, settings, levels, found, required), {})
    return folder.path, found, required
