"""Ordinal regression with a random intercept per person: the cumulative link mixed model.

    P(rating <= c) = F(threshold_c - x b - u),   u ~ N(0, sd^2) for each person

(P. McCullagh 1980, Regression models for ordinal data, JRSS B 42, 109-142; R. H. B. Christensen, the R package
ordinal.) The likelihood is maximized by Newton's method with exact derivatives. With two categories this is mixed
binary regression.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from webapp.analysis.censoring import Undefined
from webapp.analysis.links import RESIDUAL_SD, Array, Link
from webapp.analysis.ordinal_fit import OrdinalFit
from webapp.analysis.ordinal_likelihood import Evaluation, Problem, evaluate

__all__ = ["Link", "OrdinalFit", "fit_ordinal"]

_MOST_STEPS = 200
_PRECISION = 1e-10
"""The search ends when the next step promises a smaller gain of log-likelihood."""
_MOST_NODES = 200
_SETTLED = 1e-6
"""The quadrature is fine enough when the next finer one promises a smaller gain: no estimate moves by .001 errors."""
_FAR = 12.0
"""Estimates or errors beyond so many latent standard deviations mean that the likelihood has no maximum nearby."""

_WITHOUT_BOUND = "people differ without bound: each of them gives nearly the same rating every time"


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
        num_nodes: Of the quadrature, at least 2. It is made finer until that moves no estimate by a thousandth of
            its standard error, since people who differ much need more nodes.
        groups: `[n]`, groups that have thresholds of their own each (nominal effects); None for one set.

    Raises:
        Undefined: The ratings do not determine the model: one category or one person alone, covariates that cannot be
            told apart, an effect without a finite estimate.
        ValueError: Arguments do not fit together.
    """
    problem, categories = _problem(ratings, people, x, names, link, num_nodes, groups)
    _check_rank(problem, names)
    parameters, modes = _start(problem, categories), np.zeros(len(problem.starts))
    while problem.num_nodes <= _MOST_NODES:
        at = _maximize(problem, parameters, modes, names)
        parameters, modes = at.parameters, at.evaluation.modes
        problem = replace(problem, num_nodes=2 * problem.num_nodes)
        finer = evaluate(problem, parameters, modes)
        if at.is_settled and finer.gradient @ _ascent(finer) < _SETTLED:
            return _fit(problem, _Maximum(parameters, finer, is_settled=True), names, categories)
    raise Undefined(f"the integral over people needs more than {_MOST_NODES} nodes: they differ too much")


@dataclass(frozen=True, slots=True)
class _Maximum:
    parameters: Array
    evaluation: Evaluation
    is_settled: bool


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


def _maximize(problem: Problem, parameters: Array, modes: Array, names: Sequence[str]) -> _Maximum:
    """Climb by Newton's method; where the Hessian is not negative definite it is bent until it is."""
    found = evaluate(problem, parameters, modes)
    for _ in range(_MOST_STEPS):
        step = _ascent(found)
        is_flat = bool(found.gradient @ step < _PRECISION)
        taken = _leave_saddle(problem, parameters, found) if is_flat else _take(problem, parameters, found, step)
        if taken is None:
            # Where a step should lead up and none does, the nodes are too few: value and gradient disagree.
            return _Maximum(parameters, found, is_settled=is_flat)
        parameters, found = taken
        _check_finite(problem, parameters, names)
    raise Undefined(f"the likelihood of {len(problem.upper)} ratings has no maximum after {_MOST_STEPS} steps")


def _leave_saddle(problem: Problem, parameters: Array, found: Evaluation) -> tuple[Array, Evaluation] | None:
    """Leave a flat place that is no maximum along the way that bends up most; None if no way does.

    People who do not differ are such a place: the likelihood is the same for both signs of their SD, so its slope is 0
    there, whether it falls or rises on either side.
    """
    values, vectors = np.linalg.eigh(found.hessian)
    if values[-1] <= 1e-6:  # noqa: PLR2004 - rounding
        return None
    for length in (1.0, 0.5, 0.25, 0.1, 0.03, 0.01):
        ahead = parameters + length * RESIDUAL_SD[problem.link] * vectors[:, -1]
        if _in_order(problem, ahead):
            there = evaluate(problem, ahead, found.modes)
            if there.value > found.value + _PRECISION:
                return ahead, there
    return None


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
        raise Undefined(_undetermined(problem, at.evaluation.hessian, names))
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
        num_nodes=problem.num_nodes,
    )


def _undetermined(problem: Problem, hessian: Array, names: Sequence[str]) -> str:
    """Say which effect may take any value: the one that goes furthest along the way on which the likelihood is flat."""
    flat = np.abs(np.linalg.eigh(hessian)[1][problem.num_thresholds : -1, -1])
    told = f"{len(problem.upper)} ratings of {len(problem.starts)} people do not determine the model"
    if not len(flat) or flat.max() < 0.1:  # noqa: PLR2004 - the thresholds or the SD are to blame
        return told
    return f"{told}: the effect of {names[int(flat.argmax())]} has no finite estimate"
