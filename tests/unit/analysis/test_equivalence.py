import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.analysis.samples import BUDGET, exponential, reordered, run_on, samples
from webapp.analysis.censoring import Sample, Undefined
from webapp.analysis.equivalence import is_equivalent, ratio_interval
from webapp.analysis.location import Interval, interquartile_mean

SEEDS = st.integers(0, 2**32 - 1)
FLAGS = ("is_lower_bound", "high_is_lower_bound", "is_upper_bound", "low_is_upper_bound")


def ratio_of(a: Sample, b: Sample, seed: int = 0) -> Interval:
    return ratio_interval(a, b, np.random.default_rng(seed), num_resamples=200)


@given(samples(min_size=2), samples(min_size=2), SEEDS)
def test_the_flags_of_a_ratio_say_exactly_what_would_have_changed_without_a_budget(
    a: Sample, b: Sample, seed: int
) -> None:
    found = ratio_of(a, b, seed)
    assert found.value == pytest.approx(interquartile_mean(a.values) / interquartile_mean(b.values))
    # Stopped runs of the other group stay at the budget, where the ratio has them.
    larger = ratio_of(run_on(a, 1e9), run_on(b, BUDGET), seed)
    smaller = ratio_of(run_on(a, BUDGET), run_on(b, 1e9), seed)
    assert found.is_lower_bound is (larger.value > found.value)
    assert found.high_is_lower_bound is (larger.high > found.high)
    assert found.is_upper_bound is (smaller.value < found.value)
    assert found.low_is_upper_bound is (smaller.low < found.low)


@given(samples(min_size=2), samples(min_size=2), SEEDS)
def test_a_ratio_does_not_depend_on_the_order_of_the_runs_or_the_unit(a: Sample, b: Sample, seed: int) -> None:
    found, rng = ratio_of(a, b, seed), np.random.default_rng(seed)
    assert ratio_of(reordered(a, rng), reordered(b, rng), seed) == found
    assert ratio_of(Sample.of(4 * a.values, a.observed), Sample.of(4 * b.values, b.observed), seed) == found


def test_the_interval_of_a_ratio_contains_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(6)
    found = [
        ratio_interval(exponential(rng, 32), exponential(rng, 32, mean=0.5), rng, num_resamples=300) for _ in range(300)
    ]
    coverage = np.mean([interval.low <= 2 <= interval.high for interval in found])
    assert 0.84 <= coverage <= 0.95


def test_groups_at_the_edge_of_the_margin_are_rarely_called_equivalent() -> None:
    rng = np.random.default_rng(7)
    found = [
        ratio_interval(exponential(rng, 200, mean=1.5), exponential(rng, 200), rng, num_resamples=200)
        for _ in range(150)
    ]
    assert np.mean([is_equivalent(interval, margin=0.5) for interval in found]) <= 0.1


def test_large_groups_that_are_alike_are_called_equivalent() -> None:
    rng = np.random.default_rng(8)
    a, b = exponential(rng, 2000), exponential(rng, 2000)
    assert is_equivalent(ratio_of(a, b), margin=0.2)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.8, 1.25, True),
        (0.79, 1.25, False),
        (0.8, 1.26, False),
        (0.9, 1.1, True),
        (1.3, 1.4, False),
        (0.5, 0.6, False),
    ],
)
def test_the_whole_interval_must_lie_within_the_margin(low: float, high: float, *, expected: bool) -> None:
    assert is_equivalent(Interval(1, low, high), margin=0.25) is expected


@given(st.floats(0.2, 5), st.floats(1, 3), st.floats(0.01, 2))
def test_equivalence_does_not_depend_on_which_group_is_divided_by(low: float, width: float, margin: float) -> None:
    interval = Interval(low, low, low * width)
    inverse = Interval(1 / low, 1 / interval.high, 1 / low)
    edges = (interval.low * (1 + margin), interval.high / (1 + margin))
    if not any(math.isclose(edge, 1, rel_tol=1e-9) for edge in edges):
        assert is_equivalent(interval, margin) is is_equivalent(inverse, margin)


@pytest.mark.parametrize("flag", FLAGS)
def test_a_ratio_that_stopped_runs_leave_unknown_is_never_equivalent(flag: str) -> None:
    assert is_equivalent(Interval(1, 1, 1), margin=0.5)
    assert not is_equivalent(Interval(1, 1, 1, **{flag: True}), margin=0.5)


def test_groups_that_never_arrive_are_not_called_equivalent() -> None:
    stopped = Sample.of([BUDGET] * 8, [False] * 8)
    found = ratio_of(stopped, stopped)
    assert (found.value, found.low, found.high) == (1, 1, 1)
    assert all(getattr(found, flag) for flag in FLAGS)
    assert not is_equivalent(found, margin=0.5)


@pytest.mark.parametrize("margin", [0, -0.1, math.inf, math.nan])
def test_a_margin_that_is_none_is_refused(margin: float) -> None:
    with pytest.raises(ValueError, match=f"a margin must be above 0 and finite, not {margin}"):
        is_equivalent(Interval(1, 1, 1), margin)


def test_a_ratio_with_one_run_is_undefined() -> None:
    for pair in ((Sample.of([4]), Sample.of([4, 5])), (Sample.of([4, 5]), Sample.of([4]))):
        with pytest.raises(Undefined, match="how far runs scatter needs two runs or more, not 1"):
            ratio_of(*pair)


def test_a_ratio_of_groups_under_different_budgets_is_refused() -> None:
    with pytest.raises(ValueError, match="all runs must share one budget"):
        ratio_of(Sample.of([4, 9], [True, False]), Sample.of([4, 8], [True, False]))
