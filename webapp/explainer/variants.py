"""One path explained in many ways: every combination of importance, r, threshold, and policy that is tried.

All are explanations of one and the same path, so that a step means the same in each. An agent of another training may
take another path: its subgoals are then found as state-action pairs on the explained path, and those that are not on it
are kept apart.
"""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.importance import IMPORTANCE_KINDS, ImportanceKind, exact_importance
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import NeverArrives, Trajectory, follow
from webapp.explainer.stochastic import AnyPolicy, World
from webapp.explainer.subgoals import THRESHOLD_RULES, ThresholdRule, check_rule, possible_counts, subgoal_steps
from webapp.explainer.tie_breaking import check_optimal_actions, every_tie, random_tie_break, shortest_path_actions

Factor = Literal["importance", "random actions", "threshold", "ties", "tie average", "training seed"]
FACTORS: tuple[Factor, ...] = ("importance", "random actions", "threshold", "ties", "tie average", "training seed")
"""What varies. `ties`: broken at random. `tie average`: not broken, all optimal actions equally likely."""

PolicyOrigin = Literal["explained", "ties", "tie average", "training seed"]


@dataclass(frozen=True, slots=True)
class StabilitySettings:
    """What is explained, and what is tried beside it. The explained values are always among those tried.

    Attributes:
        importance: The explanation's definition of importance.
        random_steps: The explanation's r, at least 0.
        rule: The explanation's threshold.
        k: Of `top-k`, at least 1; the number of the explanation's subgoals, but at least 1, when left out. Where
            importance falls through no level so often, the next smaller number that it does.
        importances: More definitions to try.
        random_step_counts: More values of r to try, each at least 0; `reward_importance` has none.
        rules: More thresholds to try.
        num_tie_breaks: How many random tie-breakings to try, at least 0; with 0 the tie average is left out too.
        seed: Of the tie-breakings, at least 0.
        tolerance: From 0 up to, not including, 1: the share of variants that may differ before a step flips.

    Raises:
        ValueError: A number lies outside its range, a name is unknown, or `k` is missing.

    Example:
        >>> from webapp.explainer import StabilitySettings
        >>> str(StabilitySettings(random_steps=5))
        'return probability after 5 random actions, threshold mean'
        >>> StabilitySettings(random_steps=3).all_random_steps
        (3, 5, 10, 20, 40)
    """

    importance: ImportanceKind = "return_probability"
    random_steps: int = 10
    rule: ThresholdRule = "mean"
    k: int | None = None
    importances: tuple[ImportanceKind, ...] = ()
    random_step_counts: tuple[int, ...] = (5, 10, 20, 40)
    rules: tuple[ThresholdRule, ...] = THRESHOLD_RULES
    num_tie_breaks: int = 30
    seed: int = 0
    tolerance: float = 0.05

    def __post_init__(self) -> None:
        for number in (self.random_steps, *self.random_step_counts):
            if number < 0:
                raise ValueError(f"the number of random actions must be 0 or larger, not {number}")
        for name in ("num_tie_breaks", "seed"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must be 0 or larger, not {getattr(self, name)}")
        for kind in (self.importance, *self.importances):
            if kind not in IMPORTANCE_KINDS:
                raise ValueError(f"{kind!r} is not an importance; use {', '.join(IMPORTANCE_KINDS)}")
        for rule in (self.rule, *self.rules):
            check_rule(rule, 1 if rule == "top-k" else None)
        if self.rule == "top-k" or self.k is not None:
            check_rule("top-k", self.k)
        if not 0 <= self.tolerance < 1:
            raise ValueError(f"the tolerance must lie from 0 up to, not including, 1, not {self.tolerance}")

    @property
    def all_importances(self) -> tuple[ImportanceKind, ...]:
        """All definitions of importance that are tried, in the order of `IMPORTANCE_KINDS`."""
        return tuple(kind for kind in IMPORTANCE_KINDS if kind in (self.importance, *self.importances))

    @property
    def all_random_steps(self) -> tuple[int, ...]:
        """All values of r that are tried, ascending."""
        return tuple(sorted({self.random_steps, *self.random_step_counts}))

    @property
    def all_rules(self) -> tuple[ThresholdRule, ...]:
        """All thresholds that are tried, in the order of `THRESHOLD_RULES`."""
        return tuple(rule for rule in THRESHOLD_RULES if rule in (self.rule, *self.rules))

    def __str__(self) -> str:
        """Say in one line what is explained."""
        rule = f"top-{self.k}" if self.rule == "top-k" else self.rule
        if self.importance == "reward_importance":
            return f"reward importance, threshold {rule}"
        importance = {"return_probability": "return probability", "ace": "average causal effect"}[self.importance]
        return f"{importance} after {self.random_steps} random actions, threshold {rule}"


@dataclass(frozen=True, slots=True, eq=False)
class OtherAgent:
    """An agent of another training, in the world as it knows it.

    Attributes:
        label: What to call it, such as its seed.
        world: Whose labels and action names are those of the explained world; the order of its states is its own.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: Its way to the goal; where it follows from the world and the policy it may be left out.
    """

    label: str
    world: World
    policy: AnyPolicy
    path: Trajectory | None = None


@dataclass(frozen=True, slots=True)
class Variant:
    """What is explained under one combination of choices.

    Attributes:
        importance: The definition of importance.
        random_steps: r, or None where the definition has none.
        rule: The threshold.
        origin: Where the policy comes from.
        policy: The number of the tie-breaking from 1, `average`, or the agent's label; empty for the explained one.
        subgoals: Steps of the explained path, ascending.
        elsewhere: The state labels and action names of subgoals that are not on the explained path.
    """

    importance: ImportanceKind
    random_steps: int | None
    rule: ThresholdRule
    origin: PolicyOrigin
    policy: str
    subgoals: tuple[int, ...]
    elsewhere: tuple[tuple[Hashable, str], ...] = ()

    def value(self, factor: Factor) -> str:
        """Return what a factor is in this variant; empty where it has no part in it."""
        if factor == "importance":
            return self.importance
        if factor == "random actions":
            return "" if self.random_steps is None else str(self.random_steps)
        if factor == "threshold":
            return self.rule
        return self.policy if self.origin == factor else ""


def explain_variants(
    world: World,
    policy: AnyPolicy,
    path: Trajectory,
    settings: StabilitySettings,
    optimal_actions: NDArray[np.bool_] | None = None,
    agents: Sequence[OtherAgent] = (),
) -> tuple[tuple[Variant, ...], int]:
    """Find the subgoals under all combinations; see `stability.stability` for what is taken and raised.

    Returns:
        The variants, that of the settings first, and the k that `top-k` looked for.
    """
    if not path.num_steps:
        raise ValueError("the path has no steps that could be subgoals: the start is the goal")
    _check_labels(agents)
    explained = _Course("explained", "", world, policy, path)
    values = explained.importance(settings.importance, settings.random_steps)
    k = settings.k or max(1, len(subgoal_steps(values, settings.rule)))
    courses = [explained, *_tie_breaks(explained, settings, optimal_actions), *map(_course_of, agents)]
    variants = [variant for course in courses for variant in _variants(course, settings, k, explained)]
    random_steps = None if settings.importance == "reward_importance" else settings.random_steps
    explanation = (settings.importance, random_steps, settings.rule, "explained")
    variants.sort(key=lambda each: (each.importance, each.random_steps, each.rule, each.origin) != explanation)
    return tuple(variants), k


@dataclass(frozen=True, eq=False)
class _Course:
    """A policy's way to the goal in the world as its agent knows it."""

    origin: PolicyOrigin
    label: str
    world: World
    policy: AnyPolicy
    path: Trajectory

    @cached_property
    def pairs(self) -> list[tuple[Hashable, str]]:
        """`[T]`: the path's states and actions by name, which mean the same in every world."""
        return [(self.world.states[state], self.world.actions[action]) for state, action in self.path.pairs]

    def importance(self, kind: ImportanceKind, random_steps: int) -> NDArray[np.float64]:
        return exact_importance(kind, self.world, self.policy, self.path, random_steps).values


def _tie_breaks(
    explained: _Course, settings: StabilitySettings, optimal_actions: NDArray[np.bool_] | None
) -> Iterator[_Course]:
    world, policy, path = explained.world, explained.policy, explained.path
    if not settings.num_tie_breaks:
        return
    if optimal_actions is None:
        if not isinstance(world, DeterministicMDP):
            return
        optimal_actions = shortest_path_actions(world)
    check_optimal_actions(world, optimal_actions, path)
    for number in range(1, settings.num_tie_breaks + 1):
        drawn = random_tie_break(optimal_actions, policy, path, settings.seed, number)
        yield replace(explained, origin="ties", label=str(number), policy=drawn)
    yield replace(explained, origin="tie average", label="average", policy=every_tie(optimal_actions, policy))


def _course_of(agent: OtherAgent) -> _Course:
    path = agent.path
    if path is None:
        if not isinstance(agent.world, DeterministicMDP) or agent.policy.ndim != 1:
            raise ValueError(f"agent {agent.label!r} leaves its path to chance, so name the path that is explained")
        try:
            path = follow(agent.world, cast("Policy", agent.policy))
        except NeverArrives as error:
            raise NeverArrives(f"agent {agent.label!r}: {error}") from error
    return _Course("training seed", agent.label, agent.world, agent.policy, path)


def _check_labels(agents: Sequence[OtherAgent]) -> None:
    labels = [agent.label for agent in agents]
    for place, label in enumerate(labels):
        if not label or label in labels[:place]:
            raise ValueError(f"each agent needs a label of its own, and {label!r} is none")


def _variants(course: _Course, settings: StabilitySettings, k: int, explained: _Course) -> Iterator[Variant]:
    for kind in settings.all_importances:
        for random_steps in settings.all_random_steps if kind != "reward_importance" else (None,):
            values = course.importance(kind, random_steps or 0)
            for rule in settings.all_rules:
                subgoals, elsewhere = _located(_steps(values, rule, k), course, explained)
                yield Variant(kind, random_steps, rule, course.origin, course.label, subgoals, elsewhere)


def _located(
    steps: tuple[int, ...], course: _Course, explained: _Course
) -> tuple[tuple[int, ...], tuple[tuple[Hashable, str], ...]]:
    """Find the steps of a course on the explained path, and name those that are not there."""
    if course.path is explained.path:
        return steps, ()
    pairs = [course.pairs[step - 1] for step in steps]
    here = tuple(step for step, pair in enumerate(explained.pairs, start=1) if pair in pairs)
    return here, tuple(pair for pair in dict.fromkeys(pairs) if pair not in explained.pairs)


def _steps(values: NDArray[np.float64], rule: ThresholdRule, k: int) -> tuple[int, ...]:
    if rule != "top-k":
        return subgoal_steps(values, rule)
    possible = [count for count in possible_counts(values) if count <= k]
    return subgoal_steps(values, rule, possible[-1]) if possible else ()
