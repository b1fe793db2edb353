"""Whether people's intercepts are normal, by draws from the fitted model."""

import numpy as np
import pytest
from numpy.typing import NDArray

from webapp.analysis.censoring import Undefined
from webapp.analysis.intercept_check import NUM_NODES, Draws, check_intercepts, drawn_from, look_at
from webapp.analysis.links import Array, Link
from webapp.analysis.means import shapiro_wilk
from webapp.analysis.ordinal_likelihood import Problem, evaluate
from webapp.analysis.ordinal_mixed import OrdinalFit, fit_ordinal

CUTS = np.array([-1.5, -0.5, 0.5, 1.5])
PER_PERSON = 3


def people_of(num: int) -> NDArray[np.intp]:
    return np.repeat(np.arange(num), PER_PERSON)


def covariates(num: int) -> Array:
    return np.tile(np.eye(PER_PERSON)[:, 1:], (num, 1))


def fitted(intercepts: Array, rng: np.random.Generator, link: Link = "probit") -> OrdinalFit:
    people, x = people_of(len(intercepts)), covariates(len(intercepts))
    errors = rng.normal(size=len(people)) if link == "probit" else rng.logistic(size=len(people))
    ratings = 1 + np.searchsorted(CUTS, intercepts[people] + x @ [0.3, 0.6] + errors)
    return fit_ordinal(ratings, people, x, ["b", "c"], link=link)


def p_of(fit: OrdinalFit, seed: int = 0) -> float:
    num = fit.num_people
    return check_intercepts(fit, people_of(num), covariates(num), np.random.default_rng(seed)).p_value


@pytest.mark.parametrize("mean", [0.0, 1.6])
def test_a_true_model_is_rejected_about_as_often_as_the_level_says_also_at_the_end_of_the_scale(mean: float) -> None:
    rng = np.random.default_rng(5)
    fits = [fitted(rng.normal(mean, 0.75, 60), rng) for _ in range(60)]
    assert sum(p_of(fit) < 0.05 for fit in fits) <= 7  # Binomial: more have a chance of .02.


def test_the_table_for_normal_values_would_reject_true_models_at_the_end_of_the_scale() -> None:
    rng = np.random.default_rng(5)
    fits = [fitted(rng.normal(1.6, 0.75, 60), rng) for _ in range(20)]
    assert all(shapiro_wilk(fit.intercepts).p_value < 0.05 for fit in fits)


def test_two_camps_are_told_from_a_normal_distribution() -> None:
    rng = np.random.default_rng(2)
    fits = [fitted(rng.choice([-2.0, 2.0], 60) + rng.normal(0, 0.2, 60), rng) for _ in range(10)]
    assert sum(p_of(fit) < 0.05 for fit in fits) >= 9


@pytest.mark.parametrize("link", ["probit", "logit"])
def test_modes_and_gradient_of_each_draw_are_those_of_the_likelihood(link: Link) -> None:
    rng = np.random.default_rng(3)
    fit = fitted(rng.normal(0, 1, 12), rng, link)
    draws = drawn_from(fit, people_of(12), covariates(12), rng, 3)
    parameters = np.concatenate([fit.thresholds, fit.coefficients, [fit.sd]])
    modes, gradients = look_at(draws, parameters)
    for codes, mode, gradient in zip(draws.codes, modes, gradients, strict=True):
        there = evaluate(_problem(fit, draws, codes), parameters, np.zeros(12))
        assert mode == pytest.approx(there.modes, abs=1e-5)
        assert gradient == pytest.approx(there.gradient, abs=1e-4)


def _problem(fit: OrdinalFit, draws: Draws, codes: NDArray[np.intp]) -> Problem:
    total = len(fit.thresholds)
    upper, lower = np.where(codes < total, codes, total), np.where(codes > 0, codes - 1, total + 1)
    return Problem(upper, lower, total, draws.x, np.arange(12) * PER_PERSON, fit.link, num_nodes=NUM_NODES)


def test_the_order_of_the_ratings_changes_nothing() -> None:
    rng = np.random.default_rng(4)
    fit = fitted(rng.normal(0, 1, 20), rng)
    people, x = people_of(20), covariates(20)
    order = np.argsort(np.tile(np.arange(PER_PERSON), 20), kind="stable")
    there = check_intercepts(fit, people, x, np.random.default_rng(0))
    assert check_intercepts(fit, people[order], x[order], np.random.default_rng(0)) == there


def test_draws_that_are_looked_at_in_parts_are_all_counted() -> None:
    rng = np.random.default_rng(6)
    fit = fitted(rng.normal(0, 1, 600), rng)
    found = check_intercepts(fit, people_of(600), covariates(600), np.random.default_rng(0))
    assert found.num_draws == 99
    assert found.p_value * 100 == pytest.approx(round(found.p_value * 100))


def test_few_people_and_people_who_do_not_differ_are_not_tested() -> None:
    rng = np.random.default_rng(7)
    few = fitted(rng.normal(0, 1, 7), rng)
    with pytest.raises(Undefined, match="7 people are too few"):
        p_of(few)
    alike = fit_ordinal(np.tile([1, 2, 3], 10), people_of(10), np.empty((30, 0)), [])
    with pytest.raises(Undefined, match="do not vary"):
        check_intercepts(alike, people_of(10), np.empty((30, 0)), np.random.default_rng(0))


def test_rows_of_another_model_are_refused() -> None:
    rng = np.random.default_rng(8)
    fit = fitted(rng.normal(0, 1, 20), rng)
    with pytest.raises(ValueError, match="are not those of the model"):
        check_intercepts(fit, people_of(10), covariates(10), np.random.default_rng(0))
