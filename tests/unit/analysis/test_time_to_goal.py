import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.proportional_hazards import Journeys, check_proportionality, fit_hazards
from webapp.analysis.time_to_goal import arrival_curve, median_interval, median_time, restricted

FOLDER = Path(__file__).parents[2] / "golden" / "analysis"
GOLDEN: dict[str, Any] = json.loads((FOLDER / "survival.json").read_text())
DATA = pd.read_csv(FOLDER / "survival.csv")
X = np.column_stack([DATA["kind"] == "b", DATA["kind"] == "c", DATA["position"]]).astype(float)


def journeys(**changes: NDArray[Any]) -> Journeys:
    kept = {
        "times": DATA["time"].to_numpy(),
        "arrived": DATA["arrived"].to_numpy() == 1,
        "people": DATA["person"].to_numpy(),
        "strata": DATA["layout"].to_numpy(),
    }
    return Journeys(**(kept | changes))


def test_the_stratified_model_with_errors_by_person_is_rs() -> None:
    found = fit_hazards(journeys(), X, ["b", "c", "position"])
    assert found.coefficients == pytest.approx(GOLDEN["coefficients"], rel=1e-8)
    uncorrected = found.covariance * (found.num_people - len(found.names) - 1) / found.num_people
    assert np.sqrt(np.diag(uncorrected)) == pytest.approx(GOLDEN["robust_errors"], rel=1e-8)
    assert found.df == found.num_people - 1
    assert np.sqrt(np.diag(found.information_inverse)) == pytest.approx(GOLDEN["naive_errors"], rel=1e-8)
    assert found.log_likelihood == pytest.approx(GOLDEN["log_likelihood"], rel=1e-10)
    assert (found.residuals**2).sum(axis=0) == pytest.approx(GOLDEN["schoenfeld_sums_of_squares"], rel=1e-8)
    assert check_proportionality(found, [0, 1]).statistic == pytest.approx(GOLDEN["proportionality"], rel=1e-7)


def test_estimates_with_ties_are_those_of_statsmodels() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from statsmodels.duration.hazard_regression import PHReg  # noqa: PLC0415 - takes a second to load.

        theirs = PHReg(DATA["time"], X, DATA["arrived"], strata=DATA["layout"], ties="efron").fit()
    ours = fit_hazards(journeys(), X, ["b", "c", "position"])
    assert ours.coefficients == pytest.approx(theirs.params, rel=1e-5)
    assert np.sqrt(np.diag(ours.information_inverse)) == pytest.approx(theirs.bse, rel=1e-5)


def test_without_ties_a_model_with_one_binary_column_solves_the_partial_score_equation() -> None:
    found = fit_hazards(
        Journeys(np.array([1.0, 2, 3, 4]), np.ones(4, dtype=bool), np.arange(4), np.zeros(4, dtype=np.int64)),
        np.array([[1.0], [0.0], [1.0], [0.0]]),
        ["x"],
    )
    ratio = np.exp(found.coefficients[0])
    expected = 2 * ratio / (2 * ratio + 2) + ratio / (ratio + 2) + ratio / (ratio + 1)
    assert expected == pytest.approx(2.0)


@given(st.integers(0, 10_000))
@settings(max_examples=20)
def test_order_and_unit_of_time_do_not_matter(seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(DATA))
    changed = Journeys(
        DATA["time"].to_numpy()[order] * 7,
        DATA["arrived"].to_numpy()[order] == 1,
        DATA["person"].to_numpy()[order],
        DATA["layout"].to_numpy()[order],
    )
    ours, theirs = fit_hazards(journeys(), X, "bcp"), fit_hazards(changed, X[order], "bcp")
    assert ours.coefficients == pytest.approx(theirs.coefficients, abs=1e-8)
    assert ours.covariance == pytest.approx(theirs.covariance, abs=1e-8)


def test_hazards_that_change_over_time_are_noticed() -> None:
    rng = np.random.default_rng(5)
    group = np.repeat([0.0, 1.0], 150)
    times = np.where(group == 1, rng.weibull(4, 300), rng.weibull(0.7, 300)) + 0.01
    mixed = Journeys(times, np.ones(300, dtype=bool), np.arange(300), np.zeros(300, dtype=np.int64))
    assert check_proportionality(fit_hazards(mixed, group[:, None], ["x"]), [0]).p_value < 1e-4


def test_robust_errors_cover_where_people_repeat_themselves() -> None:
    rng = np.random.default_rng(11)
    robust = naive = 0
    for _ in range(80):
        people = np.repeat(np.arange(60), 4)
        group = (people % 2).astype(float)
        times = np.ceil(10 * rng.exponential(size=240) * np.repeat(np.exp(rng.normal(0, 1, 60)), 4)) / 10
        found = fit_hazards(Journeys(times, times < 4, people, np.zeros(240, dtype=np.int64)), group[:, None], ["x"])
        value, error = found.estimate([1.0])
        robust += abs(value) < 1.96 * error
        naive += abs(value) < 1.96 * float(np.sqrt(found.information_inverse[0, 0]))
    assert robust / 80 > 0.88
    assert naive < robust


@pytest.mark.parametrize("num_people", [12, 20])
def test_with_few_people_tests_of_three_kinds_err_no_more_than_they_say(num_people: int) -> None:
    rng = np.random.default_rng(12)
    corrected = plain = 0
    for _ in range(150):
        people = np.repeat(np.arange(num_people), 3)
        kinds = rng.permuted(np.tile(np.arange(3), (num_people, 1)), axis=1).ravel()
        x = np.column_stack([kinds == 1, kinds == 2, np.tile([0, 1, 0], num_people), np.tile([0, 0, 1], num_people)])
        frailty = np.repeat(np.exp(rng.normal(0, 0.6, num_people)), 3)
        times = 1 + np.floor(8 * rng.exponential(size=people.size) / frailty) / 8
        strata = rng.permuted(np.tile(np.arange(3), (num_people, 1)), axis=1).ravel()
        found = fit_hazards(Journeys(times, times < 2.6, people, strata), x.astype(float), "bcpq")
        for weights in ([1, 0, 0, 0], [0, 1, 0, 0], [1, -1, 0, 0]):
            value, error = found.estimate(weights)
            corrected += abs(value) > stats.t.ppf(0.975, found.df) * error
            plain += abs(value) > 1.96 * error * np.sqrt((num_people - 5) / num_people)
    assert corrected / 450 < 0.07
    assert plain / 450 > 0.07


def test_errors_within_persons_need_more_people_than_effects() -> None:
    few = DATA["person"].to_numpy() <= 4
    made = Journeys(
        *(each[few] for each in (journeys().times, journeys().arrived, journeys().people, journeys().strata))
    )
    with pytest.raises(Undefined, match="there are 4 people and 3 effects"):
        fit_hazards(made, X[few], "bcp")


def test_an_effect_without_bound_is_said_to_be_one() -> None:
    times = np.concatenate([np.full(10, 1.0), np.full(10, 5.0)])
    arrived = np.repeat([True, False], 10)
    found = Journeys(times, arrived, np.arange(20), np.zeros(20, dtype=np.int64))
    with pytest.raises(Undefined, match="the hazard ratio of late is without bound"):
        fit_hazards(found, np.repeat([0.0, 1.0], 10)[:, None], ["late"])


@pytest.mark.parametrize(
    ("changes", "x", "message"),
    [
        ({"arrived": np.zeros(len(DATA), dtype=bool)}, X, "there are 0 arrivals of 40 people"),
        ({"people": np.zeros(len(DATA), dtype=np.int64)}, X, "arrivals of 1 people"),
        ({}, X[:, [0, 0]], "within strata only 1 of 2 effects can be told apart"),
        ({}, np.asarray(DATA["layout"], dtype=float)[:, None], "within strata only 0 of 1 effects can be told apart"),
    ],
)
def test_what_journeys_do_not_determine_is_said(
    changes: dict[str, NDArray[Any]], x: NDArray[np.float64], message: str
) -> None:
    with pytest.raises(Undefined, match=message):
        fit_hazards(journeys(**changes), x, [str(place) for place in range(x.shape[1])])


def test_a_trend_needs_three_times() -> None:
    found = Journeys(np.array([1.0, 2, 1, 2]), np.ones(4, dtype=bool), np.arange(4), np.zeros(4, dtype=np.int64))
    with pytest.raises(Undefined, match="a trend over time needs three times of arrival, and there are 2"):
        check_proportionality(fit_hazards(found, np.array([[0.0], [1.0], [1.0], [0.0]]), ["x"]), [0])


@pytest.mark.parametrize("wrong", [{"times": np.zeros(len(DATA))}, {"people": np.zeros(3, dtype=np.int64)}])
def test_journeys_that_do_not_fit_together_are_refused(wrong: dict[str, NDArray[Any]]) -> None:
    with pytest.raises(ValueError, match=r"a time must be finite|journeys need four rows"):
        journeys(**wrong)


def test_the_curve_of_arrivals_is_one_less_kaplan_meiers() -> None:
    of_a = DATA[DATA["kind"] == "a"]
    times, shares = arrival_curve(of_a["time"], of_a["arrived"] == 1)
    assert times[1:] == pytest.approx(GOLDEN["curve_times"][: times.size - 1], rel=1e-9)
    assert shares[1:] == pytest.approx(GOLDEN["curve_arrived"][: times.size - 1], rel=1e-9)


@given(st.lists(st.tuples(st.integers(1, 30), st.booleans()), min_size=1, max_size=30), st.integers(1, 40))
def test_the_restricted_mean_is_the_area_above_the_curve(ends: list[tuple[int, bool]], horizon: int) -> None:
    times, arrived = (np.array(side) for side in zip(*ends, strict=True))
    moments, shares = arrival_curve(times, arrived)
    cut = np.minimum(np.append(moments, horizon), horizon)
    area = float((np.diff(cut) * (1 - shares)).sum()) if horizon >= moments[-1] else None
    mean = restricted(times, arrived, horizon).mean()
    if area is not None:
        assert mean == pytest.approx(area)
    assert mean <= horizon


def test_the_median_is_none_where_fewer_than_half_arrive() -> None:
    assert median_time([1, 2, 3, 9], [True, True, True, False]) == 2
    assert median_time([1, 9, 9], [True, False, False]) is None


def test_the_interval_of_the_median_covers_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(7)
    hits = 0
    for _ in range(200):
        # Each person has two drives, of which the second is a little like the first.
        times = np.exp(np.repeat(rng.normal(0, 0.5, 30), 2) + rng.normal(0, 1, 60))
        people = [f"p{number}" for number in np.repeat(np.arange(30), 2)]
        found = median_interval(people, times, times < 6, rng, 300)
        assert found is not None
        low, high = found
        assert low is not None
        hits += low <= 1 and (high is None or high >= 1)
    assert 182 <= hits <= 199


def test_the_interval_of_the_median_is_open_where_half_may_never_arrive() -> None:
    people, times = [f"p{number}" for number in range(12)], np.arange(1.0, 13)
    found = median_interval(people, times, times <= 7, np.random.default_rng(1))
    assert found is not None
    assert found[0] is not None
    assert found[1] is None
    assert median_interval(people, times, times > 99, np.random.default_rng(1)) == (None, None)
    assert median_interval(people[:5], times[:5], times[:5] > 0, np.random.default_rng(1)) is None


def test_no_journey_has_no_curve() -> None:
    with pytest.raises(Undefined, match="a share needs a journey"):
        arrival_curve([], [])
    with pytest.raises(ValueError, match="the horizon must be above 0"):
        restricted([1], [True], 0)
