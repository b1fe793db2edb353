"""What follows from printed numbers alone: whether an F can have its p value, and with which degrees of freedom."""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

MOST_FREEDOM = 1000
"""Denominators are searched up to here."""


def p_of_f(statistic: float, freedoms: tuple[float, float]) -> float:
    """Return how rarely F is at least so large.

    Args:
        statistic: 0 or more.
        freedoms: Degrees of freedom of numerator and denominator.
    """
    return float(stats.f.sf(statistic, *freedoms))


def p_of_variances(first: float, second: float, sizes: tuple[int, int]) -> float:
    """Return the two-sided p value of the F test of two printed variances.

    Args:
        first: Above 0.
        second: Above 0.
        sizes: How many values each is of, 2 or more.
    """
    ratio, freedoms = first / second, (sizes[0] - 1, sizes[1] - 1)
    return min(1.0, 2 * min(float(stats.f.sf(ratio, *freedoms)), float(stats.f.cdf(ratio, *freedoms))))


def fitting_denominators(statistic: str, p_value: str, numerator: int = 1) -> tuple[int, ...]:
    """Return the denominators with which some F that rounds to the printed one has a p that rounds to the printed one.

    Args:
        statistic: As printed, such as `2.20`: its digits say how it was rounded.
        p_value: As printed, such as `.143`.
        numerator: Degrees of freedom of the numerator.

    Returns:
        Ascending, up to `MOST_FREEDOM`.

    Example:
        >>> found = fitting_denominators("2.20", ".143")
        >>> found[0], found[-1]
        (53, 77)
    """
    denominators = np.arange(1, MOST_FREEDOM + 1)
    f_half, p_half = _half_unit(statistic), _half_unit(p_value)
    least = stats.f.sf(float(statistic) + f_half, numerator, denominators)
    most = stats.f.sf(float(statistic) - f_half, numerator, denominators)
    fits = (least < float(p_value) + p_half) & (most >= float(p_value) - p_half)
    return _listed(denominators[fits])


def denominators_with_critical(value: str, alpha: float = 0.05, numerator: int = 1) -> tuple[int, ...]:
    """Return the denominators whose critical F rounds to a printed number.

    Args:
        value: As printed, such as `3.98`.
        alpha: The level of the test.
        numerator: Degrees of freedom of the numerator.

    Example:
        >>> denominators_with_critical("3.98")
        (67, 68, 69, 70, 71)
    """
    denominators = np.arange(1, MOST_FREEDOM + 1)
    critical = stats.f.isf(alpha, numerator, denominators)
    return _listed(denominators[np.abs(critical - float(value)) <= _half_unit(value)])


def _half_unit(printed: str) -> float:
    """Return half a unit of the last printed digit."""
    return 0.5 * 10.0 ** -len(printed.partition(".")[2])


def _listed(numbers: NDArray[np.int64]) -> tuple[int, ...]:
    return tuple(int(number) for number in numbers)
