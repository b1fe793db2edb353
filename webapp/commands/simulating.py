"""`xar simulate`: the simulation experiments of the paper's section 5, each with one command."""

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from webapp.command_line import CommandError, show
from webapp.commands.runs import Finish, opened_run

if TYPE_CHECKING:
    from webapp.runs.run_folders import RunFolder


@click.group()
def simulate() -> None:
    """Run the simulation experiments of Sakai et al. 2021, section 5.

    Each writes settings, rows, tables, figures and a summary into results/simulations/NAME/RUN. What was interrupted is
    taken up again by the same command; what is complete is never overwritten.
    """


def _run_options(command: Callable[..., None]) -> Callable[..., None]:
    for option in reversed(_RUN_OPTIONS):
        command = option(command)
    return command


_RUN_OPTIONS = (
    click.option(
        "--settings",
        "preset",
        type=click.Choice(["paper", "ours"]),
        help="The paper's numbers of runs or trials, taken if not given, or ours, which are larger.",
    ),
    click.option("--quick", is_flag=True, help="A small map and few runs, to see within seconds that it works."),
    click.option(
        "--layout", type=click.Path(path_type=Path), metavar="FILE", help="Another map than the paper's (our drawing)."
    ),
    click.option("--seed", type=click.IntRange(min=0), metavar="S", help="Of all that is drawn; 2021 if not given."),
    click.option(
        "--run", "run_name", metavar="RUN", help="The name of the run's folder; if not given, from the settings."
    ),
    click.option(
        "--out",
        type=click.Path(file_okay=False, path_type=Path),
        default=Path("results"),
        metavar="DIR",
        help="The folder of results.",
    ),
)

_SWEEP_OPTIONS = (
    click.option("--runs", "num_runs", type=click.IntRange(2, 10_000), metavar="N", help="Agents per condition."),
    click.option(
        "--episodes",
        "max_episodes",
        type=click.IntRange(1, 100_000),
        metavar="N",
        help="The budget after which a run is censored.",
    ),
    click.option(
        "--scheduler",
        default="loky",
        metavar="WHERE",
        help="loky, processes of this machine, or dask://host:port, an existing cluster.",
    ),
    click.option(
        "--workers", type=click.IntRange(1, 1024), metavar="N", help="Processes of loky; one per core if not given."
    ),
)


def _sweep_options(command: Callable[..., None]) -> Callable[..., None]:
    for option in reversed(_SWEEP_OPTIONS):
        command = option(command)
    return _run_options(command)


@simulate.command()
@_run_options
def importance(**options: Any) -> None:  # noqa: ANN401 - handed on as they are.
    """Compute the importance of every step, with subgoals and key points (section 5.1)."""
    from webapp.config import read_config
    from webapp.simulations import importance as experiment
    from webapp.stimuli.console import shown_progress
    from webapp.storage.instance import prepare_instance

    with _refusals():
        preset = _preset(options)
        settings = _with_layout(experiment.SETTINGS[preset], options)
        with _opened("importance", preset, settings.to_dict(), options) as (folder, finish):
            instance = read_config(os.environ).instance
            if settings.learned:
                prepare_instance(instance)
            with shown_progress(_error_console()) as progress:
                rows = experiment.run(settings, instance / "explain-cache", progress)
            finish(experiment.summarise(settings, rows), {})
    _tell(folder)


@simulate.command()
@_sweep_options
def usefulness(**options: Any) -> None:  # noqa: ANN401
    """Compare how fast agents learn that are told the derived subgoals, others, or none (section 5.2)."""
    from webapp.simulations import usefulness as experiment

    _sweep("usefulness", experiment, options)


@simulate.command()
@_sweep_options
def count(**options: Any) -> None:  # noqa: ANN401
    """Compare how fast agents learn that are told 0 to 5 subgoals (section 5.3)."""
    from webapp.simulations import count as experiment

    _sweep("count", experiment, options)


def _sweep(name: str, experiment: Any, options: Mapping[str, Any]) -> None:  # noqa: ANN401 - a module.
    from webapp.simulations.claims import few_runs_note
    from webapp.simulations.console import shown_runs
    from webapp.simulations.schedulers import parse_scheduler

    with _refusals():
        scheduler = parse_scheduler(options["scheduler"], options["workers"] or os.cpu_count() or 1)
        preset = _preset(options)
        settings = _with_layout(experiment.SETTINGS[preset], options)
        if options["num_runs"] is not None:
            settings = replace(settings, num_runs=options["num_runs"])
        if options["max_episodes"] is not None:
            settings = replace(settings, fresh=replace(settings.fresh, max_episodes=options["max_episodes"]))
        experiment.conditions(settings)  # What cannot be run is refused before a folder is made.
        with _opened(name, preset, settings.to_dict(), options) as (folder, finish):
            with shown_runs(_error_console()) as report:
                rows = experiment.run(settings, folder, scheduler, report)
            finish(experiment.summarise(settings, rows), {"scheduler": str(scheduler)})
    _tell(folder, few_runs_note(settings.num_runs))


def _preset(options: Mapping[str, Any]) -> str:
    if options["quick"] and options["preset"] is not None:
        raise CommandError("--quick has settings of its own; leave --settings out")
    return "quick" if options["quick"] else options["preset"] or "paper"


def _with_layout(settings: Any, options: Mapping[str, Any]) -> Any:  # noqa: ANN401 - of whichever experiment.
    """Return the settings with the map and the seed that were given."""
    changes: dict[str, object] = {} if options["seed"] is None else {"seed": options["seed"]}
    if options["layout"] is not None:
        from webapp.commands.sources import read_layout

        layout = read_layout(options["layout"])
        changes |= {"layout": str(layout), "layout_name": options["layout"].stem}
        if hasattr(settings, "believed_layout"):
            changes["believed_layout"] = None
    return replace(settings, **changes)


def _opened(
    name: str, preset: str, settings: Mapping[str, object], options: Mapping[str, Any]
) -> AbstractContextManager[tuple["RunFolder", Finish]]:
    given = options["run_name"]
    known = {"experiment": name, "settings": settings}
    run_name = _default_name(preset, settings) if given is None else given
    return opened_run(f"simulations/{name}", run_name, known, options["out"])


def _default_name(preset: str, settings: Mapping[str, object]) -> str:
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()
    return f"{preset}-{digest[:8]}"


def _error_console() -> Any:  # noqa: ANN401 - a console of rich, which is loaded only here.
    from rich.console import Console

    return Console(stderr=True)


def _tell(folder: "RunFolder", *notes: str) -> None:
    """Print the claims, what is to be said of them, and where everything is."""
    import pandas as pd

    from webapp.simulations.console import claims_table

    claims: pd.DataFrame = pd.read_csv(folder.path / "claims.csv")
    show(claims_table(claims), *filter(None, notes), f"Everything is in {folder.path}; begin with summary.md.")


@contextmanager
def _refusals() -> Iterator[None]:
    """Turn what an experiment refuses into one line and exit status 2."""
    from webapp.simulations.schedulers import SchedulerError
    from webapp.storage.instance import InstanceError

    try:
        yield
    except (ArithmeticError, InstanceError, OSError, SchedulerError, ValueError) as error:
        raise CommandError(str(error)) from error
