"""How large a mean difference within persons is, in standard deviations, with 95 % intervals."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

Floats = NDArray[np.float64]

_TAILS = (0.025, 0.975)
_ROUNDING = 1e-9


def d_z(t: float, num_people: int) -> tuple[float, float, float]:
    """Return the mean over the standard deviation of the differences, and its interval.

    Args:
        t: Student's, of the differences.
        num_people: At least 2.
    """
    low, high = _noncentrality_interval(t, num_people - 1)
    root = math.sqrt(num_people)
    return t / root, low / root, high / root


def d_av(one: Floats, other: Floats) -> tuple[float, float, float] | None:
    """Return the mean difference over the root of the mean of both variances, and its interval (Bonett 2008).

    Args:
        one: `[N]`, one per person.
        other: `[N]` of the same people.

    Returns:
        None where neither varies between persons.
    """
    v1, v2, df = float(one.var(ddof=1)), float(other.var(ddof=1)), one.size - 1
    mean_variance = (v1 + v2) / 2
    if mean_variance < _ROUNDING:
        return None
    covariance = float(np.cov(one, other)[0, 1])
    d = float((one - other).mean()) / math.sqrt(mean_variance)
    of_spread = d * d * (v1 * v1 + v2 * v2 + 2 * covariance**2) / (8 * mean_variance**2 * df)
    of_mean = (v1 + v2 - 2 * covariance) / (mean_variance * df)
    half = float(stats.norm.ppf(_TAILS[1])) * math.sqrt(of_spread + of_mean)
    return d, d - half, d + half


def _noncentrality_interval(t: float, df: int) -> tuple[float, float]:
    """Return the noncentralities under which `t` is the upper and the lower tail (Steiger and Fouladi 1997)."""
    reach = abs(t) + 12 + abs(t) * 12 / math.sqrt(df)

    def end(share: float) -> float:
        return float(optimize.brentq(lambda nc: _below(t, df, nc) - share, t - reach, t + reach, xtol=1e-10))

    return end(_TAILS[1]), end(_TAILS[0])


def _below(t: float, df: int, noncentrality: float) -> float:
    """Return P(T <= t); where SciPy's series gives up, far in a tail, what its sign leaves."""
    found = float(stats.nct.cdf(t, df, noncentrality))
    return found if math.isfinite(found) else float(noncentrality < t)
