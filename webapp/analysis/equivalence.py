"""Whether two groups need practically the same number of episodes; to find no difference does not show it."""

import math

import numpy as np

from webapp.analysis.censoring import Sample, check_one_budget
from webapp.analysis.location import Interval, Resampled, resampled_iqms


def ratio_interval(
    a: Sample, b: Sample, rng: np.random.Generator, confidence: float = 0.90, num_resamples: int = 10_000
) -> Interval:
    """Estimate how many times as many episodes `a` needs as `b`: the ratio of the interquartile means.

    Each group is resampled by itself. Where stopped runs reach into the middle half of `a`, the ratio might be larger
    than it appears; where they reach into that of `b`, smaller; where into both, it might be anything. The flags say
    this of the value and of each end.

    Args:
        a: Two runs or more.
        b: Two runs or more, under the same budget.
        rng: Draws the resamples; the order of the runs does not matter.
        confidence: Above 0 and below 1. 0.9 makes `is_equivalent` a test at the level 0.05.
        num_resamples: At least `2 / (1 - confidence)`.

    Raises:
        Undefined: A sample has only one run.
        ValueError: The runs were not under one budget, the confidence is out of range, or there are too few resamples.

    Example:
        >>> found = ratio_interval(Sample.of([30, 30]), Sample.of([20, 20]), np.random.default_rng(0))
        >>> found.value, found.low, found.high
        (1.5, 1.5, 1.5)
    """
    check_one_budget(a, b)
    above, below = resampled_iqms(a, rng, num_resamples), resampled_iqms(b, rng, num_resamples)
    ratios = above.values / below.values
    return Resampled(ratios, may_be_larger=above.may_be_larger, may_be_smaller=below.may_be_larger).interval(confidence)


def is_equivalent(interval: Interval, margin: float) -> bool:
    """Decide whether a ratio is shown to be 1 but for a margin, in either direction.

    The whole interval must lie within `[1 / (1 + margin), 1 + margin]`. For an interval at confidence 1 - 2 alpha these
    are two one-sided tests at the level alpha (Schuirmann 1987). Never is a ratio equivalent that stopped runs leave
    unknown, in its value or at an end. False does not mean that the groups differ.

    Args:
        interval: Of a ratio.
        margin: Above 0; 0.1 allows a tenth more, or the inverse.

    Raises:
        ValueError: The margin is not above 0 and finite.

    Example:
        >>> is_equivalent(Interval(1.02, 0.95, 1.08), margin=0.1), is_equivalent(Interval(1.02, 0.9, 1.08), margin=0.1)
        (True, False)
    """
    if not 0 < margin < math.inf:
        raise ValueError(f"a margin must be above 0 and finite, not {margin}")
    return interval.is_identified and 1 / (1 + margin) <= interval.low and interval.high <= 1 + margin
