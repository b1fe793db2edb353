"""How many subgoals are enough (Sakai et al. 2021, section 5.3).

Fresh agents learn with a sub-reward on 0, 1, 2 ... subgoals: the derived ones, of which the least important are left
out first, and added ones that meet the paper's two requirements. Consecutive counts are compared.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import pandas as pd

from webapp.runs.run_folders import RunFolder
from webapp.simulations.claims import Claim
from webapp.simulations.conditions import Condition, Variant
from webapp.simulations.learning_report import report_files
from webapp.simulations.schedulers import Scheduler
from webapp.simulations.settings import QUICK, SweepSettings
from webapp.simulations.sub_rewards import add_subgoal, keeps_shortest_path
from webapp.simulations.sweeps import ReportRuns, sweep
from webapp.simulations.tasks import Task, read_task

NAME = "count"
_MOST = 10
"""A group for each number: more than ten would not be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CountSettings(SweepSettings):
    """The settings of this experiment.

    Attributes:
        most_subgoals: The largest number of subgoals.
    """

    most_subgoals: int = 5

    def __post_init__(self) -> None:
        SweepSettings.__post_init__(self)  # super() does not know the class that slots make anew.
        if not 1 <= self.most_subgoals <= _MOST:
            raise ValueError(f"most_subgoals must be from 1 to {_MOST}, not {self.most_subgoals}")


SETTINGS = {
    "paper": CountSettings(),
    "ours": CountSettings(num_runs=30),
    "quick": CountSettings(**QUICK, most_subgoals=3),
}


def run(settings: CountSettings, folder: RunFolder, scheduler: Scheduler, report: ReportRuns) -> pd.DataFrame:
    """Let all agents learn and return a row for each.

    Args:
        settings: What to run.
        folder: Where finished units are kept; what it has is not run again.
        scheduler: Where to run.
        report: Told how many runs are done.

    Raises:
        LayoutError: The map cannot be used.
        ValueError: It has no subgoal beside the goal.
        SchedulerError: The scheduler cannot be used, or cannot go on.
    """
    return sweep(conditions(settings), settings, folder, scheduler, report)


def summarise(settings: CountSettings, rows: pd.DataFrame) -> dict[str, bytes]:
    """Return the tables, figures and summary of finished rows by file name; the same rows give the same bytes."""
    groups = conditions(settings)
    return report_files(NAME, settings, groups, list(claims(groups)), rows)


def conditions(settings: CountSettings) -> tuple[Condition, ...]:
    """List the groups: no subgoal, then each number of them in each variant.

    Where one subgoal is left out there are as many ways as derived subgoals; the one that leaves out the least
    important comes first, the others follow, named by what they keep.

    Raises:
        LayoutError: The map cannot be used.
        ValueError: It has no subgoal beside the goal.
    """
    task = read_task(settings.layout, settings.layout_name)
    if not task.subgoals:
        raise ValueError(f"{settings.layout_name} has no subgoal beside the goal, so there is nothing to count")
    nothing = Condition("0", "main", (), (), "none", keeps_optimum=True)
    told = [
        _condition(task, settings, steps, kind, variant)
        for variant in settings.variants
        for steps, kind in _choices(task, settings)
    ]
    return nothing, *told


def claims(groups: Sequence[Condition]) -> Iterator[Claim]:
    """Yield the paper's claims on these groups, with each way of leaving one subgoal out."""
    nothing = groups[0]
    num_derived = max((len(group.steps) for group in groups if group.kind == "derived"), default=_MOST)
    for variant in dict.fromkeys(group.variant for group in groups[1:]):
        own = [group for group in groups if group.variant == variant]
        line = [nothing, *(group for group in own if group.kind != "other")]
        for fewer, more in pairwise(line):
            yield _claim(fewer, more, num_derived, "5.3")
        for other in (group for group in own if group.kind == "other"):
            count = len(other.steps)
            if count == 1:
                yield _claim(nothing, other, num_derived, "5.3, another left out")
            for more in line[count + 1 : count + 2]:
                yield _claim(other, more, num_derived, "5.3, another left out")


def _claim(fewer: Condition, more: Condition, num_derived: int, source: str) -> Claim:
    """Up to the derived number each subgoal helps; beyond it none does."""
    counts = f"{len(fewer.steps)} and {len(more.steps)} subgoals"
    if len(more.steps) <= num_derived:
        return Claim(f"{counts}: the more need fewer episodes", source, "fewer", more, fewer)
    return Claim(f"{counts}: no difference", source, "no difference", more, fewer)


def subgoals_by_count(task: Task, settings: CountSettings) -> Iterator[tuple[int, ...]]:
    """Yield the steps for 1, 2, ... subgoals, up to the largest number or as many as the two requirements allow."""
    by_importance = sorted(task.subgoals, key=lambda step: (-task.importance[step - 1], step))
    for count in range(1, min(len(by_importance), settings.most_subgoals) + 1):
        yield tuple(sorted(by_importance[:count]))
    steps = list(task.subgoals)
    while len(steps) < settings.most_subgoals:
        added = add_subgoal(task, steps, settings.fresh.sub_reward)
        if added is None:
            return
        steps = sorted([*steps, added])
        yield tuple(steps)


def _choices(task: Task, settings: CountSettings) -> Iterator[tuple[tuple[int, ...], str]]:
    for steps in subgoals_by_count(task, settings):
        yield steps, "derived" if steps == task.subgoals else "main"
        if len(steps) == len(task.subgoals) - 1:
            for left_out in task.subgoals:
                others = tuple(step for step in task.subgoals if step != left_out)
                if others != steps:
                    yield others, "other"


def _condition(task: Task, settings: CountSettings, steps: tuple[int, ...], kind: str, variant: Variant) -> Condition:
    fresh, pairs = settings.fresh, task.pairs(steps)
    keeps = keeps_shortest_path(task.mdp, pairs, fresh.sub_reward, fresh.discount, once=variant == "once")
    name = f"{len(steps)} ({' '.join(map(str, steps))})"
    return Condition(name, kind, pairs, steps, variant, keeps)
