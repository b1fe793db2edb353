"""The cumulative link mixed model against R, against direct integration, and where it has no answer."""

import json
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from tests.conftest import ROOT
from webapp.analysis.censoring import Undefined
from webapp.analysis.links import Link, interval_chance
from webapp.analysis.ordinal_likelihood import Problem, evaluate
from webapp.analysis.ordinal_mixed import OrdinalFit, fit_ordinal

GOLDEN = ROOT / "tests" / "golden" / "analysis"
FROM_R: dict[str, Any] = json.loads((GOLDEN / "clmm.json").read_text(encoding="utf-8"))
RATINGS = pd.read_csv(GOLDEN / "ratings.csv")
WINE = pd.read_csv(GOLDEN / "wine.csv")
LINKS: tuple[Link, ...] = ("probit", "logit")
KINDS = ["kind random", "kind subgoals", "layout b", "layout c"]


def kinds_and_layouts(frame: pd.DataFrame) -> np.ndarray:
    columns = [frame["kind"] == "random", frame["kind"] == "subgoals", frame["layout"] == "b", frame["layout"] == "c"]
    return np.column_stack(columns).astype(float)


def fit_wine(link: Link) -> OrdinalFit:
    x = np.column_stack([WINE["temp"] == "warm", WINE["contact"] == "yes"]).astype(float)
    return fit_ordinal(WINE["rating"], WINE["judge"], x, ["temp warm", "contact yes"], link=link)


def fit_ratings(link: Link, num_nodes: int = 11) -> OrdinalFit:
    x = kinds_and_layouts(RATINGS)
    return fit_ordinal(RATINGS["rating"], RATINGS["person"], x, KINDS, link=link, num_nodes=num_nodes)


def as_r_has_it(fit: OrdinalFit, name: str) -> None:
    known = FROM_R[name]
    num_fixed = len(known["thresholds"]) + len(known["coefficients"])
    assert fit.thresholds == pytest.approx(known["thresholds"], rel=5e-5)
    assert fit.coefficients == pytest.approx(known["coefficients"], rel=1e-4)
    assert fit.sd == pytest.approx(known["sd"], rel=5e-5)
    assert fit.standard_errors[:num_fixed] == pytest.approx(known["standard_errors"], rel=5e-5)
    # The golden numbers are of 21 nodes, ours of 11.
    assert fit.log_likelihood == pytest.approx(known["log_likelihood"], abs=1e-4)


@pytest.mark.parametrize("link", LINKS)
def test_the_wine_data_give_what_ordinal_clmm_gives(link: Link) -> None:
    as_r_has_it(fit_wine(link), f"wine {link}")


@pytest.mark.parametrize("link", LINKS)
def test_unbalanced_ratings_give_what_ordinal_clmm_gives(link: Link) -> None:
    as_r_has_it(fit_ratings(link), f"ratings {link}")


def test_people_who_seem_alike_at_first_are_no_place_to_stop() -> None:
    """At an SD of 0 the slope in the SD is 0; in these ratings that is a saddle, and the maximum lies elsewhere."""
    frame = pd.read_csv(GOLDEN / "saddle.csv")
    levels = [("kind", "b"), ("kind", "c"), ("layout", "l1"), ("layout", "l2")]
    x = np.column_stack([frame[factor] == level for factor, level in levels]).astype(float)
    fit = fit_ordinal(frame["rating"], frame["participant"], x, [" ".join(level) for level in levels])
    assert fit.sd > 0.3
    as_r_has_it(fit, "saddle probit")


def test_people_who_differ_much_get_more_nodes() -> None:
    rng = np.random.default_rng(8)
    people, late = np.repeat(np.arange(60), 3), np.tile([0.0, 1.0, 0.0], 60)
    right = (rng.normal(0, 4, 60)[people] + 1.5 * late + rng.logistic(size=180) > 0.3).astype(int)
    fit = fit_ordinal(right, people, late[:, None], ["late"], link="logit")
    assert fit.num_nodes > 22
    fine = fit_ordinal(right, people, late[:, None], ["late"], link="logit", num_nodes=101)
    assert fit.coefficients == pytest.approx(fine.coefficients, abs=2e-3 * float(fine.standard_errors[1]))
    assert fit.standard_errors == pytest.approx(fine.standard_errors, rel=5e-3)


def test_two_categories_give_what_lme4_glmer_gives() -> None:
    high = (RATINGS["rating"] >= 4).astype(int)
    fit = fit_ordinal(high, RATINGS["person"], kinds_and_layouts(RATINGS), KINDS, link="logit", num_nodes=21)
    known = FROM_R["binary logit"]
    assert fit.thresholds == pytest.approx(known["thresholds"], rel=1e-4)
    assert fit.coefficients == pytest.approx(known["coefficients"], rel=1e-4)
    assert fit.sd == pytest.approx(known["sd"], rel=1e-4)
    assert fit.standard_errors[:5] == pytest.approx(known["standard_errors"], rel=1e-4)
    assert fit.log_likelihood == pytest.approx(known["log_likelihood"], abs=1e-6)


def small_problem(link: Link) -> Problem:
    upper, lower = np.array([0, 1, 3, 2, 3, 0, 3]), np.array([4, 0, 2, 1, 2, 4, 2])
    x = np.array([[0.0], [1.0], [1.0], [0.0], [1.0], [0.0], [0.5]])
    return Problem(upper, lower, 3, x, np.array([0, 3, 5]), link, 31)


PLACE = np.array([-0.8, 0.3, 1.4, 0.6, 1.2])


@pytest.mark.parametrize("link", LINKS)
def test_the_likelihood_is_the_integral_over_every_person_s_intercept(link: Link) -> None:
    problem = small_problem(link)
    cumulative = stats.norm.cdf if link == "probit" else stats.logistic.cdf
    thresholds = np.array([*PLACE[:3], np.inf, -np.inf])

    def of_person(intercept: float, rows: slice) -> float:
        shift = problem.x[rows, 0] * PLACE[3] + PLACE[4] * intercept
        ends = cumulative(thresholds[problem.upper[rows]] - shift), cumulative(thresholds[problem.lower[rows]] - shift)
        return float(np.prod(ends[0] - ends[1]) * stats.norm.pdf(intercept))

    rows = (slice(0, 3), slice(3, 5), slice(5, 7))
    direct = sum(np.log(integrate.quad(of_person, -12, 12, args=(of,), epsabs=1e-13)[0]) for of in rows)
    assert evaluate(problem, PLACE, np.zeros(3)).value == pytest.approx(direct, abs=1e-9)


@pytest.mark.parametrize("link", LINKS)
def test_gradient_and_hessian_are_those_of_the_likelihood(link: Link) -> None:
    problem, step = small_problem(link), 1e-5
    here = evaluate(problem, PLACE, np.zeros(3))
    for place, unit in enumerate(np.eye(5)):
        ahead, behind = (evaluate(problem, PLACE + sign * step * unit, here.modes) for sign in (1, -1))
        assert here.gradient[place] == pytest.approx((ahead.value - behind.value) / (2 * step), abs=1e-6)
        assert here.hessian[place] == pytest.approx((ahead.gradient - behind.gradient) / (2 * step), abs=1e-5)


@pytest.mark.parametrize("link", LINKS)
@given(lower=st.floats(-40, 40), width=st.floats(0.01, 5))
def test_chances_of_intervals_keep_their_digits_far_out(link: Link, lower: float, width: float) -> None:
    distribution = stats.norm if link == "probit" else stats.logistic
    far = -abs(lower) - width, -abs(lower)  # In the lower tail, where differences are exact.
    expected = np.log(max(distribution.cdf(far[1]) - distribution.cdf(far[0]), 1e-300))
    for ends in (far, (-far[1], -far[0])):
        found = interval_chance(np.array([ends[1]]), np.array([ends[0]]), link)
        assert found.log[0] == pytest.approx(expected, rel=1e-6, abs=1e-9)
        assert np.all(np.isfinite([found.by_upper, found.by_lower, found.upper_upper, found.lower_lower]))


def test_more_nodes_change_nothing_that_is_reported() -> None:
    few, many = fit_ratings("probit", 11), fit_ratings("probit", 41)
    assert few.coefficients == pytest.approx(many.coefficients, abs=1e-6)
    assert few.standard_errors == pytest.approx(many.standard_errors, abs=1e-6)


@settings(deadline=None, max_examples=20)
@given(st.randoms(use_true_random=False))
def test_neither_order_of_rows_nor_names_of_people_nor_labels_of_categories_matter(chance: Any) -> None:  # noqa: ANN401
    order = list(range(len(RATINGS)))
    chance.shuffle(order)
    mixed = RATINGS.iloc[order]
    people = list(RATINGS["person"].unique())
    names = {person: f"p{place}" for place, person in enumerate(chance.sample(people, len(people)))}
    spread = mixed["rating"] * 10  # Only the order of categories counts.
    fit = fit_ordinal(spread, mixed["person"].map(names), kinds_and_layouts(mixed), KINDS)
    known = fit_ratings("probit")
    assert fit.coefficients == pytest.approx(known.coefficients, abs=1e-5)
    assert fit.log_likelihood == pytest.approx(known.log_likelihood, abs=1e-8)


def test_turning_the_scale_around_turns_the_effects_around() -> None:
    turned = fit_ordinal(6 - RATINGS["rating"], RATINGS["person"], kinds_and_layouts(RATINGS), KINDS)
    known = fit_ratings("probit")
    assert turned.coefficients == pytest.approx(-known.coefficients, abs=1e-5)
    assert turned.thresholds == pytest.approx(-known.thresholds[::-1], abs=1e-5)


def test_people_who_do_not_differ_get_a_standard_deviation_of_zero() -> None:
    people, x = np.repeat(np.arange(20), 4), np.tile([0.0, 0.0, 1.0, 1.0], 20)[:, None]
    ratings = np.tile([1, 3, 2, 4], 20)  # Every person's ratings are the same set, so people vary less than by chance.
    fit = fit_ordinal(ratings, people, x, ["late"])
    assert fit.sd == pytest.approx(0, abs=1e-3)
    assert np.all(np.isfinite(fit.standard_errors))


def test_one_rating_each_is_a_model_without_differences_between_people() -> None:
    frame = RATINGS.drop_duplicates("person")
    x = (frame["kind"] == "subgoals").to_numpy(float)[:, None]
    fit = fit_ordinal(frame["rating"], frame["person"], x, ["kind subgoals"])
    assert not fit.has_person_effect
    assert fit.sd == 0
    assert fit.num_parameters == len(fit.thresholds) + 1


def test_standardized_effects_are_in_standard_deviations_of_the_latent_rating() -> None:
    fit = fit_ratings("probit")
    value, error = fit.standardized([0, 1, 0, 0])
    assert value == pytest.approx(fit.coefficients[1] / np.sqrt(1 + fit.sd**2))
    step = 1e-6
    numeric = [  # The delta method by differences of the parameters that it depends on.
        (fit.coefficients[1] + step) / np.sqrt(1 + fit.sd**2) - value,
        fit.coefficients[1] / np.sqrt(1 + (fit.sd + step) ** 2) - value,
    ]
    gradient = np.array(numeric) / step
    places = [len(fit.thresholds) + 1, -1]
    assert error == pytest.approx(np.sqrt(gradient @ fit.covariance[np.ix_(places, places)] @ gradient), rel=1e-4)


@pytest.mark.parametrize(
    ("ratings", "people", "x", "told"),
    [
        ([3, 3, 3, 3], [1, 1, 2, 2], [0, 1, 0, 1], "all 4 ratings are 3"),
        ([1, 2, 3, 4], [7, 7, 7, 7], [0, 1, 0, 1], "all 4 ratings are of one person"),
        ([], [], [], "there are no ratings"),
        ([1, 2, 3, 4], [1, 1, 2, 2], [1, 1, 1, 1], "the effects of late cannot be told apart"),
        ([1, 2, 5, 5, 2, 1, 5, 5, 1, 2, 5, 5], [1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3], [0, 0, 1, 1] * 3, "late has no f"),
        ([1, 1, 5, 5, 1, 1, 5, 5], [1, 1, 2, 2, 3, 3, 4, 4], [0, 1] * 4, "people differ without bound"),
    ],
)
def test_what_the_ratings_do_not_determine_is_said(
    ratings: list[int], people: list[int], x: list[float], told: str
) -> None:
    with pytest.raises(Undefined, match=told):
        fit_ordinal(ratings, people, np.array(x, dtype=float).reshape(-1, 1), ["late"])


def test_arguments_that_do_not_fit_together_are_a_mistake() -> None:
    with pytest.raises(ValueError, match="need as many people"):
        fit_ordinal([1, 2], [1], [[0.0], [1.0]], ["late"])


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.tuples(st.integers(1, 5), st.integers(0, 4), st.booleans()), min_size=1, max_size=25),
    st.sampled_from(LINKS),
)
def test_whatever_the_ratings_there_is_a_finite_model_or_a_reason(
    rows: list[tuple[int, int, bool]], link: Link
) -> None:
    ratings, people, late = zip(*rows, strict=True)
    try:
        fit = fit_ordinal(ratings, people, np.array(late, dtype=float)[:, None], ["late"], link=link)
    except Undefined:
        return
    assert np.all(np.isfinite([*fit.thresholds, *fit.coefficients, fit.sd, fit.log_likelihood, *fit.standard_errors]))
    assert np.all(np.diff(fit.thresholds) > 0)
    assert fit.log_likelihood <= 0
