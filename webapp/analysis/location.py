"""Where a sample lies: its interquartile mean with a bootstrap interval, and what stopped runs leave unknown of these.

A stopped run enters at its budget, which is too small. Wherever a number might have been another one had all runs gone
on, a flag says so.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from webapp.analysis.censoring import Sample, Undefined, check_one_budget

_FEWEST_RUNS = 2
"""One run says nothing about how far runs scatter."""


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate and its confidence interval, with what the budget hides.

    Attributes:
        value: The estimate. A percentile interval need not contain it.
        low: The lower end.
        high: The upper end, `low` or more.
        is_lower_bound: Without a budget the value might be larger.
        high_is_lower_bound: Without a budget the upper end might be larger.
        is_upper_bound: Without a budget the value might be smaller. If it might be larger too, nothing is known of it.
        low_is_upper_bound: Without a budget the lower end might be smaller.
        low_is_lower_bound: Without a budget the lower end might be larger; the interval is then wider than need be.
        high_is_upper_bound: Without a budget the upper end might be smaller; the same.

    Raises:
        ValueError: A number is not finite, or the ends are in the wrong order.
    """

    value: float
    low: float
    high: float
    is_lower_bound: bool = False
    high_is_lower_bound: bool = False
    is_upper_bound: bool = False
    low_is_upper_bound: bool = False
    low_is_lower_bound: bool = False
    high_is_upper_bound: bool = False

    def __post_init__(self) -> None:
        if not all(math.isfinite(number) for number in (self.value, self.low, self.high)):
            raise ValueError(f"an interval needs finite numbers, not {self.value} in [{self.low}, {self.high}]")
        if self.low > self.high:
            raise ValueError(f"an interval's lower end must not exceed its upper end, and here is {self}")

    @property
    def is_identified(self) -> bool:
        """Whether without a budget value and interval would be the same, or the interval narrower."""
        return not (self.is_lower_bound or self.high_is_lower_bound or self.is_upper_bound or self.low_is_upper_bound)


@dataclass(frozen=True, slots=True, eq=False)
class Resampled:
    """A statistic of the data and of B bootstrap resamples.

    Attributes:
        values: `[B + 1]`; the first is that of the data themselves.
        may_be_larger: `[B + 1]`, True where stopped runs make the value too small by an unknown amount.
        may_be_smaller: `[B + 1]`, True where they make it too large.
    """

    values: NDArray[np.float64]
    may_be_larger: NDArray[np.bool_]
    may_be_smaller: NDArray[np.bool_]

    def interval(self, confidence: float) -> Interval:
        """Take the interval between two percentiles of the resamples (Efron and Tibshirani 1993, chapter 13).

        An end is flagged if it would move were each value that may be larger infinitely large, or each that may be
        smaller infinitely small.

        Args:
            confidence: Above 0 and below 1.

        Raises:
            ValueError: The confidence is out of range, or there are too few resamples for it.
        """
        cut = _cut(confidence, self.values.size - 1)
        resamples = self.values[1:]
        low, high = np.sort(resamples)[[cut, -1 - cut]]
        lowest, smaller = np.sort(np.where(self.may_be_smaller[1:], -np.inf, resamples))[[cut, -1 - cut]]
        larger, highest = np.sort(np.where(self.may_be_larger[1:], np.inf, resamples))[[cut, -1 - cut]]
        return Interval(
            value=float(self.values[0]),
            low=float(low),
            high=float(high),
            is_lower_bound=bool(self.may_be_larger[0]),
            high_is_lower_bound=bool(highest > high),
            is_upper_bound=bool(self.may_be_smaller[0]),
            low_is_upper_bound=bool(lowest < low),
            low_is_lower_bound=bool(larger > low),
            high_is_upper_bound=bool(smaller < high),
        )


def interquartile_mean(values: ArrayLike) -> float:
    """Return the mean of what is left when a quarter of the values is dropped at each end.

    The quarter is rounded down to whole values, as `scipy.stats.trim_mean(values, 0.25)` does and with it Agarwal et
    al. 2021 (section 4.3). Of up to three values none is dropped.

    Args:
        values: `[N]`, finite, in any order.

    Raises:
        ValueError: There are no values, or one is not finite.

    Example:
        >>> interquartile_mean([1, 2, 4, 100])
        3.0
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if ordered.ndim != 1 or not ordered.size:
        raise ValueError(f"an interquartile mean needs one row of one value or more, not of shape {ordered.shape}")
    if not np.isfinite(ordered).all():
        raise ValueError(f"an interquartile mean needs finite values, not {ordered[~np.isfinite(ordered)][0]}")
    return float(ordered[_middle(ordered.size)].mean())


def iqm_interval(
    sample: Sample, rng: np.random.Generator, confidence: float = 0.95, num_resamples: int = 10_000
) -> Interval:
    """Estimate the interquartile mean and its interval by the percentile bootstrap.

    The value is exact as long as all stopped runs, which are the slowest, fall into the upper quarter that is dropped.
    One more and it is only a lower bound. The same holds in each resample, and the upper end is only a lower bound if
    these are so many that it would move. Below some twenty runs a percentile interval is somewhat too narrow.

    Args:
        sample: Two runs or more, all under one budget.
        rng: Draws the resamples; the order of the runs does not matter.
        confidence: Above 0 and below 1.
        num_resamples: At least `2 / (1 - confidence)`. Memory grows with its product with the number of runs.

    Raises:
        Undefined: There is only one run.
        ValueError: The runs were not under one budget, the confidence is out of range, or there are too few resamples.

    Example:
        >>> found = iqm_interval(Sample.of([4, 5, 6, 9], [True, True, True, False]), np.random.default_rng(0))
        >>> found.value, found.is_lower_bound, found.high, found.high_is_lower_bound
        (5.5, False, 9.0, True)
    """
    check_one_budget(sample)
    return resampled_iqms(sample, rng, num_resamples).interval(confidence)


def resampled_iqms(sample: Sample, rng: np.random.Generator, num_resamples: int) -> Resampled:
    """Compute the interquartile mean of a sample and of resamples of it, drawn with replacement.

    Args:
        sample: Two runs or more, all under one budget; this is not checked.
        rng: Draws the resamples.
        num_resamples: B.

    Raises:
        Undefined: There is only one run.
    """
    check_scatter(sample)
    runs = np.arange(sample.size)
    draws = np.vstack([runs, rng.integers(sample.size, size=(num_resamples, sample.size))])
    middle = np.sort(draws, axis=1)[:, _middle(sample.size)]
    ends_censored = middle[:, -1] >= sample.size - sample.num_censored
    means = np.sort(sample.values)[middle].mean(axis=1)
    return Resampled(means, may_be_larger=ends_censored, may_be_smaller=np.zeros_like(ends_censored))


def mean_of(sample: Sample) -> tuple[float, bool]:
    """Return the mean, and whether it is only a lower bound, which it is as soon as one run was stopped.

    Example:
        >>> mean_of(Sample.of([100, 200, 600], [True, True, False]))
        (300.0, True)
    """
    return float(sample.values.mean()), sample.num_censored > 0


def check_scatter(sample: Sample) -> None:
    """Refuse a sample that is too small to be resampled.

    Raises:
        Undefined: There is only one run.
    """
    if sample.size < _FEWEST_RUNS:
        raise Undefined(f"how far runs scatter needs two runs or more, not {sample.size}")


def _middle(size: int) -> slice:
    """Select what is left of ordered values without the quarter at each end."""
    return slice(size // 4, size - size // 4)


def _cut(confidence: float, num_resamples: int) -> int:
    """Return how many resamples lie outside the interval at each end."""
    if not 0 < confidence < 1:
        raise ValueError(f"the confidence must lie above 0 and below 1, not at {confidence}")
    # Rounding keeps 2 / (1 - 0.9) from asking for 21 resamples.
    needed = math.ceil(round(2 / (1 - confidence), 6))
    if num_resamples < needed:
        raise ValueError(f"confidence {confidence} needs {needed} resamples or more, not {num_resamples}")
    return int((1 - confidence) / 2 * (num_resamples - 1))
