"""From a number per step to the k steps that are shown."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Ready:
    """A selector that has studied a path and chooses from it for any budget.

    Attributes:
        choose: Takes k, from 0 to T, and returns k different steps from 1 to T, ascending.
        reason: Takes a step and says in a few words what the selector knows of it; None where it knows nothing.
        own: The steps that the method would choose if it had no budget; empty where it only ever ranks.
        note: What must be said beside the result, such as that a number is an estimate; empty if nothing.
        fills_up: Whether the method names steps by itself, so that every other step is there to fill the budget.
        distance: Takes k and returns how far apart the steps are kept; None where no distance is asked of them.
    """

    choose: Callable[[int], tuple[int, ...]]
    reason: Callable[[int], str] | None = None
    own: tuple[int, ...] = ()
    note: str = ""
    fills_up: bool = False
    distance: Callable[[int], int] | None = None


def most_important_steps(
    values: Sequence[float] | NDArray[np.float64], preferred: Collection[int], count: int
) -> tuple[int, ...]:
    """Cut or extend a method's own choice to a budget.

    The method's own steps come first, the most important ahead; then all others, the most important ahead. Equal
    importance: the earlier step. With the paper's subgoals as `preferred` this is how they meet a budget that is not
    their number (Sakai et al. 2021 leave it open).

    Args:
        values: `[T]`: the importance of the state of each step, the target's left out.
        preferred: The steps, from 1, that the method chooses by itself.
        count: How many steps, from 0 to T.

    Raises:
        ValueError: There are not so many steps, one that is preferred does not exist, or a value is no finite number.
    """
    num_steps = len(values)
    check_count(num_steps, count)
    check_finite(values)
    for step in preferred:
        if not 1 <= step <= num_steps:
            raise ValueError(f"there is no step {step}; the path has steps 1 to {num_steps}")
    order = sorted(range(1, num_steps + 1), key=lambda step: (step not in preferred, -values[step - 1], step))
    return tuple(sorted(order[:count]))


def check_count(num_steps: int, count: int) -> None:
    """Refuse a budget that the path cannot fill.

    Raises:
        ValueError: The budget is not from 0 to T.
    """
    if not 0 <= count <= num_steps:
        raise ValueError(f"{count} different steps cannot be chosen from a path of {num_steps}")


def check_finite(values: Sequence[float] | NDArray[np.float64]) -> None:
    """Refuse numbers that have no order.

    Args:
        values: `[T]`, one per step.

    Raises:
        ValueError: One is not finite; the message names the first such step.
    """
    for step, value in enumerate(values, start=1):
        if not math.isfinite(value):
            raise ValueError(f"the importance of step {step} must be a finite number, not {value}")
