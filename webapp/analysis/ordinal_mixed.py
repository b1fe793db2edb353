"""Ordinal regression with a random intercept per person: the cumulative link mixed model.

    P(rating <= c) = F(threshold_c - x b - u),   u ~ N(0, sd^2) for each person

(P. McCullagh 1980, Regression models for ordinal data, JRSS B 42, 109-142; R. H. B. Christensen, the R package
ordinal.) The likelihood is maximized by Newton's method with exact derivatives. With two categories this is mixed
binary regression.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from webapp.analysis.censoring import Undefined
from webapp.analysis.links import RESIDUAL_SD, Array, Link
from webapp.analysis.ordinal_likelihood import Evaluation, Problem, evaluate

__all__ = ["Link", "OrdinalFit", "fit_ordinal"]

_MOST_STEPS = 200
_PRECISION = 1e-10
"""The search ends when the next step promises a smaller gain of log-likelihood."""
_FAR = 12.0
"""Estimates or errors beyond so many latent standard deviations mean that the likelihood has no maximum nearby."""

_WITHOUT_BOUND = "people differ without bound: each of them gives nearly the same rating every time"


@dataclass(frozen=True, slots=True)
class OrdinalFit:
    """A fitted cumulative link mixed model with T thresholds and P coefficients.

    Attributes:
        link: Its link.
        names: `[P]`, of the covariates.
        categories: `[T + 1]`, the ratings that occur, in order; others play no part.
        thresholds: `[T]` (nominal effects: those of one group after the other).
        coefficients: `[P]`; positive ones raise ratings.
        sd: Of the random intercepts, at least 0, in the unit of the coefficients.
        covariance: `[K, K]` of thresholds, coefficients and `sd`, from the observed information.
        log_likelihood: At the maximum, by quadrature.
        intercepts: `[N]`, each person's most probable intercept, in the unit of the coefficients; people as sorted.
        num_ratings: n.
        num_people: N.
        has_person_effect: Whether there is a random intercept. Without repeated ratings there is none.
    """

    link: Link
    names: tuple[str, ...]
    categories: tuple[int, ...]
    thresholds: Array
    coefficients: Array
    sd: float
    covariance: Array
    log_likelihood: float
    intercepts: Array
    num_ratings: int
    num_people: int
    has_person_effect: bool

    @property
    def latent_sd(self) -> float:
        """The standard deviation of the latent rating over people and within them, in the unit of the coefficients."""
        return float(np.hypot(RESIDUAL_SD[self.link], self.sd))

    @property
    def num_parameters(self) -> int:
        """K, or K - 1 without a random intercept."""
        return len(self.thresholds) + len(self.coefficients) + self.has_person_effect

    @property
    def standard_errors(self) -> Array:
        """`[K]` of thresholds, coefficients and `sd`."""
        return np.sqrt(np.diag(self.covariance))

    def estimate(self, weights: ArrayLike) -> tuple[float, float]:
        """Return a linear combination of the coefficients and its standard error; `weights` is `[P]`."""
        full = self._full(weights)
        return float(np.asarray(weights, dtype=float) @ self.coefficients), float(
            np.sqrt(full @ self.covariance @ full)
        )

    def standardized(self, weights: ArrayLike) -> tuple[float, float]:
        """Return the same in standard deviations of the latent rating, with its error by the delta method.

        The latent rating varies over people and within them, so this is a difference in the manner of Cohen's d.
        """
        value, _ = self.estimate(weights)
        gradient = self._full(weights) / self.latent_sd
        gradient[-1] = -value * self.sd / self.latent_sd**3
        return value / self.latent_sd, float(np.sqrt(gradient @ self.covariance @ gradient))

    def _full(self, weights: ArrayLike) -> Array:
        return np.concatenate([np.zeros(len(self.thresholds)), np.asarray(weights, dtype=float), [0.0]])


def fit_ordinal(
    ratings: ArrayLike,
    people: ArrayLike,
    x: ArrayLike,
    names: Sequence[str],
    *,
    link: Link = "probit",
    num_nodes: int = 11,
    groups: ArrayLike | None = None,
) -> OrdinalFit:
    """Fit a cumulative link mixed model.

    Args:
        ratings: `[n]` whole numbers.
        people: `[n]`, who gave each of them.
        x: `[n, P]` covariates, no constant among them; P may be 0.
        names: `[P]`.
        link: `probit` or `logit`.
        num_nodes: Of the quadrature, at least 2.
        groups: `[n]`, groups that have thresholds of their own each (nominal effects); None for one set.

    Raises:
        Undefined: The ratings do not determine the model: one category or one person alone, covariates that cannot be
            told apart, an effect without a finite estimate.
        ValueError: Arguments do not fit together.
    """
    problem, categories = _problem(ratings, people, x, names, link, num_nodes, groups)
    _check_rank(problem, names)
    at = _maximize(problem, _start(problem, categories), names)
    return _fit(problem, at, names, categories)


@dataclass(frozen=True, slots=True)
class _Maximum:
    parameters: Array
    evaluation: Evaluation


def _problem(
    ratings: ArrayLike,
    people: ArrayLike,
    x: ArrayLike,
    names: Sequence[str],
    link: Link,
    num_nodes: int,
    groups: ArrayLike | None,
) -> tuple[Problem, NDArray[np.int64]]:
    values, who = np.asarray(ratings), np.asarray(people)
    covariates = np.asarray(x, dtype=np.float64).reshape(len(values), len(names))
    if who.shape != values.shape or num_nodes < 2:  # noqa: PLR2004 - one node is no quadrature
        raise ValueError(f"{values.shape} ratings need as many people, not {who.shape}, and 2 nodes or more")
    categories, codes = np.unique(values, return_inverse=True)
    _, person = np.unique(who, return_inverse=True)
    if len(categories) < 2:  # noqa: PLR2004
        raise Undefined(f"all {len(values)} ratings are {categories[0]}" if len(values) else "there are no ratings")
    if person.max() == 0:
        raise Undefined(f"all {len(values)} ratings are of one person")
    order = np.argsort(person, kind="stable")
    group = np.zeros(len(values), np.intp) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
    num_cuts = len(categories) - 1
    total = num_cuts * (int(group.max()) + 1)
    upper = np.where(codes < num_cuts, group * num_cuts + codes, total)
    lower = np.where(codes > 0, group * num_cuts + codes - 1, total + 1)
    starts = np.flatnonzero(np.diff(person[order], prepend=-1))
    repeated = len(starts) < len(values)
    return (
        Problem(upper[order], lower[order], total, covariates[order], starts, link, num_nodes, repeated),
        categories.astype(np.int64),
    )


def _check_rank(problem: Problem, names: Sequence[str]) -> None:
    with_constant = np.hstack([np.ones((len(problem.x), 1)), problem.x])
    if np.linalg.matrix_rank(with_constant) < with_constant.shape[1]:
        raise Undefined(f"the effects of {', '.join(names)} cannot be told apart in these {len(problem.x)} ratings")


def _start(problem: Problem, categories: NDArray[np.int64]) -> Array:
    """Return thresholds that fit the ratings as a whole, no effects, and people who differ somewhat."""
    num_cuts = len(categories) - 1
    codes = np.where(problem.lower > problem.num_thresholds, 0, problem.lower % num_cuts + 1)
    below = np.cumsum(np.bincount(codes, minlength=num_cuts + 1))[:-1] / len(codes)
    logits = np.log(below / (1 - below))
    sd = 0.75 * RESIDUAL_SD[problem.link] if problem.has_person_effect else 0.0
    scale = RESIDUAL_SD[problem.link] / RESIDUAL_SD["logit"] * 1.25
    num_groups = problem.num_thresholds // num_cuts
    return np.concatenate([np.tile(logits * scale, num_groups), np.zeros(problem.x.shape[1]), [sd]])


def _maximize(problem: Problem, parameters: Array, names: Sequence[str]) -> _Maximum:
    """Climb by Newton's method; where the Hessian is not negative definite it is bent until it is."""
    found = evaluate(problem, parameters, np.zeros(len(problem.starts)))
    for _ in range(_MOST_STEPS):
        step = _ascent(found)
        if found.gradient @ step < _PRECISION:
            break
        taken = _take(problem, parameters, found, step)
        if taken is None:
            break
        parameters, found = taken
        _check_finite(problem, parameters, names)
    else:
        raise Undefined(f"the likelihood of {len(problem.upper)} ratings has no maximum after {_MOST_STEPS} steps")
    return _Maximum(parameters, found)


def _ascent(found: Evaluation) -> Array:
    values, vectors = np.linalg.eigh(-found.hessian)
    least = max(1e-8, 1e-10 * float(np.abs(values).max()))
    return np.asarray(vectors @ ((vectors.T @ found.gradient) / np.maximum(np.abs(values), least)))


def _take(problem: Problem, parameters: Array, found: Evaluation, step: Array) -> tuple[Array, Evaluation] | None:
    """Take the step, or a half, a quarter of it and so on, until the likelihood grows and thresholds stay in order."""
    longest = float(np.abs(step).max())
    factor = min(1.0, 3 / longest)
    while factor * longest > 1e-12:  # noqa: PLR2004 - below the rounding of the parameters
        ahead = parameters + factor * step
        if _in_order(problem, ahead):
            there = evaluate(problem, ahead, found.modes)
            if there.value >= found.value:
                return ahead, there
        factor /= 2
    return None


def _in_order(problem: Problem, parameters: Array) -> bool:
    inner = (problem.upper < problem.num_thresholds) & (problem.lower < problem.num_thresholds)
    return bool(np.all(parameters[problem.upper[inner]] > parameters[problem.lower[inner]]))


def _check_finite(problem: Problem, parameters: Array, names: Sequence[str]) -> None:
    limit = _FAR * float(np.hypot(RESIDUAL_SD[problem.link], parameters[-1]))
    coefficients = parameters[problem.num_thresholds : -1]
    if len(coefficients) and np.abs(coefficients).max() > limit:
        name = names[int(np.abs(coefficients).argmax())]
        raise Undefined(f"the effect of {name} has no finite estimate: its ratings lie at one end of the scale")
    if abs(parameters[-1]) > _FAR * RESIDUAL_SD[problem.link]:
        raise Undefined(_WITHOUT_BOUND)


def _fit(problem: Problem, at: _Maximum, names: Sequence[str], categories: NDArray[np.int64]) -> OrdinalFit:
    num_thresholds, parameters = problem.num_thresholds, at.parameters.copy()
    values = np.linalg.eigvalsh(-at.evaluation.hessian)
    if values.min() <= 1e-7 * min(1.0, values.max()):
        if abs(parameters[-1]) > _FAR / 3 * RESIDUAL_SD[problem.link]:
            raise Undefined(_WITHOUT_BOUND)
        raise Undefined(f"{len(problem.upper)} ratings of {len(problem.starts)} people do not determine the model")
    covariance = np.asarray(np.linalg.inv(-at.evaluation.hessian), dtype=np.float64)
    if not problem.has_person_effect:
        covariance[-1, -1] = 0.0
    if parameters[-1] < 0:  # The likelihood is the same for both signs.
        parameters[-1] *= -1
        covariance[-1, :-1] *= -1
        covariance[:-1, -1] *= -1
    errors = np.sqrt(np.diag(covariance))[num_thresholds:-1]
    limit = _FAR * float(np.hypot(RESIDUAL_SD[problem.link], parameters[-1]))
    if len(errors) and errors.max() > limit:
        name = names[int(errors.argmax())]
        raise Undefined(f"the effect of {name} has no finite estimate: its ratings lie at one end of the scale")
    return OrdinalFit(
        link=problem.link,
        names=tuple(names),
        categories=tuple(int(category) for category in categories),
        thresholds=parameters[:num_thresholds],
        coefficients=parameters[num_thresholds:-1],
        sd=float(parameters[-1]),
        covariance=covariance,
        log_likelihood=at.evaluation.value,
        intercepts=at.evaluation.modes * at.parameters[-1],
        num_ratings=len(problem.upper),
        num_people=len(problem.starts),
        has_person_effect=problem.has_person_effect,
    )
