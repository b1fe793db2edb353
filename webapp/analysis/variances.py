"""Whether two variances differ: the F test that the paper's comparison suggests, and tests for ratings and for pairs.

`Undefined` says why there is no answer; no number returned here is nan or infinite.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.correlation import pearson
from webapp.analysis.location import Interval
from webapp.analysis.means import row, unbiased_variance
from webapp.analysis.two_samples import TestResult


@dataclass(frozen=True, slots=True)
class VarianceRatio:
    """The ratio of two variances, first by second, and its F test.

    Attributes:
        ratio: With its interval.
        freedoms: Degrees of freedom of the first and of the second.
        p_value: Two-sided: twice the smaller tail, as R's `var.test`.
    """

    ratio: Interval
    freedoms: tuple[int, int]
    p_value: float


def variance_interval(values: ArrayLike, confidence: float = 0.95) -> Interval:
    """Estimate a variance with the interval from the chi-square distribution, which takes the values for normal.

    Args:
        values: `[N]`.
        confidence: Above 0 and below 1.

    Raises:
        Undefined: There are fewer than 2 values, or they do not vary.
    """
    given = row(values)
    variance, freedom = _positive_variance("an interval of a variance", given), given.size - 1
    low, high = (freedom * variance / float(stats.chi2.isf(p, freedom)) for p in _tails(confidence))
    return Interval(variance, low, high)


def variance_ratio(first: ArrayLike, second: ArrayLike, confidence: float = 0.95) -> VarianceRatio:
    """Compare two variances by the F test, which takes the values for normal and independent.

    It is known to reject too often where tails are heavy and too rarely where they are light, however many values there
    are (Box 1953).

    Args:
        first: `[N]`.
        second: `[M]`.
        confidence: Of the interval.

    Raises:
        Undefined: A sample has fewer than 2 values, or does not vary.
    """
    a, b = row(first), row(second)
    name = "the F test of two variances"
    ratio = _positive_variance(name, a) / _positive_variance(name, b)
    freedoms = (a.size - 1, b.size - 1)
    low, high = (ratio / float(stats.f.isf(p, *freedoms)) for p in _tails(confidence))
    tail = min(float(stats.f.cdf(ratio, *freedoms)), float(stats.f.sf(ratio, *freedoms)))
    return VarianceRatio(Interval(ratio, low, high), freedoms, min(1.0, 2 * tail))


def brown_forsythe(*samples: ArrayLike) -> TestResult:
    """Compare variances by how far values lie from their sample's median (Brown and Forsythe 1974).

    It is Levene's test about the median, which holds its level for skewed values too.

    Args:
        samples: Two or more, `[N]` each.

    Returns:
        The statistic is F; its second degrees of freedom are given, the first are the samples less 1.

    Raises:
        Undefined: There are fewer than 2 samples, a sample has fewer than 2 values, or within each sample all values
            lie equally far from the median.
    """
    given = [row(sample) for sample in samples]
    sizes = ", ".join(str(sample.size) for sample in given)
    if len(given) < 2 or min(sample.size for sample in given) < 2:  # noqa: PLR2004 - nothing to compare.
        told = f"and there are {sizes}" if len(given) > 1 else "and there is one sample"
        raise Undefined(f"the Brown-Forsythe test needs 2 samples or more of 2 values or more, {told}")
    distances = [np.abs(sample - np.median(sample)) for sample in given]
    if all(unbiased_variance(one) == 0 for one in distances):
        raise Undefined(
            f"the Brown-Forsythe test needs values that lie differently far from their median, and in each of"
            f" {len(given)} samples ({sizes} values) all are as far"
        )
    found = stats.levene(*given, center="median")
    freedom = float(sum(sample.size for sample in given) - len(given))
    return TestResult(
        "Brown-Forsythe test",
        max(0.0, float(found.statistic)),  # Rounding may leave less than nothing of a difference that is none.
        min(1.0, float(found.pvalue)),
        freedom,
        f"F({len(given) - 1}, {freedom:g})",
    )


def pitman_morgan(first: ArrayLike, second: ArrayLike) -> TestResult:
    """Compare the variances of pairs by correlating sums with differences (Pitman 1939; Morgan 1939).

    These are uncorrelated exactly if the variances are equal. The test takes pairs for independent and for normal.

    Args:
        first: `[N]`.
        second: `[N]`, in the order of the first.

    Returns:
        The statistic is t, positive if the first varies more.

    Raises:
        Undefined: There are fewer than 4 pairs, sums or differences do not vary, or they lie on one line.
        ValueError: There are not as many of the one as of the other.
    """
    a, b = row(first), row(second)
    if a.size != b.size:
        raise ValueError(f"pairs need as many second values as first ones, not {b.size} for {a.size}")
    try:
        found = pearson(a + b, a - b)
    except Undefined as error:
        raise Undefined(f"the Pitman-Morgan test correlates sums with differences: {error}") from error
    r, freedom = found.value.value, found.degrees_of_freedom
    statistic = r * math.sqrt(freedom / (1 - r * r))
    return TestResult("Pitman-Morgan test", statistic, found.p_value, float(freedom), f"{a.size} pairs")


def _positive_variance(name: str, values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    if values.size < 2:  # noqa: PLR2004 - one value does not vary.
        raise Undefined(f"{name} needs 2 values or more, and there {'is 1' if values.size else 'are 0'}")
    variance = unbiased_variance(values)
    if variance == 0:
        raise Undefined(f"{name} needs values that vary, and all {values.size} are {values[0]:g}")
    return variance


def _tails(confidence: float) -> tuple[float, float]:
    return (1 - confidence) / 2, (1 + confidence) / 2
