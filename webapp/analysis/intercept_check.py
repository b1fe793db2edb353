"""Whether people's intercepts are normal, judged by what the fitted model itself would show of them.

The most probable intercepts of few ordinal ratings are shrunken and take few values, all the more near an end of the
scale, so they are not normal even where the intercepts are. Their Shapiro-Wilk statistic is therefore held to what it
is in ratings that are drawn from the fitted model (a parametric bootstrap), and not to its table for normal values.

The statistic hangs on the parameters, above all on how many people give the highest rating every time, and these were
fitted to the ratings. Draws differ in them, so that draws alone would make a test that hardly ever rejects. What counts
is how draws look to which the same parameters would be fitted: those at which the likelihood's gradient is 0, as it is
for the ratings. They are reached by linear regression of the draws' statistics on their gradients.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from webapp.analysis.censoring import Undefined
from webapp.analysis.links import Array, IntervalChance, Link, interval_chance
from webapp.analysis.means import shapiro_wilk
from webapp.analysis.ordinal_mixed import OrdinalFit

NUM_DRAWS = 199
"""Draws of all ratings, so that the smallest p value is .005."""
FEWER_DRAWS = 99
"""With many people, whose ratings take longer to draw and to look at."""
MANY_PEOPLE = 500

FEWEST_PEOPLE = 8
"""With fewer intercepts a test of their shape says nothing."""
_LEAST_SPREAD = 1e-6
_LEAST_DISTANCE = 1e-12
_MOST_AT_ONCE = 30_000
"""Ratings that are looked at together, which bounds the memory."""
NUM_NODES = 7
"""Of the quadrature: gradients only tell draws apart, so that two digits of them are enough."""
_MOST_STEPS, _PRECISION = 40, 1e-6


@dataclass(frozen=True, slots=True)
class InterceptCheck:
    """How likely intercepts that look as little normal are, if the model is true.

    Attributes:
        statistic: Shapiro and Wilk's W of the most probable intercepts, in (0, 1]; 1 is normal.
        usual: The median of W in the draws.
        num_draws: How many times all ratings were drawn.
        p_value: The rank of the statistic among those of the draws, in [1 / (num_draws + 1), 1].
    """

    statistic: float
    usual: float
    num_draws: int
    p_value: float


def check_intercepts(
    fit: OrdinalFit, people: ArrayLike, x: ArrayLike, rng: np.random.Generator, num_draws: int | None = None
) -> InterceptCheck:
    """Compare the shape of people's most probable intercepts with their shape in ratings drawn from the model.

    Args:
        fit: A model with one set of thresholds.
        people: `[n]`, who gave each rating, as it was fitted.
        x: `[n, P]`, the covariates, as they were fitted.
        rng: Draws people and ratings, each draw for the same people with the same covariates.
        num_draws: How often; `NUM_DRAWS`, or `FEWER_DRAWS` of more than `MANY_PEOPLE` if None.

    Raises:
        Undefined: There are too few people or too many for W, or their intercepts do not vary.
        ValueError: Arguments do not fit together.
    """
    person = np.unique(np.asarray(people), return_inverse=True)[1]
    covariates = np.asarray(x, dtype=np.float64).reshape(len(person), len(fit.coefficients))
    if len(person) != fit.num_ratings or len(fit.thresholds) != len(fit.categories) - 1:
        raise ValueError(f"{len(person)} rows and {len(fit.thresholds)} thresholds are not those of the model")
    if fit.num_people < FEWEST_PEOPLE:
        raise Undefined(f"{fit.num_people} people are too few to tell how their intercepts are distributed")
    if not fit.has_person_effect or float(fit.intercepts.std()) < _LEAST_SPREAD:
        raise Undefined(f"the intercepts of {fit.num_people} people do not vary")
    statistic = shapiro_wilk(fit.intercepts).statistic
    num_draws = num_draws or (NUM_DRAWS if fit.num_people <= MANY_PEOPLE else FEWER_DRAWS)
    order = np.argsort(person, kind="stable")
    drawn, gradients = _drawn(fit, person[order], covariates[order], rng, num_draws)
    alike = _as_fitted(drawn, gradients)
    rank = 1 + int(np.sum(alike <= statistic))
    return InterceptCheck(statistic, float(np.median(alike)), num_draws, rank / (num_draws + 1))


@dataclass(frozen=True, slots=True)
class Draws:
    """Ratings of B draws of N people, n in each draw, sorted by person.

    Attributes:
        codes: `[B, n]`, the place of each rating among the categories.
        person: `[n]`, who gives it, from 0 on.
        x: `[n, P]`, the covariates.
        link: The link.
    """

    codes: NDArray[np.intp]
    person: NDArray[np.intp]
    x: Array
    link: Link

    def chance(self, parameters: Array, intercepts: Array) -> IntervalChance:
        """Return the chance of each rating, `[Q, B, n]`, given `[K]` parameters and `[Q, B, N]` intercepts in SDs."""
        num_cuts = self.num_cuts(parameters)
        cuts = np.concatenate([[-np.inf], parameters[:num_cuts], [np.inf]])
        shift = self.x @ parameters[num_cuts:-1] + parameters[-1] * intercepts[..., self.person]
        return interval_chance(cuts[self.codes + 1] - shift, cuts[self.codes] - shift, self.link)

    def num_cuts(self, parameters: Array) -> int:
        """Return how many of the parameters are thresholds."""
        return int(len(parameters) - self.x.shape[1] - 1)

    def people_sums(self, values: Array) -> Array:
        """Add up over each person's ratings, along the last axis."""
        starts = np.flatnonzero(np.diff(self.person, prepend=-1))
        return np.asarray(np.add.reduceat(values, starts, axis=-1))


def drawn_from(fit: OrdinalFit, person: NDArray[np.intp], x: Array, rng: np.random.Generator, num_draws: int) -> Draws:
    """Draw intercepts and ratings from a model; `person` is sorted, `x` in its order."""
    intercepts = rng.normal(0, fit.sd, (num_draws, fit.num_people))
    shape = (num_draws, len(person))
    errors = rng.normal(size=shape) if fit.link == "probit" else rng.logistic(size=shape)
    codes = np.searchsorted(fit.thresholds, x @ fit.coefficients + intercepts[:, person] + errors)
    return Draws(codes, person, x, fit.link)


def look_at(draws: Draws, parameters: Array) -> tuple[Array, Array]:
    """Evaluate each draw by itself, by adaptive quadrature.

    Args:
        draws: The draws.
        parameters: `[K]`: thresholds, coefficients, SD of the intercepts.

    Returns:
        `[B, N]`, every person's most probable intercept in SDs, and `[B, K]`, the gradient of the log-likelihood.
    """
    modes, spreads = _find_modes(draws, parameters)
    nodes, weights = np.polynomial.hermite.hermgauss(NUM_NODES)
    intercepts = modes + np.sqrt(2) * spreads * nodes[:, None, None]
    chance = draws.chance(parameters, intercepts)
    log_joint = draws.people_sums(chance.log) - 0.5 * intercepts**2 + (np.log(weights) + nodes**2)[:, None, None]
    posterior = np.exp(log_joint - log_joint.max(axis=0))
    posterior /= posterior.sum(axis=0)
    of_rating = posterior[..., draws.person]
    at_upper, at_lower = ((of_rating * part).sum(axis=0) for part in (chance.by_upper, chance.by_lower))
    by_cut = [
        (at_upper * (draws.codes == cut) + at_lower * (draws.codes == cut + 1)).sum(axis=1)
        for cut in range(draws.num_cuts(parameters))
    ]
    by_sd = (posterior * intercepts * draws.people_sums(chance.by_shift)).sum(axis=(0, 2))
    return modes, np.column_stack([*by_cut, -(at_upper + at_lower) @ draws.x, by_sd])


def _find_modes(draws: Draws, parameters: Array) -> tuple[Array, Array]:
    """Return `[B, N]` each, modes and spreads in SDs, by Newton's method with steps no longer than one SD."""
    sd = parameters[-1]
    modes = np.zeros((len(draws.codes), int(draws.person[-1]) + 1))
    for _ in range(_MOST_STEPS):
        chance = draws.chance(parameters, modes)
        curvature = 1 - sd**2 * draws.people_sums(chance.by_shift_twice)
        step = np.clip((sd * draws.people_sums(chance.by_shift) - modes) / curvature, -1, 1)
        modes = modes + step
        if np.max(np.abs(step)) < _PRECISION:
            break
    return modes, 1 / np.sqrt(curvature)


def _drawn(
    fit: OrdinalFit, person: NDArray[np.intp], x: Array, rng: np.random.Generator, num_draws: int
) -> tuple[Array, Array]:
    """Return `[num_draws]` statistics W and `[num_draws, K]` gradients at the parameters of the fit."""
    at_once = max(1, _MOST_AT_ONCE // len(person))
    parameters = np.concatenate([fit.thresholds, fit.coefficients, [fit.sd]])
    statistics, gradients = [], []
    for first in range(0, num_draws, at_once):
        draws = drawn_from(fit, person, x, rng, min(at_once, num_draws - first))
        modes, gradient = look_at(draws, parameters)
        statistics += [_w(each) for each in modes]
        gradients.append(gradient)
    return np.array(statistics), np.concatenate(gradients)


def _as_fitted(statistics: Array, gradients: Array) -> Array:
    """Return statistics as they were if each gradient were 0, as far as a linear regression tells that.

    It is made on the logarithm of 1 - W, in which W has no end and less of a tail.
    """
    known = np.column_stack([np.ones(len(gradients)), gradients])
    logs = np.log(np.maximum(1 - statistics, _LEAST_DISTANCE))
    found = np.linalg.lstsq(known, logs)[0]
    rest = logs - known @ found
    # In the draws that it was fitted to, a regression leaves too little.
    rest = rest * np.sqrt(len(rest) / max(1, len(rest) - known.shape[1]))
    return np.asarray(1 - np.exp(found[0] + rest))


def _w(modes: Array) -> float:
    """Return Shapiro and Wilk's W; 0, which speaks for the model that was fitted, where a draw does not vary."""
    try:
        return shapiro_wilk(modes).statistic
    except Undefined:
        return 0.0
