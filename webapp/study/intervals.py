"""Confidence intervals in plain Python: the web worker holds no SciPy. Tests compare with SciPy.

Student's t by the regularized incomplete beta function, whose continued fraction is evaluated by the modified Lentz
method (W. J. Lentz 1976; Press et al., Numerical Recipes, section 6.4). Shares by the score interval of E. B. Wilson
(1927), Probable inference, the law of succession, and statistical inference, JASA 22, 209-212. Ratios of what people
give several times by linearization over people (W. G. Cochran 1977, Sampling Techniques, section 6.3).
"""

import math
from collections.abc import Iterable
from functools import lru_cache
from statistics import NormalDist

LEVEL = 0.95
"""The level of every interval on the dashboard."""

Interval = tuple[float, float]
Group = tuple[float, int, int]
"""What one person gave in sum, in how many values, and how many people gave exactly that."""

_TINY = 1e-300
_PRECISION = 1e-15
_MOST_TERMS = 10_000


def normal_quantile(probability: float) -> float:
    """Return the quantile of the standard normal distribution."""
    return NormalDist().inv_cdf(probability)


@lru_cache(maxsize=20_000)
def t_quantile(probability: float, df: int) -> float:
    """Return a quantile of Student's t distribution, to eight digits or more up to a million degrees of freedom.

    Args:
        probability: From 0 to 1, both excluded.
        df: Degrees of freedom, at least 1.

    Raises:
        ValueError: An argument is outside of its range.
    """
    if not 0 < probability < 1:
        raise ValueError(f"the probability must lie between 0 and 1, not {probability}")
    if df < 1:
        raise ValueError(f"there must be at least 1 degree of freedom, not {df}")
    if probability < 0.5:  # noqa: PLR2004 - the median
        return -t_quantile(1 - probability, df)
    if df == 1:
        return math.tan(math.pi * (probability - 0.5))
    return _newton(probability, df)


def mean_interval(mean: float, sd: float, n: int, level: float = LEVEL) -> Interval:
    """Return the t interval of a mean.

    Args:
        mean: The mean of independent values.
        sd: Their standard deviation with n - 1.
        n: How many there are, at least 2.
        level: The chance with which such intervals hold the true mean.

    Raises:
        ValueError: There are fewer than two values.
    """
    if n < 2:  # noqa: PLR2004 - one value shows no spread
        raise ValueError(f"an interval needs at least 2 values, not {n}")
    half = t_quantile((1 + level) / 2, n - 1) * sd / math.sqrt(n)
    return mean - half, mean + half


def wilson_interval(num: float, n: int, level: float = LEVEL) -> Interval:
    """Return Wilson's interval of a share of independent answers.

    Args:
        num: How many count, from 0 to n; not always whole, where people's shares are added up.
        n: How many answers there are, at least 1.
        level: The chance with which such intervals hold the true share, nearly.

    Raises:
        ValueError: There is no answer, or more of them count than there are.
    """
    if n < 1 or not 0 <= num <= n:
        raise ValueError(f"a share needs from 0 to n of at least 1 answer, not {num} of {n}")
    z = normal_quantile((1 + level) / 2)
    share = num / n
    centre = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    # Rounding must not leave the end at 0 or 1 a hair off it.
    return 0.0 if num == 0 else centre - half, 1.0 if num == n else centre + half


def cluster_interval(groups: Iterable[Group], level: float = LEVEL) -> Interval | None:
    """Return the cluster-robust normal interval of a mean over values of which people gave several.

    The mean is the ratio of sums over people; its variance is that of people's residuals `total - mean * n`, with
    people - 1. However a person's values depend on one another, it holds as soon as there are enough people, some tens.

    Args:
        groups: People, those who gave the same together.
        level: The chance with which such intervals hold the true mean, nearly.

    Returns:
        The interval; None with fewer than two people.
    """
    known = tuple(groups)
    num_people = sum(people for _, _, people in known)
    if num_people < 2:  # noqa: PLR2004 - one person shows no spread
        return None
    n = sum(values * people for _, values, people in known)
    mean = sum(total * people for total, _, people in known) / n
    # An exact sum, so that the order in which people come changes nothing.
    squares = math.fsum((total - mean * values) ** 2 * people for total, values, people in known)
    half = normal_quantile((1 + level) / 2) * math.sqrt(num_people / (num_people - 1) * squares) / n
    return mean - half, mean + half


def _newton(probability: float, df: int) -> float:
    """Climb from the normal quantile, which is no larger, to that of t.

    The distribution function is concave there, so no step of Newton's method leads past the quantile.
    """
    at = normal_quantile(probability)
    for _ in range(_MOST_TERMS):
        step = (probability - _t_below(at, df)) / _t_density(at, df)
        at += step
        if step <= 1e-13 * (1 + at):
            break
    return at


def _t_below(at: float, df: int) -> float:
    """Return P(T <= at), for at >= 0."""
    return 1 - _incomplete_beta(df / (df + at * at), df / 2, 0.5) / 2


def _t_density(at: float, df: int) -> float:
    scale = math.lgamma((df + 1) / 2) - math.lgamma(df / 2) - math.log(df * math.pi) / 2
    return math.exp(scale - (df + 1) / 2 * math.log1p(at * at / df))


def _incomplete_beta(x: float, a: float, b: float) -> float:
    """Return the regularized incomplete beta function, I_x(a, b), for 0 <= x <= 1."""
    if x in (0.0, 1.0):
        return x
    front = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    if x < (a + 1) / (a + b + 2):
        return math.exp(front) * _continued_fraction(x, a, b) / a
    return 1 - math.exp(front) * _continued_fraction(1 - x, b, a) / b


def _continued_fraction(x: float, a: float, b: float) -> float:
    c, d = 1.0, 1 / _not_zero(1 - (a + b) * x / (a + 1))
    value = d
    for m in range(1, _MOST_TERMS):
        for term in (
            m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)),
        ):
            d = 1 / _not_zero(1 + term * d)
            c = _not_zero(1 + term / c)
            value *= c * d
        if abs(c * d - 1) < _PRECISION:
            break
    return value


def _not_zero(value: float) -> float:
    return value if abs(value) > _TINY else _TINY
