"""Ratings of two kinds by different people: the rank-sum test, and how large the difference is.

For pairs of kinds that too few people saw both of. Means of the same person would not be independent, so whoever saw
both is left out.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.paired import NUM_RESAMPLES, ROUNDING, one_row, tails


@dataclass(frozen=True, slots=True)
class RankSum:
    """The Mann-Whitney test of two groups of different people, two-sided.

    Attributes:
        num_first: People in the first group.
        num_second: People in the second.
        u: Pairs in which the first is higher, ties counted half.
        p_value: In [0, 1].
        method: `exact` without ties and up to 8 people in the smaller group, or `normal` corrected for ties.
    """

    num_first: int
    num_second: int
    u: float
    p_value: float
    method: Literal["exact", "normal"]

    @property
    def rank_biserial(self) -> float:
        """P(first higher) - P(second higher), -1 to 1."""
        return 2 * self.u / (self.num_first * self.num_second) - 1


def rank_sum(first: ArrayLike, second: ArrayLike) -> RankSum:
    """Test whether two groups of different people gave alike.

    Args:
        first: `[A]`, one per person.
        second: `[B]` of other people.

    Raises:
        Undefined: A group has fewer than two people, or all values are equal.
    """
    one, other = one_row(first, least=2), one_row(second, least=2)
    together = np.concatenate([one, other])
    if np.ptp(together) < ROUNDING:
        raise Undefined(f"a rank test needs values that vary, and all {together.size} are {together[0]:g}")
    has_ties = np.unique(together).size < together.size
    is_exact = not has_ties and min(one.size, other.size) <= 8  # noqa: PLR2004 - as SciPy chooses
    found = stats.mannwhitneyu(one, other, use_continuity=False, method="exact" if is_exact else "asymptotic")
    return RankSum(one.size, other.size, float(found.statistic), float(found.pvalue), "exact" if is_exact else "normal")


def rank_sum_interval(
    first: ArrayLike, second: ArrayLike, rng: np.random.Generator, num_resamples: int = NUM_RESAMPLES
) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of `RankSum.rank_biserial`, each group resampled by itself.

    Raises:
        Undefined: A group has fewer than two people.
    """
    (one, num_one), (other, num_other) = (
        np.unique(one_row(group, least=2), return_counts=True) for group in (first, second)
    )
    wins = np.sign(one[:, None] - other[None, :])
    drawn = [rng.multinomial(num.sum(), num / num.sum(), size=num_resamples) for num in (num_one, num_other)]
    scores = ((drawn[0] @ wins) * drawn[1]).sum(axis=1) / (num_one.sum() * num_other.sum())
    low, high = np.quantile(scores, tails())
    return float(low), float(high)
