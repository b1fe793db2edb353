"""How far an explanation depends on choices that nobody means by it: r, ties, the training seed and the threshold.

r and the threshold are free parameters of the method (Sakai et al. 2021, sections 4.2.1, 4.2.2). A deterministic policy
that breaks ties makes open-floor cells look important (`tie_breaking`), and two trainings need not learn the same
policy. All combinations are tried on one path (`variants`); a step that is not the same in nearly all of them flips.
"""

import math
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import AnyPolicy, World
from webapp.explainer.variants import (
    FACTORS,
    Factor,
    OtherAgent,
    StabilitySettings,
    Variant,
    explain_variants,
)

_Z_95 = 1.959963984540054
"""The standard normal distribution's 97.5 % quantile."""


@dataclass(frozen=True, slots=True)
class Count:
    """So many of so many variants."""

    count: int
    total: int

    @property
    def share(self) -> float:
        """The part, from 0 to 1; 0 of none."""
        return self.count / self.total if self.total else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Where the share of all possible draws lies at 95 % when these are random (Wilson's score interval)."""
        if not self.total:
            return 0.0, 1.0
        weight = _Z_95**2 / self.total
        middle = (self.share + weight / 2) / (1 + weight)
        half = math.sqrt(weight * (self.share * (1 - self.share) + weight / 4)) / (1 + weight)
        return max(0.0, middle - half), min(1.0, middle + half)


@dataclass(frozen=True, slots=True)
class Level:
    """One value of a factor, or all random draws of one, and the variants in which the factor has that value."""

    factor: Factor
    name: str
    variants: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """What a factor does to one step.

    Attributes:
        factor: Which, or None for all at once.
        differing: In how many variants the step is not what it is in the explanation: those of this factor, or all.
        values: The factor's values in those variants; none are named for all factors at once.
    """

    factor: Factor | None
    differing: Count
    values: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StepStability:
    """How often one step is a subgoal.

    Attributes:
        step: From 1.
        state: The state's label.
        action: The action's name.
        is_subgoal: In the explanation itself.
        overall: Of all variants.
        by_level: For each of the levels.
        changes: By each factor that varies, and at last by all at once.
        flips: Those of the changes that make the step flip; none where it holds, as a subgoal or as none.
    """

    step: int
    state: Hashable
    action: str
    is_subgoal: bool
    overall: Count
    by_level: tuple[Count, ...]
    changes: tuple[Change, ...]
    flips: tuple[Change, ...]


@dataclass(frozen=True, slots=True)
class Stability:
    """How often each step of a path is a subgoal.

    Attributes:
        settings: What was explained and tried; its `k` is the one that was used.
        variants: All combinations, the explanation itself first.
        levels: Of the factors that have more than one value, in the order of `FACTORS`.
        steps: `[T]`.
        elsewhere: How often what is not on the path is a subgoal, the most frequent first.
    """

    settings: StabilitySettings
    variants: tuple[Variant, ...]
    levels: tuple[Level, ...]
    steps: tuple[StepStability, ...]
    elsewhere: tuple[tuple[tuple[Hashable, str], Count], ...]

    @property
    def subgoals(self) -> tuple[int, ...]:
        """The explanation's, ascending."""
        return self.variants[0].subgoals

    @property
    def flipping(self) -> tuple[StepStability, ...]:
        """The steps that flip, in the order of the path."""
        return tuple(step for step in self.steps if step.flips)


def stability(
    world: World,
    policy: AnyPolicy,
    path: Trajectory,
    settings: StabilitySettings,
    *,
    optimal_actions: NDArray[np.bool_] | None = None,
    agents: Sequence[OtherAgent] = (),
) -> Stability:
    r"""Explain a path under all combinations and count how often each step is a subgoal.

    A step flips by a factor if it is not what it is in the explanation in more than the tolerated share of the variants
    in which this factor alone has another value; by several, if none does it alone but so many of all others differ.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: The policy's way to a goal, which is explained.
        settings: What is explained, and what is tried beside it.
        optimal_actions: `[S, A]`, for breaking ties; left out, those on shortest paths, in a stochastic world none.
        agents: Of other trainings.

    Raises:
        ValueError: The path has no steps or is not the policy's way to a goal, or an optimal action or agent is unfit.
        NeverArrives: An agent does not reach the goal; the message names it.
        NotSolved: A linear system's answer cannot be trusted.

    Example:
        >>> from webapp.explainer import StabilitySettings, assess_stability, follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> found = assess_stability(world, p := plan_world(world), follow(world, p), StabilitySettings(random_steps=2))
        >>> [step.step for step in found.flipping]
        [1, 4]
    """
    variants, k = explain_variants(world, policy, path, settings, optimal_actions, agents)
    levels = _levels(variants)
    alone = {factor: rows for factor in FACTORS if (rows := _alone(variants, factor))}
    steps = []
    for step, (state, action) in enumerate(path.pairs, start=1):
        member = np.array([step in variant.subgoals for variant in variants])
        changes = _changes(member, variants, alone)
        steps.append(
            StepStability(
                step=step,
                state=world.states[state],
                action=world.actions[action],
                is_subgoal=bool(member[0]),
                overall=_count(member),
                by_level=tuple(_count(member[list(level.variants)]) for level in levels),
                changes=changes,
                flips=_flips(changes, settings.tolerance),
            )
        )
    elsewhere = Counter(pair for variant in variants for pair in variant.elsewhere)
    counts = tuple((pair, Count(count, len(variants))) for pair, count in elsewhere.most_common())
    return Stability(replace(settings, k=k), variants, levels, tuple(steps), counts)


def as_json(found: Stability) -> Mapping[str, object]:
    """Return a stability as the object that other programs read, made of lists, numbers and text only."""

    def pair(state: Hashable, action: str) -> Mapping[str, object]:
        return {"state": _plain(state), "action": action}

    def changed(change: Change) -> Mapping[str, object]:
        return {
            "factor": change.factor or "several",
            "count": change.differing.count,
            "of": change.differing.total,
            "interval": list(change.differing.interval) if change.factor == "ties" else None,
            "values": list(change.values),
        }

    return {
        "settings": asdict(found.settings),
        "subgoals": list(found.subgoals),
        "num_variants": len(found.variants),
        "levels": [
            {"factor": level.factor, "name": level.name, "num_variants": len(level.variants)} for level in found.levels
        ],
        "steps": [
            {
                "step": step.step,
                **pair(step.state, step.action),
                "is_subgoal": step.is_subgoal,
                "count": step.overall.count,
                "share": step.overall.share,
                "count_by_level": [count.count for count in step.by_level],
                "changes": [changed(change) for change in step.changes],
                "flips_by": [change.factor or "several" for change in step.flips],
            }
            for step in found.steps
        ],
        "elsewhere": [{**pair(*where), "count": count.count} for where, count in found.elsewhere],
        "variants": [
            {
                "importance": variant.importance,
                "random_steps": variant.random_steps,
                "threshold": variant.rule,
                "origin": variant.origin,
                "policy": variant.policy,
                "subgoals": list(variant.subgoals),
                "elsewhere": [pair(*where) for where in variant.elsewhere],
            }
            for variant in found.variants
        ],
    }


def _levels(variants: Sequence[Variant]) -> tuple[Level, ...]:
    """Group the variants by each factor's values, the random draws of one all together."""
    levels = []
    for factor in FACTORS:
        rows: dict[str, list[int]] = {}
        for row, variant in enumerate(variants):
            if value := variant.value(factor):
                rows.setdefault("drawn" if factor == "ties" else value, []).append(row)
        if len(rows) > 1 or len(next(iter(rows.values()), variants)) < len(variants):
            names = sorted(rows, key=int) if factor == "random actions" else list(rows)
            levels += [Level(factor, name, tuple(rows[name])) for name in names]
    return tuple(levels)


def _alone(variants: Sequence[Variant], factor: Factor) -> list[int]:
    """List the variants that differ from the explanation in this factor alone.

    An importance that has no r is compared with one that has any.
    """

    def same(variant: Variant, other: Factor) -> bool:
        value, explained = variant.value(other), variants[0].value(other)
        return value == explained or (other == "random actions" and not (value and explained))

    others = [other for other in FACTORS if other != factor]
    return [
        row
        for row, variant in enumerate(variants)
        if not same(variant, factor) and all(same(variant, other) for other in others)
    ]


def _changes(
    member: NDArray[np.bool_], variants: Sequence[Variant], alone: Mapping[Factor, list[int]]
) -> tuple[Change, ...]:
    differs = member != member[0]
    changes = []
    for factor, rows in alone.items():
        values = dict.fromkeys(variants[row].value(factor) for row in rows if differs[row])
        changes.append(Change(factor, _count(differs[rows]), tuple(values)))
    return (*changes, Change(None, _count(differs[1:]), ()))


def _flips(changes: Sequence[Change], tolerance: float) -> tuple[Change, ...]:
    """Name the factors that make a step flip alone, or else all at once if they do."""
    found = [change for change in changes if change.differing.share > tolerance]
    return tuple(change for change in found if change.factor is not None) or tuple(found)


def _count(member: NDArray[np.bool_]) -> Count:
    return Count(int(member.sum()), len(member))


def _plain(label: Hashable) -> object:
    """Write a state's label as its components where it has some, and in words where JSON knows no such thing."""
    if isinstance(label, tuple):
        return [_plain(part) for part in label]
    if isinstance(label, np.generic):
        return label.item()
    return label if isinstance(label, (bool, int, float, str)) or label is None else str(label)
