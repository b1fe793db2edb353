"""How well the items of a scale measure one thing together: Cronbach's alpha and McDonald's omega.

Alpha (L. J. Cronbach 1951) with the interval of L. S. Feldt 1965, The approximate sampling distribution of
Kuder-Richardson reliability coefficient twenty, Psychometrika 30, 357-370. Omega (R. P. McDonald 1999, Test theory)
from the maximum likelihood fit of one factor, which needs no equal loadings.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize, stats

from webapp.analysis.censoring import Undefined

Floats = NDArray[np.float64]

LEAST_UNIQUENESS = 0.005
"""Of an item's variance; at this bound the fit is improper (a Heywood case). As in R's `factanal`."""

LEAST_PEOPLE = 5
"""With fewer, and with no more people than items, answers go together by chance as perfectly as by a common cause."""

NUM_RESAMPLES = 500
_LEAST_DEFINED = 0.95

_ROUNDING = 1e-9
_LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Alpha:
    """Cronbach's alpha.

    Attributes:
        num_people: N.
        num_items: K.
        value: At most 1; below 0 where items vary against each other.
        low: Lower end of Feldt's 95 % interval.
        high: Upper end.
        mean_correlation: The mean of the correlations between items.
    """

    num_people: int
    num_items: int
    value: float
    low: float
    high: float
    mean_correlation: float


@dataclass(frozen=True, slots=True)
class Omega:
    """McDonald's omega total.

    Attributes:
        value: 0 to 1: the factor's share of the variance of the sum.
        loadings: `K` standardized loadings; their sum is not negative.
        is_improper: Whether an item's uniqueness is at its bound, so that the value is not to be trusted.
    """

    value: float
    loadings: tuple[float, ...]
    is_improper: bool


def cronbach_alpha(items: ArrayLike) -> Alpha:
    """Estimate alpha.

    Args:
        items: `[N, K]`, one row per person.

    Raises:
        Undefined: There are fewer than two items, fewer than `LEAST_PEOPLE` people or no more than items, an item does
            not vary, the sum does not, or alpha is 1, of which Feldt's interval has no width.

    Example:
        >>> found = cronbach_alpha([[1, 2], [2, 2], [3, 4], [4, 3], [5, 5]])
        >>> round(found.value, 4), found.num_items
        (0.9091, 2)
    """
    given = _checked(items, least_items=2)
    n, k = given.shape
    total = float(given.sum(axis=1).var(ddof=1))
    if total < _ROUNDING:
        raise Undefined(f"alpha needs a sum that varies, and all {n} people have the same")
    _check_enough(n, k)
    value = k / (k - 1) * (1 - float(given.var(axis=0, ddof=1).sum()) / total)
    if value > 1 - _ROUNDING:
        raise Undefined(
            f"alpha is 1 exactly: the {k} items of all {n} people differ by constants, which tells no error"
        )
    freedom = (n - 1, (n - 1) * (k - 1))
    upper, lower = (float(stats.f.ppf(share, *freedom)) for share in ((1 + _LEVEL) / 2, (1 - _LEVEL) / 2))
    correlations = _correlations(given)[np.triu_indices(k, 1)]
    return Alpha(n, k, value, 1 - (1 - value) * upper, 1 - (1 - value) * lower, float(correlations.mean()))


def mean_correlation_interval(
    items: ArrayLike, rng: np.random.Generator, num_resamples: int = NUM_RESAMPLES
) -> tuple[float, float] | None:
    """Return the 95 % percentile bootstrap interval, over people, of the mean correlation between items.

    Args:
        items: `[N, K]`, one row per person.
        rng: Draws the resamples.
        num_resamples: B.

    Returns:
        None where an item is constant in too many resamples, or nothing varies over them.

    Raises:
        Undefined: As of `cronbach_alpha`.
    """
    given = _checked(items, least_items=2)
    _check_enough(*given.shape)
    upper = np.triu_indices(given.shape[1], 1)
    found = [
        float(_correlations(each)[upper].mean()) if np.ptp(each, axis=0).min() > _ROUNDING else math.nan
        for each in _resampled(given, rng, num_resamples)
    ]
    return _percentiles(found)


def omega_interval(
    items: ArrayLike, rng: np.random.Generator, num_resamples: int = NUM_RESAMPLES
) -> tuple[float, float] | None:
    """Return the 95 % percentile bootstrap interval of omega, over people (K. Kelley and S. Pornprasertmanit 2016).

    Confidence intervals for population reliability coefficients, Psychological Methods 21, 69-92, recommend the
    bootstrap over intervals in closed form.

    Args:
        items: `[N, K]`, one row per person.
        rng: Draws the resamples.
        num_resamples: B.

    Returns:
        None where too many resamples have no omega, or all have the same.

    Raises:
        Undefined: As of `mcdonald_omega`.
    """
    given = _checked(items, least_items=3)
    uniqueness = _uniqueness(given)
    found = []
    for each in _resampled(given, rng, num_resamples):
        try:
            found.append(_omega(_checked(each, least_items=3), uniqueness, precise=False).value)
        except Undefined:
            found.append(math.nan)
    return _percentiles(found)


def mcdonald_omega(items: ArrayLike) -> Omega:
    """Estimate omega from one factor.

    Args:
        items: `[N, K]`, one row per person.

    Raises:
        Undefined: There are fewer than three items, no more people than items, an item does not vary, or one follows
            from the others.
    """
    given = _checked(items, least_items=3)
    return _omega(given, None, precise=True)


def _omega(given: Floats, start: Floats | None, *, precise: bool) -> Omega:
    uniqueness = _uniqueness(given, start, precise=precise)
    loadings = _loadings(uniqueness, _correlations(given))
    deviations = given.std(axis=0, ddof=1)
    common = float(loadings @ deviations) ** 2
    value = common / (common + float(uniqueness @ deviations**2))
    is_improper = bool((uniqueness < LEAST_UNIQUENESS + 1e-6).any())
    return Omega(value, tuple(float(loading) for loading in loadings), is_improper)


def _uniqueness(given: Floats, start: Floats | None = None, *, precise: bool = True) -> Floats:
    """Return the `[K]` uniquenesses at the maximum of the likelihood, climbing from `start` if there is one."""
    n, k = given.shape
    if n <= k:
        raise Undefined(f"a factor of {k} items needs more than {k} people, not {n}")
    correlations = _correlations(given)
    if np.linalg.matrix_rank(correlations, tol=1e-8, hermitian=True) < k:
        raise Undefined(f"a factor needs items of which none follows from the others, and of {k} one does")
    if start is None:
        start = np.clip((1 - 0.5 / k) / np.diag(np.linalg.inv(correlations)), LEAST_UNIQUENESS, 1.0)
    fit = optimize.minimize(
        _misfit,
        start,
        args=(correlations,),
        jac=True,
        method="L-BFGS-B",
        bounds=[(LEAST_UNIQUENESS, 1.0)] * k,
        options={"ftol": 1e-15 if precise else 1e-7, "gtol": 1e-10 if precise else 1e-4, "maxiter": 5_000},
    )
    return np.asarray(fit.x, dtype=np.float64)


def _check_enough(num_people: int, num_items: int) -> None:
    least = max(LEAST_PEOPLE, num_items + 1)
    if num_people < least:
        raise Undefined(f"the reliability of {num_items} items needs {least} people or more, not {num_people}")


def _resampled(given: Floats, rng: np.random.Generator, num_resamples: int) -> Iterator[Floats]:
    for drawn in rng.integers(len(given), size=(num_resamples, len(given))):
        yield given[drawn]


def _percentiles(values: list[float]) -> tuple[float, float] | None:
    known = np.asarray([value for value in values if math.isfinite(value)])
    if known.size < _LEAST_DEFINED * len(values) or np.ptp(known) < _ROUNDING:
        return None
    low, high = np.quantile(known, [(1 - _LEVEL) / 2, (1 + _LEVEL) / 2])
    return float(low), float(high)


def _checked(items: ArrayLike, least_items: int) -> Floats:
    given = np.asarray(items, dtype=np.float64)
    if given.ndim != 2 or not np.isfinite(given).all():  # noqa: PLR2004 - people times items
        raise ValueError(f"items must be people x items and finite, not of shape {given.shape}")
    n, k = given.shape
    if n < 2 or k < least_items:  # noqa: PLR2004 - one person shows no spread
        raise Undefined(f"reliability needs 2 people and {least_items} items or more, not {n} and {k}")
    still = np.flatnonzero(np.ptp(given, axis=0) < _ROUNDING)
    if still.size:
        raise Undefined(f"{still.size} of {k} items do not vary between {n} people")
    return given


def _correlations(items: Floats) -> Floats:
    return np.asarray(np.corrcoef(items, rowvar=False), dtype=np.float64)


def _misfit(uniqueness: Floats, correlations: Floats) -> tuple[float, Floats]:
    """Return the likelihood's discrepancy with the best loadings, and its gradient (Joreskog 1967)."""
    scale = 1 / np.sqrt(uniqueness)
    values, vectors = np.linalg.eigh(correlations * scale[:, None] * scale[None, :])
    loadings, values = vectors[:, -1] * math.sqrt(max(0.0, float(values[-1]) - 1)) / scale, values[:-1]
    implied = np.outer(loadings, loadings) + np.diag(uniqueness)
    gradient = np.diag(implied - correlations) / uniqueness**2
    return float((values - np.log(values) - 1).sum()), gradient


def _loadings(uniqueness: Floats, correlations: Floats) -> Floats:
    scale = 1 / np.sqrt(uniqueness)
    values, vectors = np.linalg.eigh(correlations * scale[:, None] * scale[None, :])
    found: Floats = vectors[:, -1] * math.sqrt(max(0.0, float(values[-1]) - 1)) / scale
    return found if found.sum() >= 0 else -found
