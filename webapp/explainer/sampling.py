"""Importance by sampling (Sakai et al. 2021, Algorithm 1): rollouts on a table or through a recurrent world model."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from webapp.explainer.importance import PROBABILITY_KINDS, Importance, ProbabilityKind
from webapp.explainer.importance_deterministic import check_path
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.seeding import torch_seed
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import AnyPolicy, World
from webapp.explainer.stop_rule import Sides, StopRule
from webapp.explainer.trials import Question, Tally

if TYPE_CHECKING:
    from webapp.explainer.batched_rollouts import RecurrentWorldModel

QUESTIONS: dict[ProbabilityKind, tuple[Question, ...]] = {
    "return_probability": ("returns",),
    "ace": ("arrives", "arrives_denied"),
}
"""The chance that an importance is, or the two whose difference it is."""

Count = Callable[[Question, int], Tally]
"""Runs so many trials from each of a path's states but the target, and counts how often the answer is yes."""


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    r"""What sampling found, and why it ended.

    Attributes:
        importance: Of each of the path's `T + 1` states, with standard errors.
        num_trials: So many rollouts each state got, for each of the probabilities that its importance is made of.
        stopped: `settled` if the sampling ended because every state's side of the threshold was settled, else `budget`.
        unsettled: The steps, from 1 to T + 1, whose side of the threshold was not settled, ascending.
        num_truncated: How many rollouts were broken off because their policy phase took too long. They count as
            neither returned nor arrived, and settle nothing.

    Raises:
        ValueError: All is settled and yet something is not.

    Example:
        >>> from webapp.explainer import StopRule, follow, parse_layout, plan_world, sample_importance, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> rule = StopRule(budget=50_000, early=True)
        >>> found = sample_importance("return_probability", world, policy, path, 2, rule, seed=0)
        >>> found.stopped, found.num_trials < 50_000, found.unsettled
        ('settled', True, ())
    """

    importance: Importance
    num_trials: int
    stopped: Literal["settled", "budget"]
    unsettled: tuple[int, ...]
    num_truncated: int = 0

    def __post_init__(self) -> None:
        if self.stopped == "settled" and self.unsettled:
            raise ValueError(f"sampling that has settled every side leaves none open, and here are {self.unsettled}")


def sample(
    kind: ProbabilityKind,
    world: World,
    policy: AnyPolicy,
    path: Trajectory,
    random_steps: int,
    rule: StopRule,
    seed: int,
    device: str | None = None,
) -> Sampled:
    r"""Estimate the importance of every state of a path by rollouts on the table (Algorithm 1).

    For `ace` both probabilities are estimated, each from rollouts of its own.

    Args:
        kind: Which of the two definitions.
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities. A rollout in which it cannot reach the goal any more neither
            returns nor arrives.
        path: A way to a goal that the policy may take.
        random_steps: r, at least 0.
        rule: When to stop.
        seed: Of the draws, at least 0. Equal seeds give equal numbers on the same kind of device.
        device: Where to run, as torch calls it; the accelerator, if there is one, when left out.

    Raises:
        ValueError: A number is too small, the importance is no probability, there is no such device, or the policy
            may not take the path to a goal.

    Example:
        >>> from webapp.explainer import (
        ...     StopRule, exact_importance, follow, parse_layout, plan_world, sample_importance, tabulate)
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> found = sample_importance("ace", world, policy, path, 2, StopRule(budget=1000), seed=0)
        >>> exact = exact_importance("ace", world, policy, path, 2)
        >>> bool((abs(found.importance.values - exact.values) <= 5 * found.importance.standard_errors).all())
        True
    """
    from webapp.explainer.batched_rollouts import TableRollouts, chosen_device, seeded  # noqa: PLC0415 - loads torch.

    place = chosen_device(device)
    rollouts = TableRollouts(world, policy, path, place)
    generator = seeded(torch_seed(seed, "rollouts", "table"), place)
    return spend(kind, path, rule, lambda question, size: rollouts.count(question, random_steps, size, generator))


def sample_recurrent(
    kind: ProbabilityKind,
    model: "RecurrentWorldModel",
    mdp: DeterministicMDP,
    policy: Policy,
    path: Trajectory,
    random_steps: int,
    rule: StopRule,
    seed: int,
) -> Sampled:
    """Estimate the importance of every state of a path by rollouts through a recurrent world model (Algorithm 1).

    The model's own predictions lead each rollout, its hidden state carried along from the path's state on.

    Args:
        kind: Which of the two definitions.
        model: The world model.
        mdp: The model's table: what its states are called, and where the policy's path runs.
        policy: `[S]` on that table.
        path: The policy's path to the goal.
        random_steps: r, at least 0.
        rule: When to stop.
        seed: Of the draws, at least 0.

    Raises:
        ValueError: A number is too small, the importance is no probability, or the path does not follow the policy to
            a goal.
    """
    from webapp.explainer.batched_rollouts import RecurrentRollouts, seeded  # noqa: PLC0415 - loads torch.

    check_path(mdp, policy, path)
    rollouts = RecurrentRollouts(model, mdp, policy, path)
    generator = seeded(torch_seed(seed, "rollouts", "recurrent"))
    return spend(kind, path, rule, lambda question, size: rollouts.count(question, random_steps, size, generator))


def spend(kind: ProbabilityKind, path: Trajectory, rule: StopRule, count: Count) -> Sampled:
    """Spend trials until the rule ends it, whatever it is that runs them.

    Args:
        kind: Which importance the trials are for.
        path: The path whose states are sampled. One that is the target alone needs no trial.
        rule: When to stop.
        count: Runs the trials.

    Raises:
        ValueError: The importance is no probability.
    """
    if kind not in PROBABILITY_KINDS:
        raise ValueError(f"{kind} is not a probability and cannot be sampled; take the exact solver")
    questions = QUESTIONS[kind]
    tallies = [Tally.of_none(path.num_steps) for _ in questions]
    if not path.num_steps:
        return Sampled(Importance(np.zeros(1), np.zeros(1)), 0, "settled", ())
    sides = Sides(path.num_steps, rule)
    for num_trials in rule.looks:
        new = [count(question, num_trials - tallies[0].num_trials) for question in questions]
        tallies = [tally.plus(more) for tally, more in zip(tallies, new, strict=True)]
        sides.look(tallies)
        if rule.early and not sides.unsettled:
            break
    return Sampled(
        importance_of(tallies),
        num_trials=tallies[0].num_trials,
        stopped="settled" if rule.early and not sides.unsettled else "budget",
        unsettled=sides.unsettled,
        num_truncated=sum(int(tally.truncated.sum()) for tally in tallies),
    )


def importance_of(tallies: list[Tally]) -> Importance:
    """Return the shares of one tally, or the differences of two independent ones, and the target's certain 0."""
    values, errors = np.zeros((2, len(tallies[0].successes) + 1))
    values[:-1], errors[:-1] = tallies[0].shares()
    for less in tallies[1:]:
        others, their_errors = less.shares()
        values[:-1] -= others
        errors[:-1] = np.hypot(errors[:-1], their_errors)
    return Importance(values, errors)
