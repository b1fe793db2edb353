"""Conditions of a learning experiment: which state-action pairs pay a sub-reward, and how often."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal, get_args

from webapp.explainer.mdp import StateAction

Variant = Literal["repeatable", "once", "none"]
"""Whether a pair pays whenever it is executed, only the first time in an episode, or nothing pays."""
VARIANTS: tuple[Variant, ...] = get_args(Variant)


@dataclass(frozen=True, slots=True)
class Condition:
    """What the agents of one group are told.

    Attributes:
        name: Names the group within its variant; part of every run's id.
        kind: What kind of choice it is, such as `derived` or `rival`.
        pairs: The state-action pairs that pay.
        steps: The same as steps of the path; empty where they are none.
        variant: How often they pay.
        keeps_optimum: Whether a shortest path is still optimal with these rewards, exactly.

    Raises:
        ValueError: The variant is unknown, or pairs and variant do not go together.
    """

    name: str
    kind: str
    pairs: tuple[StateAction, ...]
    steps: tuple[int, ...]
    variant: Variant
    keeps_optimum: bool

    def __post_init__(self) -> None:
        if self.variant not in VARIANTS:
            raise ValueError(f"{self.variant!r} is no variant; use {', '.join(VARIANTS)}")
        if (self.variant == "none") != (not self.pairs):
            raise ValueError(f"condition {self.name!r} has {len(self.pairs)} pairs and the variant {self.variant!r}")

    @property
    def told(self) -> str:
        """The steps as text, such as `7 16`; `off the path` or `nothing` where there are none."""
        return " ".join(map(str, self.steps)) if self.steps else "off the path" if self.pairs else "nothing"


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """One agent that shall learn.

    Attributes:
        condition: Its group.
        number: Which of the group it is, from 0.
    """

    condition: Condition
    number: int

    @property
    def run_id(self) -> str:
        """The same in every sweep; it names the agent's random streams, too."""
        return f"{self.condition.variant}/{self.condition.name.replace(' ', '-')}/{self.number:03d}"


def planned_runs(conditions: Iterable[Condition], num_runs: int) -> tuple[PlannedRun, ...]:
    """List the runs of all conditions, group by group."""
    return tuple(PlannedRun(condition, number) for condition, number in product(conditions, range(num_runs)))


def units(runs: Sequence[PlannedRun], size: int) -> Iterator[Sequence[PlannedRun]]:
    """Cut runs into units of work of one size; the last may be smaller.

    The cut depends on nothing but the list, so that every scheduler and every resumed sweep has the same units.
    """
    for start in range(0, len(runs), size):
        yield runs[start : start + size]
