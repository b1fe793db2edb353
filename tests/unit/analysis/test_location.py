import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from tests.unit.analysis.samples import BUDGET, exponential, reordered, run_on, samples
from webapp.analysis.censoring import Sample, Undefined
from webapp.analysis.location import Interval, interquartile_mean, iqm_interval, mean_of

SEEDS = st.integers(0, 2**32 - 1)
EXPONENTIAL_IQM = 0.738376
"""2 * the integral of -log(v) from 1/4 to 3/4."""


def interval_of(sample: Sample, seed: int, confidence: float = 0.95, num_resamples: int = 200) -> Interval:
    return iqm_interval(sample, np.random.default_rng(seed), confidence, num_resamples)


@given(st.lists(st.floats(0.01, 1e6), min_size=1, max_size=30))
def test_the_interquartile_mean_is_scipys_trimmed_mean(values: list[float]) -> None:
    assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25))


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([7], 7),
        ([9, 1], 5),
        ([1, 2, 9], 4),
        ([100, 2, 1, 4], 3),
        ([1, 2, 3, 7, 90], 4),
        ([0, 0, 3, 4, 5, 6, 99, 99], 4.5),
    ],
)
def test_the_interquartile_mean_drops_whole_values_only(values: list[float], expected: float) -> None:
    assert interquartile_mean(values) == expected


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], "an interquartile mean needs one row of one value or more, not of shape (0,)"),
        ([[1, 2], [3, 4]], "an interquartile mean needs one row of one value or more, not of shape (2, 2)"),
        ([1, np.inf], "an interquartile mean needs finite values, not inf"),
        ([1, np.nan], "an interquartile mean needs finite values, not nan"),
    ],
)
def test_an_interquartile_mean_of_no_finite_numbers_is_refused(values: ArrayLike, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        interquartile_mean(values)


@pytest.mark.parametrize(("num_stopped", "is_lower_bound"), [(0, False), (2, False), (3, True), (9, True)])
def test_of_nine_runs_two_may_be_stopped_before_the_interquartile_mean_is_unknown(
    num_stopped: int, *, is_lower_bound: bool
) -> None:
    sample = Sample.of(
        [5] * (9 - num_stopped) + [BUDGET] * num_stopped, [True] * (9 - num_stopped) + [False] * num_stopped
    )
    assert interval_of(sample, 0).is_lower_bound is is_lower_bound


@given(samples(min_size=2), SEEDS)
def test_the_flags_say_exactly_what_would_have_changed_without_a_budget(sample: Sample, seed: int) -> None:
    found, without = interval_of(sample, seed), interval_of(run_on(sample, 1e9), seed)
    assert found.value == pytest.approx(interquartile_mean(sample.values))
    assert found.is_lower_bound is (without.value > found.value)
    assert found.high_is_lower_bound is (without.high > found.high)
    assert without.low >= found.low
    assert not found.is_upper_bound
    assert not found.low_is_upper_bound


@given(samples(min_size=2), SEEDS)
def test_an_interval_does_not_depend_on_the_order_of_the_runs(sample: Sample, seed: int) -> None:
    assert interval_of(sample, seed) == interval_of(reordered(sample, np.random.default_rng(seed)), seed)


@given(samples(min_size=2), SEEDS)
def test_an_interval_scales_with_the_runs_and_widens_with_the_confidence(sample: Sample, seed: int) -> None:
    found = interval_of(sample, seed)
    doubled = interval_of(Sample.of(2 * sample.values, sample.observed), seed)
    wider = interval_of(sample, seed, confidence=0.98)
    assert (doubled.value, doubled.low, doubled.high) == (2 * found.value, 2 * found.low, 2 * found.high)
    assert wider.low <= found.low <= found.high <= wider.high


def test_a_bootstrap_interval_is_scipys_but_for_the_draws() -> None:
    sample = exponential(np.random.default_rng(1), 40)
    found = iqm_interval(sample, np.random.default_rng(2))
    expected = stats.bootstrap(
        (sample.values,), interquartile_mean_along, method="percentile", rng=np.random.default_rng(3)
    ).confidence_interval
    assert (found.low, found.high) == pytest.approx(tuple(expected), abs=0.02)


def interquartile_mean_along(values: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    means: NDArray[np.float64] = stats.trim_mean(values, 0.25, axis=axis)
    return means


def test_an_interval_contains_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(4)
    found = [iqm_interval(exponential(rng, 32), rng, num_resamples=400) for _ in range(400)]
    coverage = np.mean([interval.low <= EXPONENTIAL_IQM <= interval.high for interval in found])
    assert 0.9 <= coverage <= 0.98


def test_runs_that_are_all_stopped_have_the_budget_as_a_lower_bound_of_everything() -> None:
    found = interval_of(Sample.of([BUDGET] * 6, [False] * 6), 0)
    flags = {"is_lower_bound": True, "low_is_lower_bound": True, "high_is_lower_bound": True}
    assert found == Interval(BUDGET, BUDGET, BUDGET, **flags)


def test_an_interval_of_one_run_is_undefined() -> None:
    with pytest.raises(Undefined, match="how far runs scatter needs two runs or more, not 1"):
        interval_of(Sample.of([4]), 0)


def test_an_interval_of_runs_under_two_budgets_is_refused() -> None:
    with pytest.raises(ValueError, match="all runs must share one budget"):
        interval_of(Sample.of([4, 5, 6], [True, False, False]), 0)


@pytest.mark.parametrize("confidence", [0, 1, -0.5, 95, np.nan])
def test_a_confidence_that_is_none_is_refused(confidence: float) -> None:
    with pytest.raises(ValueError, match=f"the confidence must lie above 0 and below 1, not at {confidence}"):
        interval_of(Sample.of([4, 5]), 0, confidence=confidence)


@pytest.mark.parametrize(("confidence", "needed"), [(0.95, 40), (0.9, 20), (0.99, 200)])
def test_too_few_resamples_for_the_confidence_are_refused(confidence: float, needed: int) -> None:
    sample = Sample.of([4, 5])
    interval_of(sample, 0, confidence=confidence, num_resamples=needed)
    message = f"confidence {confidence} needs {needed} resamples or more, not {needed - 1}"
    with pytest.raises(ValueError, match=message):
        interval_of(sample, 0, confidence=confidence, num_resamples=needed - 1)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((np.nan, 1, 2), "an interval needs finite numbers, not nan in [1, 2]"),
        ((1, 1, np.inf), "an interval needs finite numbers, not 1 in [1, inf]"),
        (
            (1, 3, 2),
            "an interval's lower end must not exceed its upper end, and here is Interval(value=1, low=3, high=2",
        ),
    ],
)
def test_an_interval_that_is_none_is_refused(numbers: tuple[float, float, float], message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        Interval(*numbers)


@settings(max_examples=30)
@given(samples())
def test_a_mean_is_a_lower_bound_exactly_if_it_would_grow_without_a_budget(sample: Sample) -> None:
    mean, is_lower_bound = mean_of(sample)
    assert mean == pytest.approx(sum(sample.values.tolist()) / sample.size)
    assert is_lower_bound is (mean_of(run_on(sample, 1e9))[0] > mean)
