"""Subgoals: where importance falls through its mean (Sakai et al. 2021, section 4.2.2 and equation 3)."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def importance_threshold(values: Sequence[float] | NDArray[np.float64]) -> float:
    """Return the mean importance of all path states, the target's 0 included.

    Args:
        values: `[T + 1]`.

    Raises:
        ValueError: There are no values, or one of them is not a finite number.
    """
    numbers = [float(value) for value in values]
    if not numbers:
        raise ValueError("a path has at least one state, and there is no importance at all")
    for step, number in enumerate(numbers, start=1):
        if not math.isfinite(number):
            raise ValueError(f"the importance of step {step} must be a finite number, not {number}")
    return math.fsum(numbers) / len(numbers)


def subgoal_steps(values: Sequence[float] | NDArray[np.float64]) -> tuple[int, ...]:
    """Return the steps whose importance lies above the threshold while that of the next state lies below it.

    Two adjacent steps can never both qualify.

    Args:
        values: `[T + 1]` importances of the path's states, the target's 0 last.

    Returns:
        Steps from 1 to T, ascending.

    Raises:
        ValueError: There are no values, or one of them is not a finite number.
    """
    threshold = importance_threshold(values)
    return tuple(step for step, (here, after) in enumerate(pairwise(values), start=1) if here > threshold > after)
