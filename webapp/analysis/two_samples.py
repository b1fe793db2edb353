"""Whether the runs of two groups differ in how many episodes they need, and how often one of a beats one of b.

All tests are two-sided. Where the runs do not determine an answer, `Undefined` says why: no p value is ever nan. What a
test does with the runs that were stopped stands in its docstring.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from webapp.analysis.censoring import Sample, Undefined, check_one_budget
from webapp.analysis.location import Interval, Resampled, check_scatter

_LARGEST_EXACT = 8
"""Up to this size of the smaller sample the null distribution of U is counted out, as `method="auto"` of SciPy does."""


@dataclass(frozen=True, slots=True)
class TestResult:
    """What a test found.

    Attributes:
        name: Of the test.
        statistic: Finite; its sign or side is explained by the test.
        p_value: Two-sided, in [0, 1].
        degrees_of_freedom: Above 0; None for a test that has none.
        note: What a reader must know beside the numbers, as a phrase; empty if there is nothing.

    Raises:
        ValueError: A number is out of its range.
    """

    name: str
    statistic: float
    p_value: float
    degrees_of_freedom: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        if not math.isfinite(self.statistic):
            raise ValueError(f"the statistic of {self.name} must be finite, not {self.statistic}")
        if not 0 <= self.p_value <= 1:
            raise ValueError(f"the p value of {self.name} must lie from 0 to 1, not at {self.p_value}")
        if self.degrees_of_freedom is not None and not self.degrees_of_freedom > 0:
            raise ValueError(f"the degrees of freedom of {self.name} must be above 0, not {self.degrees_of_freedom}")


def student_t(a: Sample, b: Sample) -> TestResult:
    """Compare two means by the unpaired t test with equal variances, which is the one that the paper names.

    Stopped runs enter at the budget, as if they had got there, which makes their group's mean and usually its scatter
    too small. The note says how many they are.

    Args:
        a: Two runs or more.
        b: Two runs or more, under the same budget.

    Returns:
        The statistic is negative if the mean of `a` is the smaller one.

    Raises:
        Undefined: A sample has one run, or neither sample varies.
        ValueError: The runs were not under one budget.

    Example:
        >>> found = student_t(Sample.of([1, 2, 3]), Sample.of([3, 4, 5]))
        >>> round(found.statistic, 3), found.degrees_of_freedom, round(found.p_value, 3)
        (-2.449, 4.0, 0.07)
    """
    name = "Student's t test"
    var_a, var_b = _variances(name, a, b)
    freedom = a.size + b.size - 2
    pooled = ((a.size - 1) * var_a + (b.size - 1) * var_b) / freedom
    return _t_result(name, a, b, pooled * (1 / a.size + 1 / b.size), float(freedom))


def welch_t(a: Sample, b: Sample) -> TestResult:
    """Compare two means by the unpaired t test that allows different variances (Welch 1947).

    Stopped runs enter at the budget, as in `student_t`.

    Args:
        a: Two runs or more.
        b: Two runs or more, under the same budget.

    Returns:
        The statistic is negative if the mean of `a` is the smaller one; the degrees of freedom are Satterthwaite's.

    Raises:
        Undefined: A sample has one run, or neither sample varies.
        ValueError: The runs were not under one budget.

    Example:
        >>> found = welch_t(Sample.of([1, 2, 3]), Sample.of([4, 8, 12]))
        >>> round(found.statistic, 3), round(found.degrees_of_freedom or 0, 3), round(found.p_value, 3)
        (-2.521, 2.249, 0.114)
    """
    name = "Welch's t test"
    var_a, var_b = _variances(name, a, b)
    part_a, part_b = var_a / a.size, var_b / b.size
    whole = part_a + part_b
    freedom = 1 / ((part_a / whole) ** 2 / (a.size - 1) + (part_b / whole) ** 2 / (b.size - 1))
    return _t_result(name, a, b, whole, freedom)


def mann_whitney(a: Sample, b: Sample) -> TestResult:
    """Compare two samples by the ranks of their runs (Mann and Whitney 1947).

    Stopped runs share the highest rank, above every observed value, even one that equals the budget. With one budget
    this is their true place, so nothing about them is assumed.

    Without ties, and with no more than 8 runs in the smaller sample, the p value is exact. Otherwise it comes from the
    normal distribution, with corrections for ties and for continuity; below some 8 runs in each sample that is coarse.
    These are SciPy's own rules. If all runs tie, p is 1: no way to deal out the ranks is more extreme than another.

    Args:
        a: One run or more.
        b: One run or more, under the same budget.

    Returns:
        The statistic is U of `a`: in how many of the pairs the run of `a` needs more episodes, ties counted half.

    Raises:
        ValueError: The runs were not under one budget.

    Example:
        >>> found = mann_whitney(Sample.of([1, 2, 3]), Sample.of([4, 5, 6]))
        >>> found.statistic, found.p_value, found.note
        (0.0, 0.1, 'exact')
    """
    check_one_budget(a, b)
    both = np.concatenate([a.ranked, b.ranked])
    tied = np.unique(both).size < both.size
    exact = not tied and min(a.size, b.size) <= _LARGEST_EXACT
    found = stats.mannwhitneyu(a.ranked, b.ranked, method="exact" if exact else "asymptotic")
    note = "exact" if exact else "normal approximation, corrected for ties" if tied else "normal approximation"
    return TestResult("Mann-Whitney U test", float(found.statistic), float(found.pvalue), note=note)


def log_rank(a: Sample, b: Sample) -> TestResult:
    """Compare two samples by how many got there at each time, of those that had not yet (Mantel 1966).

    Stopped runs count among those that had not yet, up to where they were stopped. The budgets may differ. The p value
    is from the normal distribution, which is coarse for a handful of runs.

    Args:
        a: One run or more.
        b: One run or more.

    Returns:
        The statistic is standard normal, and negative if fewer runs of `a` got there than expected: if `a` is slower.

    Raises:
        Undefined: At no time had both groups runs to go of which some, but not all, arrived.

    Example:
        >>> found = log_rank(Sample.of([1, 3, 5], [True, True, False]), Sample.of([2, 5, 5], [True, False, False]))
        >>> round(found.statistic, 4), round(found.p_value, 4)
        (0.6975, 0.4855)
    """
    # A variance of 0 is divided by, and the quotient tells of it.
    with np.errstate(divide="ignore", invalid="ignore"):
        found = stats.logrank(_censored(a), _censored(b))
    if not np.isfinite(found.statistic):
        raise Undefined(
            "the log rank test needs a time at which runs of both groups are on and some of all these, not all, arrive"
        )
    return TestResult("log rank test", float(found.statistic), float(found.pvalue))


def probability_of_improvement(
    a: Sample, b: Sample, rng: np.random.Generator, confidence: float = 0.95, num_resamples: int = 10_000
) -> Interval:
    """Estimate how likely a run of `a` needs fewer episodes than one of `b`: P(A < B) + P(A = B) / 2.

    Stopped runs lie above all observed ones and tie with each other, so the number speaks of what happens within the
    budget and nothing in it is unknown: no flag is set. It is `1 - U / (N_a N_b)` with the U of `mann_whitney`, and
    Agarwal et al. 2021 (section 4.3) report it under this name. Each group is resampled by itself.

    Args:
        a: Two runs or more.
        b: Two runs or more, under the same budget.
        rng: Draws the resamples; the order of the runs does not matter.
        confidence: Above 0 and below 1.
        num_resamples: At least `2 / (1 - confidence)`.

    Raises:
        Undefined: A sample has only one run.
        ValueError: The runs were not under one budget, the confidence is out of range, or there are too few resamples.

    Example:
        >>> found = probability_of_improvement(Sample.of([1, 2]), Sample.of([2, 3]), np.random.default_rng(0))
        >>> found.value, found.low, found.high
        (0.875, 0.5, 1.0)
    """
    check_one_budget(a, b)
    check_scatter(a)
    check_scatter(b)
    ours, theirs = a.ranked[:, None], b.ranked[None, :]
    wins = (ours < theirs) + (ours == theirs) / 2
    drawn_a, drawn_b = (_num_draws(sample.size, rng, num_resamples) for sample in (a, b))
    shares = ((drawn_a @ wins) * drawn_b).sum(axis=1) / (a.size * b.size)
    known = np.zeros(shares.shape, dtype=np.bool_)
    return Resampled(shares, may_be_larger=known, may_be_smaller=known).interval(confidence)


def _variances(name: str, a: Sample, b: Sample) -> tuple[float, float]:
    """Return both variances after seeing to it that a t test is defined."""
    check_one_budget(a, b)
    check_scatter(a)
    check_scatter(b)
    var_a, var_b = _variance(a), _variance(b)
    if var_a == 0 and var_b == 0:
        raise Undefined(f"{name} needs values that vary, not only {a.values[0]} in one and {b.values[0]} in the other")
    return var_a, var_b


def _variance(sample: Sample) -> float:
    """Return the unbiased variance: exactly 0 for equal values, even where rounding moves their mean."""
    return float(sample.values.var(ddof=1)) if np.ptp(sample.values) else 0.0


def _t_result(name: str, a: Sample, b: Sample, squared_error: float, freedom: float) -> TestResult:
    """Divide the difference of the means by its standard error and look up how rare that is."""
    statistic = float(a.values.mean() - b.values.mean()) / math.sqrt(squared_error)
    p_value = min(1.0, 2 * float(stats.t.sf(abs(statistic), freedom)))
    counts = f"{a.num_censored} of {a.size} and {b.num_censored} of {b.size} runs"
    note = f"{counts} were stopped and enter at the budget" if a.num_censored or b.num_censored else ""
    return TestResult(name, statistic, p_value, freedom, note)


def _censored(sample: Sample) -> stats.CensoredData:
    return stats.CensoredData(uncensored=sample.values[sample.observed], right=sample.values[~sample.observed])


def _num_draws(size: int, rng: np.random.Generator, num_resamples: int) -> NDArray[np.float64]:
    """`[B + 1, N]`: how often each run is drawn, in the first row once, which is the sample itself."""
    drawn = rng.multinomial(size, np.full(size, 1 / size), size=num_resamples)
    return np.vstack([np.ones(size), drawn])
