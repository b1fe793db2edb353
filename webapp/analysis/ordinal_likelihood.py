"""The marginal likelihood of a cumulative link mixed model by adaptive Gauss-Hermite quadrature, with two derivatives.

For each person the integral over their random intercept is taken with nodes around its mode, spread by its curvature
(J. C. Pinheiro and D. M. Bates 1995, Approximations to the log-likelihood function in the nonlinear mixed-effects
model, JCGS 4, 12-35). Gradient and Hessian are those of the integral, by the identities of Fisher and of T. A. Louis
(1982), JRSS B 44, 226-233: posterior means of the complete-data score and Hessian, and the score's posterior variance.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from webapp.analysis.links import Array, IntervalChance, Link, interval_chance

_MODE_STEPS = 60
_MODE_PRECISION = 1e-9


@dataclass(frozen=True)
class Problem:
    """Ratings of N people, sorted by person, and what their distribution depends on.

    Attributes:
        upper: `[n]`, the index of the threshold above each rating; T for none.
        lower: `[n]`, the index of the threshold below; T + 1 for none.
        num_thresholds: T.
        x: `[n, P]`, the covariates.
        starts: `[N]`, where each person's ratings begin.
        link: The link.
        num_nodes: Q, of the quadrature.
        has_person_effect: Whether there is a random intercept; otherwise one node at 0 does.
    """

    upper: NDArray[np.intp]
    lower: NDArray[np.intp]
    num_thresholds: int
    x: Array
    starts: NDArray[np.intp]
    link: Link
    num_nodes: int
    has_person_effect: bool = True

    @cached_property
    def counts(self) -> NDArray[np.intp]:
        """`[N]`, how many ratings each person gave."""
        return np.diff(np.append(self.starts, len(self.upper)))

    @cached_property
    def designs(self) -> tuple[Array, Array]:
        """`[n, T + P]` each: how both ends of a rating's interval depend on thresholds and coefficients."""
        return self._design(self.upper), self._design(self.lower)

    def _design(self, index: NDArray[np.intp]) -> Array:
        return np.hstack([(index[:, None] == np.arange(self.num_thresholds)).astype(np.float64), -self.x])

    @cached_property
    def nodes(self) -> tuple[Array, Array]:
        """Nodes and logarithms of weights of the quadrature for `exp(-z^2)`."""
        if not self.has_person_effect:
            return np.zeros(1), np.zeros(1)
        nodes, weights = np.polynomial.hermite.hermgauss(self.num_nodes)
        return nodes, np.log(weights) + nodes**2

    def people_sums(self, values: Array) -> Array:
        """Add up over each person's ratings, along the first axis."""
        return np.asarray(np.add.reduceat(values, self.starts, axis=0))

    def ends(self, parameters: Array, intercepts: Array) -> tuple[Array, Array]:
        """`[n, Q]` each: the interval of each rating on the latent scale, given intercepts `[N, Q]` in SDs."""
        thresholds = np.concatenate([parameters[: self.num_thresholds], [np.inf, -np.inf]])
        shift = (self.x @ parameters[self.num_thresholds : -1])[:, None]
        if self.has_person_effect:
            shift = shift + parameters[-1] * np.repeat(intercepts, self.counts, axis=0)
        return thresholds[self.upper][:, None] - shift, thresholds[self.lower][:, None] - shift


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The likelihood at one place.

    Attributes:
        value: Its logarithm.
        gradient: `[K]`, K = T + P + 1, in the order thresholds, coefficients, SD of the intercepts.
        hessian: `[K, K]`.
        modes: `[N]`, each person's most probable intercept, in SDs: where to begin next time.
        spreads: `[N]`, the standard deviation of each intercept given the ratings, in SDs.
    """

    value: float
    gradient: Array
    hessian: Array
    modes: Array
    spreads: Array


def evaluate(problem: Problem, parameters: Array, modes: Array) -> Evaluation:
    """Evaluate the likelihood.

    Args:
        problem: The ratings.
        parameters: `[K]`; the thresholds must increase.
        modes: `[N]`, where the search for the modes begins.
    """
    modes, spreads = _find_modes(problem, parameters, modes)
    nodes, log_weights = problem.nodes
    intercepts = modes[:, None] + np.sqrt(2) * spreads[:, None] * nodes
    chance = interval_chance(*problem.ends(parameters, intercepts), problem.link)
    log_joint = problem.people_sums(chance.log)
    if problem.has_person_effect:
        log_joint += log_weights - 0.5 * intercepts**2 + np.log(spreads / np.sqrt(np.pi))[:, None]
    log_marginal = logsumexp(log_joint, axis=1)
    posterior = np.exp(log_joint - log_marginal[:, None])
    gradient, hessian = _derivatives(problem, chance, intercepts, posterior)
    return Evaluation(float(log_marginal.sum()), gradient, hessian, modes, spreads)


def _find_modes(problem: Problem, parameters: Array, modes: Array) -> tuple[Array, Array]:
    """Return each person's mode and spread, by Newton's method with steps no longer than one SD."""
    if not problem.has_person_effect:
        return np.zeros(len(problem.starts)), np.ones(len(problem.starts))
    sd = parameters[-1]
    for _ in range(_MODE_STEPS):
        chance = interval_chance(*problem.ends(parameters, modes[:, None]), problem.link)
        slope = sd * problem.people_sums(chance.by_shift)[:, 0] - modes
        curvature = 1 - sd**2 * problem.people_sums(chance.by_shift_twice)[:, 0]
        step = np.clip(slope / curvature, -1, 1)
        modes = modes + step
        if np.max(np.abs(step)) < _MODE_PRECISION:
            break
    return modes, 1 / np.sqrt(curvature)


def _derivatives(problem: Problem, chance: IntervalChance, intercepts: Array, posterior: Array) -> tuple[Array, Array]:
    by_upper, by_lower = problem.designs
    scores = np.empty((*intercepts.shape, by_upper.shape[1] + 1))
    scores[:, :, :-1] = problem.people_sums(
        chance.by_upper[:, :, None] * by_upper[:, None, :] + chance.by_lower[:, :, None] * by_lower[:, None, :]
    )
    scores[:, :, -1] = intercepts * problem.people_sums(chance.by_shift)
    means = np.einsum("jq,jqk->jk", posterior, scores)
    weighted = (np.sqrt(posterior)[:, :, None] * scores).reshape(-1, scores.shape[2])
    hessian = _complete_hessian(problem, chance, intercepts, posterior) + weighted.T @ weighted - means.T @ means
    gradient = means.sum(axis=0)
    if not problem.has_person_effect:
        gradient[-1], hessian[-1, :], hessian[:, -1], hessian[-1, -1] = 0, 0, 0, -1
    return gradient, hessian


def _complete_hessian(problem: Problem, chance: IntervalChance, intercepts: Array, posterior: Array) -> Array:
    """Return the posterior mean of the Hessian of the ratings and intercepts together."""
    by_upper, by_lower = problem.designs
    weights = np.repeat(posterior, problem.counts, axis=0)
    shifts = np.repeat(intercepts, problem.counts, axis=0)
    upper, mixed, lower = (
        (weights * part).sum(axis=1) for part in (chance.upper_upper, chance.upper_lower, chance.lower_lower)
    )
    cross = by_upper.T @ (mixed[:, None] * by_lower)
    size = by_upper.shape[1] + 1
    hessian = np.empty((size, size))
    hessian[:-1, :-1] = by_upper.T @ (upper[:, None] * by_upper) + by_lower.T @ (lower[:, None] * by_lower)
    hessian[:-1, :-1] += cross + cross.T
    with_shift = weights * shifts
    of_upper = (with_shift * (chance.upper_upper + chance.upper_lower)).sum(axis=1)
    of_lower = (with_shift * (chance.lower_lower + chance.upper_lower)).sum(axis=1)
    hessian[:-1, -1] = hessian[-1, :-1] = -(by_upper.T @ of_upper + by_lower.T @ of_lower)
    hessian[-1, -1] = (with_shift * shifts * chance.by_shift_twice).sum()
    return hessian
