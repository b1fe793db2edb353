"""How useful derived subgoals are to somebody who learns (Sakai et al. 2021, section 5.2).

Fresh agents learn with a sub-reward on the derived subgoals, on random steps of the path that share some or none of
them, on the choices of rival selectors, on nothing, and on pairs that lead away from the goal, which must not help.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from webapp.explainer.mdp import StateAction
from webapp.explainer.seeding import stream
from webapp.explainer.selectors import (
    bottlenecks,
    evenly_spaced_steps,
    highlights,
    landmarks,
    landmarks_by_fact,
)
from webapp.explainer.solvers import distances_to_goal
from webapp.runs.run_folders import RunFolder
from webapp.simulations.claims import Claim
from webapp.simulations.conditions import Condition, Variant
from webapp.simulations.learning_report import report_files
from webapp.simulations.schedulers import Scheduler
from webapp.simulations.settings import QUICK, SweepSettings
from webapp.simulations.sub_rewards import keeps_shortest_path
from webapp.simulations.sweeps import ReportRuns, sweep
from webapp.simulations.tasks import Task, read_task

NAME = "usefulness"


@dataclass(frozen=True, slots=True, kw_only=True)
class UsefulnessSettings(SweepSettings):
    """The settings of this experiment.

    Attributes:
        num_draws: So many random choices of steps for each number of steps that they share with the derived ones.
    """

    num_draws: int = 4

    def __post_init__(self) -> None:
        SweepSettings.__post_init__(self)  # super() does not know the class that slots make anew.
        if self.num_draws < 1:
            raise ValueError(f"num_draws must be 1 or larger, not {self.num_draws}")


SETTINGS = {
    "paper": UsefulnessSettings(),
    "ours": UsefulnessSettings(num_runs=30),
    "quick": UsefulnessSettings(**QUICK, num_draws=1),
}


def run(settings: UsefulnessSettings, folder: RunFolder, scheduler: Scheduler, report: ReportRuns) -> pd.DataFrame:
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


def summarise(settings: UsefulnessSettings, rows: pd.DataFrame) -> dict[str, bytes]:
    """Return the tables, figures and summary of finished rows by file name; the same rows give the same bytes."""
    groups = conditions(settings)
    return report_files(NAME, settings, groups, list(claims(groups)), rows)


def conditions(settings: UsefulnessSettings) -> tuple[Condition, ...]:
    """List the groups: one without sub-rewards, then all others in each variant.

    Raises:
        LayoutError: The map cannot be used.
        ValueError: It has no subgoal beside the goal.
    """
    task = read_task(settings.layout, settings.layout_name)
    if not task.subgoals:
        raise ValueError(f"{settings.layout_name} has no subgoal beside the goal, so there is nothing to share")
    chosen = list(_choices(task, settings))
    nothing = Condition("no sub-reward", "none", (), (), "none", keeps_optimum=True)
    told = [_condition(task, settings, choice, variant) for variant in settings.variants for choice in chosen]
    return nothing, *told


def claims(groups: Sequence[Condition]) -> Iterator[Claim]:
    """Yield the paper's claims on these groups, then ours."""
    nothing = groups[0]
    for variant in dict.fromkeys(group.variant for group in groups[1:]):
        own = [group for group in groups if group.variant == variant]
        derived = own[0]
        for group in own[1:]:
            yield from _claims_on(group, derived, nothing)
        yield Claim("the derived subgoals need fewer episodes than no sub-reward", "ours", "fewer", derived, nothing)


def _claims_on(group: Condition, derived: Condition, nothing: Condition) -> Iterator[Claim]:
    if group.kind == "random, some shared":
        yield Claim("random steps that share a derived subgoal: no difference", "5.2", "no difference", derived, group)
    elif group.kind == "random, none shared":
        yield Claim("random steps that share no derived subgoal need more episodes", "5.2", "fewer", derived, group)
    elif group.kind == "derived again":
        statement = "the derived subgoals with other seeds: no difference (control)"
        yield Claim(statement, "ours", "no difference", derived, group)
    elif group.kind == "rival":
        yield Claim("the derived subgoals need no more episodes than a rival's", "ours", "not more", derived, group)
    elif group.kind == "useless":
        statement = "pairs behind the start need no fewer episodes than no sub-reward (control)"
        yield Claim(statement, "ours", "not fewer", group, nothing)


@dataclass(frozen=True, slots=True)
class _Choice:
    name: str
    kind: str
    pairs: tuple[StateAction, ...]
    steps: tuple[int, ...] = ()


def _condition(task: Task, settings: UsefulnessSettings, choice: _Choice, variant: Variant) -> Condition:
    fresh = settings.fresh
    keeps = keeps_shortest_path(task.mdp, choice.pairs, fresh.sub_reward, fresh.discount, once=variant == "once")
    return Condition(choice.name, choice.kind, choice.pairs, choice.steps, variant, keeps)


def _choices(task: Task, settings: UsefulnessSettings) -> Iterator[_Choice]:
    """Yield what agents are told, as many pairs in each choice as there are derived subgoals."""
    for name in ("derived", "derived again"):
        yield _Choice(name, name, task.pairs(task.subgoals), task.subgoals)
    for num_shared in range(len(task.subgoals) - 1, -1, -1):
        kind = "random, some shared" if num_shared else "random, none shared"
        for steps in random_steps_sharing(task, num_shared, settings):
            yield _Choice(f"random {' '.join(map(str, steps))}", kind, task.pairs(steps), steps)
    for name, steps in rival_steps(task, settings):
        yield _Choice(name, "rival", task.pairs(steps), steps)
    yield _Choice("behind the start", "useless", pairs_behind_the_start(task, len(task.subgoals)))


def random_steps_sharing(task: Task, num_shared: int, settings: UsefulnessSettings) -> list[tuple[int, ...]]:
    """Draw different choices of steps that share so many with the derived subgoals, each derived one in turn.

    Returns:
        `num_draws` choices, or fewer where the path does not have so many.
    """
    rng = stream(settings.seed, "simulations", "random steps", str(num_shared))
    derived, others = task.subgoals, [step for step in task.inner_steps if step not in task.subgoals]
    num_others = len(derived) - num_shared
    if num_others > len(others):
        return []
    found: list[tuple[int, ...]] = []
    for turn in range(_TURNS * settings.num_draws):
        shared = [derived[(turn + place) % len(derived)] for place in range(num_shared)]
        drawn = rng.choice(others, num_others, replace=False).tolist()
        steps = tuple(sorted([*shared, *drawn]))
        if steps not in found and len(found) < settings.num_draws:
            found.append(steps)
    return found


def rival_steps(task: Task, settings: UsefulnessSettings) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Yield what each rival selector chooses when it may name as many steps as there are derived subgoals.

    The step that reaches the goal is left out, as it is of the derived subgoals.
    """
    mdp, path = task.mdp, task.path
    rng = stream(settings.seed, "simulations", "bottlenecks")
    choose: dict[str, Callable[[int], tuple[int, ...]]] = {
        "highlights": highlights(mdp, task.policy, path, settings.fresh.discount, 2).choose,
        "landmarks": landmarks(mdp, path).choose,
        "landmark facts": landmarks_by_fact(mdp, path).choose,
        "bottlenecks": bottlenecks(mdp, path, rng).choose,
        "evenly spaced": lambda count: evenly_spaced_steps(path.num_steps, count),
    }
    wanted = len(task.subgoals)
    for name, chosen in choose.items():
        budgets = range(wanted, path.num_steps + 1)
        inner = (tuple(step for step in chosen(count) if step < path.num_steps) for count in budgets)
        if (steps := next((each for each in inner if len(each) == wanted), None)) is not None:
            yield name, steps


def pairs_behind_the_start(task: Task, count: int) -> tuple[StateAction, ...]:
    """Return pairs that lead away from the goal, to states as far behind the start as there are.

    Raises:
        ValueError: The map has fewer such pairs.
    """
    distances = distances_to_goal(task.mdp)
    after = distances[task.mdp.next_state]
    leads_away = (after > distances[:, None]) & np.isfinite(after) & (after > distances[task.mdp.start])
    leads_away &= task.mdp.next_state != np.arange(task.mdp.num_states)[:, None]
    found = sorted(zip(*np.nonzero(leads_away), strict=True), key=lambda pair: (-after[pair], pair))
    if len(found) < count:
        raise ValueError(f"{count} pairs that lead away from the goal are needed, and the map has {len(found)}")
    return tuple((int(state), int(action)) for state, action in found[:count])


_TURNS = 100
"""So many times as often as needed is drawn before the path is taken to have no more choices."""
