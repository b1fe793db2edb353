"""`xar rehearse`: a dry run with planted effects, from the bots' first page to the report and its verdicts."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from webapp.command_line import CommandError, show
from webapp.commands.runs import opened_run, run_name_of, run_refusals

if TYPE_CHECKING:
    from webapp.rehearsal.calibration import Calibration
    from webapp.rehearsal.rehearsal import Rehearsed


@click.command()
@click.argument("study", required=False, metavar="[STUDY]")
@click.option("--participants", type=click.IntRange(2, 10_000), default=60, metavar="N", help="How many take part.")
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="KIND[.ITEM]=D",
    help="Plant an effect, as `xar bots` does; if none is given, 1 on each experiment's first kind of the plan.",
)
@click.option("--mix", default="attentive=1", metavar="NAME=SHARE,...", help="Behaviours of the bots.")
@click.option("--seed", type=click.IntRange(min=0), default=0, metavar="S", help="Of all that is drawn.")
@click.option("--workers", type=click.IntRange(1, 64), default=4, metavar="W", help="How many bots at a time.")
@click.option(
    "--calibrate",
    "num_studies",
    type=click.IntRange(2, 100_000),
    metavar="S",
    help="Instead: S studies without effects and S planted ones, at the level of the data.",
)
@click.option("--run", "run_name", metavar="RUN", help="The name of the run's folder.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("results"),
    metavar="DIR",
    help="The folder of results.",
)
def rehearse(  # noqa: PLR0913 - one for each option.
    study: str | None,
    participants: int,
    effects: tuple[str, ...],
    mix: str,
    seed: int,
    *,
    workers: int,
    num_studies: int | None,
    run_name: str | None,
    out: Path,
) -> None:
    """Rehearse STUDY with bots whose opinions are known, and see whether the analysis finds them, and nothing else.

    Bots go through the real pages of a server on an instance of its own, which is gone afterwards; their data are
    exported and analysed as planned. The exit status is 1 if a planned test did not come out as planted. STUDY is the
    name of a declared study, or a folder that holds a study file (XAR_STUDY).
    """
    from webapp.config import read_config
    from webapp.stimuli.sources import find_study

    with _refusals():
        config = read_config(os.environ)
        folder = find_study(config.study if study is None else study)
        if num_studies is not None:
            is_well = _calibrate(folder, participants, effects, seed, num_studies, run_name, out)
        else:
            is_well = _rehearse(
                folder, config.instance, participants, effects, mix, seed, workers=workers, run_name=run_name, out=out
            )
    if not is_well:
        raise click.exceptions.Exit(1)


def _rehearse(  # noqa: PLR0913
    folder: Path,
    instance: Path,
    participants: int,
    effects: Sequence[str],
    mix: str,
    seed: int,
    *,
    workers: int,
    run_name: str | None,
    out: Path,
) -> bool:
    from rich.console import Console

    from webapp.bots.mix import parse_mix
    from webapp.commands.powering import read_plan
    from webapp.rehearsal.performance import Cast
    from webapp.rehearsal.planting import planted_effects, told
    from webapp.rehearsal.rehearsal import rehearse as hold
    from webapp.stimuli.console import shown_progress
    from webapp.stimuli.learned import learned_agents

    study, plan = read_plan(str(folder))
    if not plan.num_tests:
        raise CommandError(f"the plan of {study.name} compares nothing, so there is nothing to rehearse")
    parse_mix(mix)  # What cannot be read is refused before a folder is made.
    planted = planted_effects(effects, study, plan)
    now = datetime.now(UTC)
    known = {"study": study.name, "participants": participants, "effects": told(planted), "mix": mix, "seed": seed}
    name = f"{study.name}-{now:%Y%m%dT%H%M%S}" if run_name is None else run_name
    with opened_run("rehearsal", name, known, out) as (run, finish):
        cast = Cast(participants, mix, planted, seed, workers)
        with shown_progress(Console(stderr=True)) as building, _shown_bots(participants) as on_end:
            found = hold(folder, instance, cast, now, building=building, on_end=on_end, agents=learned_agents)
        finish(found.files(), {})
    _tell(found, run.path)
    return found.is_well


def _tell(found: "Rehearsed", path: Path) -> None:
    from webapp.rehearsal.console import shown_beside, verdicts_beside_effects
    from webapp.rehearsal.verdicts import conclusion

    show(
        *shown_beside(found.beside),
        verdicts_beside_effects(found.verdicts),
        conclusion(found.verdicts),
        f"Everything is in {path}; begin with report/report.html.",
    )


def _calibrate(
    folder: Path,
    participants: int,
    effects: Sequence[str],
    seed: int,
    num_studies: int,
    run_name: str | None,
    out: Path,
) -> bool:
    from webapp.commands.powering import read_plan
    from webapp.rehearsal.calibration import calibrate
    from webapp.rehearsal.planting import planted_effects, told
    from webapp.rehearsal.tables import calibration_files
    from webapp.study.required_sample import design_digest

    study, plan = read_plan(str(folder))
    planted = planted_effects(effects, study, plan)
    known = {
        "study": study.name,
        "design_and_plan": design_digest(study, plan),
        "participants": participants,
        "effects": told(planted),
        "studies": num_studies,
        "seed": seed,
    }
    name = run_name_of(f"{study.name}-calibration", known) if run_name is None else run_name
    with opened_run("rehearsal", name, known, out) as (run, finish):
        with _shown_studies() as report:
            found = calibrate(study, plan, planted, participants, num_studies, seed, report)
        finish(calibration_files(found), {})
    _tell_promises(found, run.path)
    return found.is_kept


_BROKEN = (
    "The interval of a share misses what is promised. Chance does that in about one of twenty runs for each share that "
    "is promised; run it with another --seed, or with more studies, before you suspect the analysis."
)


def _tell_promises(found: "Calibration", path: Path) -> None:
    from webapp.rehearsal.console import rendered
    from webapp.rehearsal.tables import promise_table

    said = "Every promise is kept." if found.is_kept else _BROKEN
    show(rendered(promise_table(found)), said, f"Everything is in {path}.")


@contextmanager
def _shown_bots(num_bots: int) -> Iterator[Callable[[], None]]:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as bars:
        task = bars.add_task("Bots", total=num_bots)
        yield lambda: bars.advance(task)


@contextmanager
def _shown_studies() -> Iterator[Callable[[int, int], None]]:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as bars:
        task = bars.add_task("Studies", total=None)
        yield lambda done, total: bars.update(task, completed=done, total=total)


@contextmanager
def _refusals() -> Iterator[None]:
    """Turn what is refused into one line and exit status 2."""
    from webapp.bots.errors import BotError, NotLetInAsBotError
    from webapp.storage.exports import ExportError

    with run_refusals():
        try:
            yield
        except (BotError, ExportError, NotLetInAsBotError) as error:
            raise CommandError(str(error)) from error
