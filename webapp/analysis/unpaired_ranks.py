"""Ratings of two kinds by different people: the rank-sum test, and how large the difference is.

For pairs of kinds that too few people saw both of. Means of the same person would not be independent, so whoever saw
both is left out.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.paired import ROUNDING, one_row

MOST_DIVISIONS = 10**9
"""Up to so many divisions of the people into two groups all of them are counted, which takes no time."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RankSum:
    """The Mann-Whitney test of two groups of different people, two-sided.

    Attributes:
        num_first: People in the first group.
        num_second: People in the second.
        u: Pairs in which the first is higher, ties counted half.
        p_value: In [0, 1].
        method: `exact` by counting every division of the people into two such groups given the ranks, with ties too,
            up to `MOST_DIVISIONS`; or `normal`, corrected for ties.
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
    found = stats.mannwhitneyu(one, other, use_continuity=False, method="asymptotic")
    if math.comb(together.size, one.size) > MOST_DIVISIONS:
        return RankSum(one.size, other.size, float(found.statistic), float(found.pvalue), "normal")
    p_value = _exact_p(stats.rankdata(np.round(together, 9)), one.size)
    return RankSum(one.size, other.size, float(found.statistic), p_value, "exact")


def _exact_p(ranks: Floats, num_first: int) -> float:
    """Return the chance, over all divisions, of a rank sum of the first so far from its middle.

    Args:
        ranks: Multiples of a half, those of the first group first.
        num_first: How many they are.
    """
    doubled = np.rint(2 * ranks).astype(np.int64)
    found = int(doubled[:num_first].sum())
    most = int(np.sort(doubled)[-num_first:].sum())
    ways = np.zeros((num_first + 1, most + 1))
    ways[0, 0] = 1.0
    for rank in doubled:
        ways[1:, rank:] += ways[:-1, : most + 1 - rank].copy()
    middle = num_first * (ranks.size + 1)
    is_far = np.abs(np.arange(most + 1) - middle) >= abs(found - middle)
    return float(ways[num_first, is_far].sum() / ways[num_first].sum())
