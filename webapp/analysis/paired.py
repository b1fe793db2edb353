"""Differences within persons, for ratings of two kinds by the same people: rank test, t test, and how large they are.

The signed-rank test keeps zeros in the ranking and drops their ranks after that (J. W. Pratt 1959, Remarks on zeros and
ties in the Wilcoxon signed rank procedures, JASA 54, 655-667). Given the ranks, it is the distribution over all choices
of the signs: enumerated exactly up to `MOST_EXACT` people, with ties and zeros too, and beyond that its normal limit,
whose variance, the sum of squared ranks over 4, is corrected for ties and zeros by its making.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.standardized_differences import d_av, d_z

MOST_EXACT = 25
"""Up to so many people every choice of signs is counted."""

FEWEST_FOR_SHAPE = 8
"""Skewness of fewer differences says nothing."""

ENOUGH_FOR_T = 30
"""From so many people on a mean may count as normal, unless differences are skewed."""

_LEVEL = 0.95
ROUNDING = 1e-9

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Ratings of two kinds on one item, one number per person and kind: the mean where a person saw a kind repeatedly.

    Attributes:
        first: `[N]` of those who rated both, in the order of their codes.
        second: `[N]` of the same people.
        first_only: `[A]` of those who rated the first alone.
        second_only: `[B]` of those who rated the second alone.
        num_averaged: How many people rated one of the two more than once.
    """

    first: Floats
    second: Floats
    first_only: Floats
    second_only: Floats
    num_averaged: int

    @property
    def differences(self) -> Floats:
        """`[N]`: first minus second."""
        return self.first - self.second

    @property
    def is_within(self) -> bool:
        """Whether at least half of those who rated either rated both, so that the comparison is made within persons."""
        return self.first.size > 0 and self.first.size >= self.first_only.size + self.second_only.size


@dataclass(frozen=True, slots=True)
class SignedRank:
    """Wilcoxon's signed-rank test, two-sided.

    Attributes:
        num_people: N.
        num_zeros: How many differences are 0.
        plus: The sum of the ranks of positive differences.
        minus: The same of negative ones.
        z: The standardized `plus`, without continuity correction.
        p_value: In (0, 1].
        method: `exact` by enumeration given the ranks, or `normal`.
    """

    num_people: int
    num_zeros: int
    plus: float
    minus: float
    z: float
    p_value: float
    method: Literal["exact", "normal"]

    @property
    def rank_biserial(self) -> float:
        """The matched-pairs rank-biserial correlation, -1 to 1 (D. S. Kerby 2014, The simple difference formula)."""
        return (self.plus - self.minus) / (self.plus + self.minus)


@dataclass(frozen=True, slots=True)
class PairedT:
    """Student's t test of differences, two-sided, with effect sizes.

    Attributes:
        num_people: N.
        mean: Of the differences.
        low: Lower end of its 95 % t interval.
        high: Upper end.
        t: The statistic.
        df: N - 1.
        p_value: In [0, 1].
        d_z: Mean over standard deviation of the differences, with its interval by inverting the noncentral t.
        d_av: Mean over the root of the mean of both variances, with the interval of D. G. Bonett 2008, Confidence
            intervals for standardized linear contrasts of means, Psychological Methods 13, 99-109; None where neither
            kind's ratings vary between persons.
    """

    num_people: int
    mean: float
    low: float
    high: float
    t: float
    df: int
    p_value: float
    d_z: tuple[float, float, float]
    d_av: tuple[float, float, float] | None


def pairs(frame: pd.DataFrame, first: str, second: str) -> Pairs:
    """Put the ratings of two kinds side by side.

    Args:
        frame: Columns `participant`, `kind` and `rating`; other kinds are passed over.
        first: A kind.
        second: Another.
    """
    chosen = frame[frame["kind"].isin((first, second))]
    groups = chosen.groupby(["participant", "kind"], observed=True)["rating"]
    means = groups.mean().astype("float64").unstack("kind").reindex(columns=[first, second]).sort_index()
    repeated = groups.size() > 1
    num_averaged = repeated[repeated].index.get_level_values("participant").nunique()
    one, other = means[first].to_numpy(), means[second].to_numpy()
    has_one, has_other = ~np.isnan(one), ~np.isnan(other)
    both = has_one & has_other
    return Pairs(one[both], other[both], one[has_one & ~both], other[has_other & ~both], num_averaged)


def signed_rank(differences: ArrayLike) -> SignedRank:
    """Test whether differences lie symmetrically about 0.

    Args:
        differences: `[N]`, one per person, finite.

    Raises:
        Undefined: There are no differences, or all are 0.

    Example:
        >>> found = signed_rank([1, 2, 3, -4, 5, 6])
        >>> found.plus, found.minus, round(found.p_value, 5), found.method
        (17.0, 4.0, 0.21875, 'exact')
    """
    given = one_row(differences)
    # Means of several ratings may differ by rounding where they are equal.
    sizes = np.round(np.abs(given), 9)
    if not sizes.any():
        raise Undefined(f"a signed-rank test needs a difference that is not 0, and all {given.size} are 0")
    ranks = stats.rankdata(sizes)
    kept = ranks[sizes > 0]
    plus = float(ranks[(given > 0) & (sizes > 0)].sum())
    minus = float(kept.sum()) - plus
    z = (plus - minus) / 2 / math.sqrt(float(kept @ kept) / 4)
    is_exact = given.size <= MOST_EXACT
    p_value = _exact_p(kept, plus) if is_exact else 2 * float(stats.norm.sf(abs(z)))
    num_zeros = int(np.count_nonzero(sizes == 0))
    return SignedRank(given.size, num_zeros, plus, minus, z, min(1.0, p_value), "exact" if is_exact else "normal")


def paired_t(first: ArrayLike, second: ArrayLike) -> PairedT:
    """Test whether the mean difference is 0.

    Args:
        first: `[N]`, one per person.
        second: `[N]` of the same people.

    Raises:
        Undefined: There are fewer than two people, or all differences are equal.

    Example:
        >>> found = paired_t([4, 5, 3, 4], [2, 4, 3, 1])
        >>> round(found.mean, 2), round(found.t, 4), found.df, round(found.d_z[0], 4)
        (1.5, 2.3238, 3, 1.1619)
    """
    one, other = one_row(first, least=2), one_row(second, least=2)
    differences = one - other
    mean, sd, n = spread(differences)
    error = sd / math.sqrt(n)
    half = float(stats.t.ppf((1 + _LEVEL) / 2, n - 1)) * error
    t = mean / error
    p_value = 2 * float(stats.t.sf(abs(t), n - 1))
    return PairedT(n, mean, mean - half, mean + half, t, n - 1, min(1.0, p_value), d_z(t, n), d_av(one, other))


def skewness(differences: ArrayLike) -> float:
    """Return the skewness of differences, 0 if they are symmetric.

    Raises:
        Undefined: There are fewer than three, or all are equal.
    """
    given = one_row(differences, least=3)
    spread(given)
    return float(stats.skew(given))


def known_skewness(differences: ArrayLike) -> float | None:
    """Return the skewness, None where it says nothing: of fewer than `FEWEST_FOR_SHAPE`, or if all are equal."""
    given = one_row(differences, least=0)
    is_known = given.size >= FEWEST_FOR_SHAPE and np.ptp(given) >= ROUNDING
    return skewness(given) if is_known else None


def is_normal_enough(skew: float, num_people: int) -> bool:
    """Say whether a two-sided t interval of as many differences holds in spite of their skewness.

    More than 25 times the squared skewness are enough (W. G. Cochran 1977, Sampling Techniques, section 2.15), and some
    thirty for what the skewness does not tell.
    """
    return num_people >= ENOUGH_FOR_T and num_people > 25 * skew * skew


def skewness_error(num_people: int) -> float:
    """Return the standard error of the skewness of as many normal differences, at least 3."""
    n = num_people
    return math.sqrt(6 * n * (n - 1) / ((n - 2) * (n + 1) * (n + 3)))


def spread(values: ArrayLike) -> tuple[float, float, int]:
    """Return mean, standard deviation with N - 1, and N.

    Raises:
        Undefined: There are fewer than two values, or all are equal.
    """
    given = one_row(values, least=2)
    if np.ptp(given) < ROUNDING:
        raise Undefined(f"a t test needs differences that vary, and all {given.size} are {given[0]:g}")
    return float(given.mean()), float(given.std(ddof=1)), given.size


def one_row(values: ArrayLike, least: int = 1) -> Floats:
    """Return values of people as an array.

    Raises:
        Undefined: There are fewer than `least`.
        ValueError: They are no row, or not finite.
    """
    given = np.asarray(values, dtype=np.float64)
    if given.ndim != 1 or not np.isfinite(given).all():
        raise ValueError(f"there must be one row of finite numbers, not {values!r}")
    if given.size < least:
        raise Undefined(f"it takes {least} people or more, not {given.size}")
    return given


def _exact_p(ranks: Floats, plus: float) -> float:
    """Return the chance, over all signs, of a sum as far from its middle as `plus`. Ranks are multiples of a half."""
    doubled = np.rint(2 * ranks).astype(np.int64)
    ways = np.zeros(int(doubled.sum()) + 1)
    ways[0] = 1.0
    for rank in doubled:
        moved = np.zeros_like(ways)
        moved[rank:] = ways[: ways.size - rank]
        ways += moved
    distance = np.abs(2 * np.arange(ways.size) - doubled.sum())
    return float(ways[distance >= abs(4 * plus - doubled.sum()) - ROUNDING].sum() / ways.sum())
