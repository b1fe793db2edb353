"""Means of ratings with t intervals, and unpaired t tests of their differences, as the paper has them.

Values are plain numbers in no particular order. `Undefined` says why there is no answer; no
number returned here is nan or infinite.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.location import Interval
from webapp.analysis.two_samples import TestResult

_FEWEST_SHAPIRO, _MOST_SHAPIRO = 3, 5000
"""The sizes for which SciPy's approximation of the test's p value was made (Royston 1995)."""


@dataclass(frozen=True, slots=True)
class Described:
    """A sample in numbers.

    Attributes:
        num: How many values, 1 or more.
        mean: Their mean.
        sd: With num - 1; None for a single value.
        variance: Its square; None for a single value.
        low: The lower end of the t interval of the mean; None for a single value, and where the values do not vary, as
            an interval of no width would claim to know the mean.
        high: The upper end, likewise.
    """

    num: int
    mean: float
    sd: float | None = None
    variance: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class MeanDifference:
    """The difference of two means, first minus second, and its t test.

    Attributes:
        name: Of the test.
        difference: With its interval.
        statistic: Negative if the first mean is the smaller one.
        degrees_of_freedom: Above 0.
        p_two_sided: Against any difference.
        p_first_larger: Against the alternative that the first mean is the larger one.
        p_second_larger: Against the alternative that the second mean is the larger one.
    """

    name: str
    difference: Interval
    statistic: float
    degrees_of_freedom: float
    p_two_sided: float
    p_first_larger: float
    p_second_larger: float


def describe(values: ArrayLike, confidence: float = 0.95) -> Described:
    """Describe a sample by mean, spread and the t interval of its mean.

    Args:
        values: `[N]`.
        confidence: Above 0 and below 1.

    Raises:
        Undefined: There is no value.

    Example:
        >>> found = describe([1, 2, 3])
        >>> found.mean, found.sd, round(found.low or 0, 3)
        (2.0, 1.0, -0.484)
    """
    given = row(values)
    if given.size < 1:
        raise Undefined("a mean needs one value or more, and there is none")
    mean = float(given.mean())
    if given.size == 1:
        return Described(1, mean)
    variance = unbiased_variance(given)
    sd = math.sqrt(variance)
    if variance == 0:
        return Described(given.size, float(given[0]), 0.0, 0.0)
    half = float(stats.t.isf((1 - confidence) / 2, given.size - 1)) * sd / math.sqrt(given.size)
    return Described(given.size, mean, sd, variance, mean - half, mean + half)


def unpaired_t(first: ArrayLike, second: ArrayLike, confidence: float = 0.95) -> MeanDifference:
    """Compare two means by Student's t test, which takes the values for independent and the variances for equal.

    Args:
        first: `[N]`.
        second: `[M]`.
        confidence: Of the interval.

    Raises:
        Undefined: A sample has fewer than 2 values, or neither varies.
    """
    a, b = row(first), row(second)
    _check_sizes("Student's t test", a, b)
    freedom = a.size + b.size - 2
    pooled = ((a.size - 1) * unbiased_variance(a) + (b.size - 1) * unbiased_variance(b)) / freedom
    if pooled == 0:
        raise Undefined(f"Student's t test needs ratings that vary, and all are {a[0]:g} here and {b[0]:g} there")
    error = math.sqrt(pooled * (1 / a.size + 1 / b.size))
    return mean_difference("Student's t test, unpaired", float(a.mean() - b.mean()), error, freedom, confidence)


def shapiro_wilk(values: ArrayLike) -> TestResult:
    """Test whether values may come from a normal distribution (Shapiro and Wilk 1965).

    A single rating never does, as it is a whole number; with many ratings the test finds that out.

    Args:
        values: `[N]`.

    Raises:
        Undefined: There are fewer than 3 or more than 5000 values, or they do not vary.
    """
    given = row(values)
    if given.size < _FEWEST_SHAPIRO or given.size > _MOST_SHAPIRO:
        wish = f"from {_FEWEST_SHAPIRO} to {_MOST_SHAPIRO} values"
        raise Undefined(f"the Shapiro-Wilk test needs {wish}, and there {_are(given.size)}")
    if unbiased_variance(given) == 0:
        raise Undefined(f"the Shapiro-Wilk test needs values that vary, and all {given.size} are {given[0]:g}")
    # Sorted, so that rounding does not depend on the order in which people came.
    found = stats.shapiro(np.sort(given))
    return TestResult("Shapiro-Wilk test", float(found.statistic), min(1.0, float(found.pvalue)))


def mean_difference(name: str, difference: float, error: float, freedom: float, confidence: float) -> MeanDifference:
    """Test a difference of means that has a standard error.

    Args:
        name: Of the test.
        difference: First minus second.
        error: Its standard error, above 0.
        freedom: Degrees of freedom of the error.
        confidence: Of the interval.
    """
    statistic = difference / error
    half = float(stats.t.isf((1 - confidence) / 2, freedom)) * error
    return MeanDifference(
        name,
        Interval(difference, difference - half, difference + half),
        statistic,
        freedom,
        min(1.0, 2 * float(stats.t.sf(abs(statistic), freedom))),
        float(stats.t.sf(statistic, freedom)),
        float(stats.t.cdf(statistic, freedom)),
    )


def row(values: ArrayLike) -> NDArray[np.float64]:
    """Return `[N]` finite numbers.

    Raises:
        ValueError: They are not one row, or one is not finite.
    """
    given = np.asarray(values, dtype=np.float64)
    if given.ndim != 1:
        raise ValueError(f"values must be one row, not of shape {given.shape}")
    wrong = ~np.isfinite(given)
    if wrong.any():
        raise ValueError(f"a value must be finite, not {given[wrong][0]}")
    return given


def unbiased_variance(values: NDArray[np.float64]) -> float:
    """Return the variance of 2 values or more: exactly 0 for equal values, even where rounding moves their mean."""
    return float(values.var(ddof=1)) if np.ptp(values) else 0.0


def _check_sizes(name: str, *samples: NDArray[np.float64]) -> None:
    for sample in samples:
        if sample.size < 2:  # noqa: PLR2004 - one value does not vary.
            sizes = " and ".join(str(one.size) for one in samples)
            raise Undefined(f"{name} needs 2 values or more of each, and there are {sizes}")


def _are(count: int) -> str:
    return "is 1" if count == 1 else f"are {count}"
