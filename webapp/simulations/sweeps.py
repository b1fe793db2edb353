"""A sweep: many learning runs, cut into stacks, spread over workers, kept one stack after another."""

from collections.abc import Callable, Sequence

import pandas as pd

from webapp.explainer.learning.fresh_agents import FreshAgent, Outcome, learn
from webapp.explainer.learning.fresh_settings import FreshSettings
from webapp.explainer.worlds.layout import parse_layout
from webapp.runs.provenance import code_fingerprint, maker_of_rows
from webapp.runs.run_folders import Row, RunFolder
from webapp.simulations.conditions import Condition, PlannedRun, planned_runs, units
from webapp.simulations.schedulers import Scheduler, work_off
from webapp.simulations.settings import SweepSettings


class OtherCode(ValueError):
    """Rows of two versions of the program do not belong into one run."""


ReportRuns = Callable[[int, int], None]
"""Takes how many runs are done, and how many there are."""

COLUMNS = (
    "run_id",
    "condition",
    "kind",
    "variant",
    "steps",
    "keeps_optimum",
    "number",
    "episodes",
    "is_optimal",
    "actions",
    "goals",
    "first_goal",
)
"""Of the rows: `episodes` is the budget where `is_optimal` is 0, and the run is censored there."""


def sweep(
    conditions: Sequence[Condition],
    settings: SweepSettings,
    folder: RunFolder,
    scheduler: Scheduler,
    report: ReportRuns,
) -> pd.DataFrame:
    """Run what the folder does not have yet and return all rows, in the order of the conditions.

    Args:
        conditions: The groups.
        settings: How many runs, and how they learn.
        folder: Where each finished unit is kept at once.
        scheduler: Where to run.
        report: Told of every finished unit.

    Raises:
        OtherCode: A worker has another version of the program.
        SchedulerError: The scheduler cannot be used, or cannot go on.
    """
    runs = planned_runs(conditions, settings.num_runs)
    stacks = dict(enumerate(units(runs, settings.runs_per_stack)))
    report(_num_done(folder), len(runs))
    todo = [(number, _unit(stack, settings)) for number, stack in stacks.items() if number not in folder.finished]
    for number, (outcomes, maker) in work_off(scheduler, _learn_stack, todo):
        rows = [_row(run, outcome) for run, outcome in zip(stacks[number], outcomes, strict=True)]
        folder.keep(number, rows, maker)
        report(_num_done(folder), len(runs))
    return as_rows([row for number in sorted(folder.finished) for row in folder.finished[number]])


def as_rows(rows: Sequence[Row]) -> pd.DataFrame:
    """Return rows as a table whose columns have types of their own."""
    table = pd.DataFrame(list(rows), columns=list(COLUMNS))
    numbers = ("number", "episodes", "actions", "goals", "first_goal", "is_optimal", "keeps_optimum")
    return table.astype(dict.fromkeys(numbers, "Int64"))


def _num_done(folder: RunFolder) -> int:
    return sum(len(rows) for rows in folder.finished.values())


def _unit(stack: Sequence[PlannedRun], settings: SweepSettings) -> tuple[object, ...]:
    agents = tuple(FreshAgent(run.run_id, run.condition.pairs, once=run.condition.variant == "once") for run in stack)
    return settings.layout, agents, settings.fresh, settings.seed, code_fingerprint()


def _learn_stack(
    layout: str, agents: Sequence[FreshAgent], settings: FreshSettings, seed: int, code: str
) -> tuple[tuple[Outcome, ...], dict[str, str]]:
    """Do one unit of work, wherever that is, and say what did it.

    Raises:
        OtherCode: What is installed there is not what sent the work.
    """
    if code_fingerprint() != code:
        raise OtherCode("a worker has another version of xar; install the same one everywhere, and go on")
    return learn(parse_layout(layout), agents, settings, seed), maker_of_rows()


def _row(run: PlannedRun, outcome: Outcome) -> Row:
    condition = run.condition
    return {
        "run_id": run.run_id,
        "condition": condition.name,
        "kind": condition.kind,
        "variant": condition.variant,
        "steps": condition.told,
        "keeps_optimum": int(condition.keeps_optimum),
        "number": run.number,
        "episodes": outcome.num_episodes,
        "is_optimal": int(outcome.is_optimal),
        "actions": outcome.num_steps,
        "goals": outcome.num_goals,
        "first_goal": outcome.first_goal,
    }
