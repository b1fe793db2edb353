"""Subgoals: where importance falls through a threshold (Sakai et al. 2021, section 4.2.2 and equation 3).

The paper's threshold is the mean. Two others show what the choice is worth. All three are levels, and a subgoal is
always a step whose importance lies above the level while that of the next state lies below it; so no rule can take two
adjacent steps. The k highest steps after which importance falls, say, would: on a slope of .67, .37, .12 both of the
first two.

- `mean`: the mean importance of all T + 1 states, the target's 0 included.
- `top-k`: lower the level from above all importances until importance falls through it exactly k times, and go on
  while it still does; of the gaps passed in that time, the middle of the largest.
- `largest-gap`: the middle of the largest gap between neighbours among the sorted importances.

Of gaps of one size the higher counts. Importances that differ by no more than rounding can explain have no gap between
them; where all are so alike, every step is like every other and there is no subgoal.
"""

import math
from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

ThresholdRule = Literal["mean", "top-k", "largest-gap"]
THRESHOLD_RULES: tuple[ThresholdRule, ...] = get_args(ThresholdRule)
"""The paper's own first."""

_SAME = 1e-9
"""Importances closer than this, in proportion to the largest magnitude, are equal but for rounding."""


def importance_threshold(
    values: Sequence[float] | NDArray[np.float64], rule: ThresholdRule = "mean", k: int | None = None
) -> float:
    """Return the level that importance falls through at each subgoal.

    Args:
        values: `[T + 1]`, of any range, the target's 0 included.
        rule: How the level is chosen; see the module.
        k: How many subgoals `top-k` shall find, at least 1; None for the other rules.

    Raises:
        ValueError: There are no values, one of them is not a finite number, there is no such rule, k does not belong to
            it, or importance falls through no level k times; the message names the numbers that are possible.

    Example:
        >>> from webapp.explainer import importance_threshold
        >>> importance_threshold([0.2, 0.8, 0.3, 0.7, 0.0])
        0.4
        >>> importance_threshold([0.2, 0.8, 0.3, 0.7, 0.0], "largest-gap")
        0.5
    """
    check_rule(rule, k)
    numbers = [float(value) for value in values]
    if not numbers:
        raise ValueError("a path has at least one state, and there is no importance at all")
    for step, number in enumerate(numbers, start=1):
        if not math.isfinite(number):
            raise ValueError(f"the importance of step {step} must be a finite number, not {number}")
    if rule == "mean":
        return math.fsum(numbers) / len(numbers)
    return _middle_of_largest(_gaps(numbers), max(numbers)) if k is None else _level_of_falls(numbers, k)


def subgoal_steps(
    values: Sequence[float] | NDArray[np.float64], rule: ThresholdRule = "mean", k: int | None = None
) -> tuple[int, ...]:
    """Return the steps whose importance lies above the threshold while that of the next state lies below it.

    Two adjacent steps can never both qualify.

    Args:
        values: `[T + 1]` importances of the path's states, the target's 0 last.
        rule: How the threshold is chosen; see the module.
        k: How many steps `top-k` shall return, at least 1; None for the other rules.

    Returns:
        Steps from 1 to T, ascending.

    Raises:
        ValueError: As `importance_threshold` does.

    Example:
        >>> from webapp.explainer import subgoal_steps
        >>> subgoal_steps([0.2, 0.8, 0.3, 0.7, 0.0])
        (2, 4)
        >>> subgoal_steps([0.2, 0.8, 0.3, 0.7, 0.0], "top-k", 1)
        (2,)
    """
    threshold = importance_threshold(values, rule, k)
    return tuple(step for step, (here, after) in enumerate(pairwise(values), start=1) if here > threshold > after)


def possible_counts(values: Sequence[float] | NDArray[np.float64]) -> tuple[int, ...]:
    """Return the numbers of subgoals, ascending from 1, that `top-k` can find among such importances.

    Peaks of equal height count at once, so a number may be missing; a path of which importance only rises up to the
    last step has none but 1.

    Args:
        values: `[T + 1]` finite numbers.
    """
    numbers = [float(value) for value in values]
    return tuple(sorted({count for count, _ in _falls(numbers) if count}))


def check_rule(rule: ThresholdRule, k: int | None) -> None:
    """Refuse a rule that does not exist, or a k where it has no place.

    Raises:
        ValueError: The rule is unknown, `top-k` has no k or one below 1, or another rule has one.
    """
    if rule not in THRESHOLD_RULES:
        raise ValueError(f"{rule!r} is not a threshold; use {', '.join(THRESHOLD_RULES)}")
    if rule != "top-k":
        if k is not None:
            raise ValueError(f"k = {k} belongs to the threshold top-k, and this is {rule}")
    elif k is None:
        raise ValueError("the threshold top-k needs k, the number of subgoals to find")
    elif k < 1:
        raise ValueError(f"k must be 1 or larger, not {k}")


Gap = tuple[float, float]
"""The middle of a gap between two neighbouring importances, and half its width."""


def _gaps(numbers: Sequence[float]) -> list[Gap]:
    """List the gaps from the highest to the lowest; halves first, so that no difference is too large to be a number."""
    ordered = sorted(set(numbers), reverse=True)
    rounding = _SAME * max(abs(ordered[0]), abs(ordered[-1])) / 2
    gaps = [(high / 2 + low / 2, high / 2 - low / 2) for high, low in pairwise(ordered)]
    return [gap for gap in gaps if gap[1] > rounding]


def _middle_of_largest(gaps: Sequence[Gap], otherwise: float) -> float:
    """Return the middle of the largest gap, of those of one size the highest."""
    if not gaps:
        return otherwise
    widest = max(half for _, half in gaps)
    return next(middle for middle, half in gaps if half >= widest * (1 - _SAME))


def _falls(numbers: Sequence[float]) -> list[tuple[int, Gap]]:
    """Count for each gap, from the highest to the lowest, how often importance falls through its middle.

    A fall from `high` to `low` passes the levels between them, so the count is that of the highs above the level
    without that of the lows above it.
    """
    gaps = _gaps(numbers)
    drops = np.array([(high, low) for high, low in pairwise(numbers) if high > low]).reshape(-1, 2)
    highs, lows = np.sort(drops[:, 0]), np.sort(drops[:, 1])
    levels = np.array([middle for middle, _ in gaps])
    counts = np.searchsorted(lows, levels) - np.searchsorted(highs, levels)
    return list(zip(counts.tolist(), gaps, strict=True))


def _level_of_falls(numbers: Sequence[float], k: int) -> float:
    for count, band in groupby(_falls(numbers), key=lambda each: each[0]):
        if count == k:
            return _middle_of_largest([gap for _, gap in band], math.nan)
    counts = possible_counts(numbers)
    if not counts:
        raise ValueError(f"k = {k} cannot be met: importance never falls, so there is no subgoal")
    together = counts == tuple(range(1, counts[-1] + 1)) and len(counts) > 1
    possible = f"1 to {counts[-1]}" if together else " or ".join(map(str, counts))
    raise ValueError(f"k = {k} cannot be met: importance falls through no level {k} times, only {possible}")
