import re
from collections.abc import Callable
from fractions import Fraction
from itertools import combinations
from math import sqrt

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from tests.unit.analysis.samples import (
    BUDGET,
    exponential,
    reordered,
    samples,
    with_one_run_stopped,
)
from webapp.analysis import two_samples
from webapp.analysis.censoring import Sample, Undefined
from webapp.analysis.location import Interval
from webapp.analysis.two_samples import log_rank, mann_whitney, probability_of_improvement, student_t, welch_t

Compare = Callable[[Sample, Sample], two_samples.TestResult]
T_TESTS = pytest.mark.parametrize("t_test", [student_t, welch_t])
SEEDS = st.integers(0, 2**32 - 1)

# The extra hours of sleep in Student 1908, as R's data set `sleep` has them, and two more each, since runs are above 0.
SLEEP_A = Sample.of(np.array([0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]) + 2)
SLEEP_B = Sample.of(np.array([1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]) + 2)


def improvement(a: Sample, b: Sample, seed: int = 0) -> Interval:
    return probability_of_improvement(a, b, np.random.default_rng(seed), num_resamples=200)


def num_better_pairs(a: Sample, b: Sample) -> Fraction:
    """Count the pairs in which the run of `a` is the faster one, ties half, by looking at each."""
    count = Fraction(0)
    for value, arrived in zip(a.values, a.observed, strict=True):
        for other, other_arrived in zip(b.values, b.observed, strict=True):
            if arrived and (not other_arrived or value < other):
                count += 1
            elif arrived == other_arrived and (not arrived or value == other):
                count += Fraction(1, 2)
    return count


def varies(a: Sample, b: Sample) -> bool:
    return bool(np.ptp(a.values) > 0 or np.ptp(b.values) > 0)


def decides(a: Sample, b: Sample) -> bool:
    """Whether at some time runs of both groups are on and some of these, not all, arrive."""
    arrivals = np.unique([*a.values[a.observed], *b.values[b.observed]])
    both = [time for time in arrivals if (a.values >= time).any() and (b.values >= time).any()]
    return any(
        ((a.values > time) | ((a.values == time) & ~a.observed)).any()
        or ((b.values > time) | ((b.values == time) & ~b.observed)).any()
        for time in both
    )


def test_the_t_tests_find_what_r_finds_in_students_data() -> None:
    equal, unequal = student_t(SLEEP_A, SLEEP_B), welch_t(SLEEP_A, SLEEP_B)
    assert (equal.statistic, equal.p_value) == pytest.approx((-1.8608, 0.07919), rel=1e-4)
    assert equal.degrees_of_freedom == 18
    assert (unequal.statistic, unequal.p_value) == pytest.approx((-1.8608, 0.07939), rel=1e-4)
    assert unequal.degrees_of_freedom == pytest.approx(17.776, rel=1e-4)


@T_TESTS
@given(samples(min_size=2), samples(min_size=2))
def test_a_t_test_is_scipys_on_samples_that_vary(t_test: Compare, a: Sample, b: Sample) -> None:
    assume(np.ptp(a.values) > 0 and np.ptp(b.values) > 0)
    found = t_test(a, b)
    expected = stats.ttest_ind(a.values, b.values, equal_var=t_test is student_t)
    assert found.statistic == pytest.approx(expected.statistic)
    assert found.p_value == pytest.approx(expected.pvalue)
    assert found.degrees_of_freedom == pytest.approx(expected.df)


def test_a_t_test_copes_with_a_group_that_was_stopped_altogether() -> None:
    a, b = Sample.of([10, 20, 30]), Sample.of([30] * 3, [False] * 3)
    equal, unequal = student_t(a, b), welch_t(a, b)
    # The variances are 100 and 0: the squared error is 50 * (1/3 + 1/3) in one test and 100/3 + 0 in the other.
    assert (equal.statistic, unequal.statistic) == pytest.approx((-sqrt(3), -sqrt(3)))
    assert (equal.degrees_of_freedom, unequal.degrees_of_freedom) == pytest.approx((4, 2))
    assert equal.note == "0 of 3 and 3 of 3 runs were stopped and enter at the budget"
    assert student_t(a, a).note == ""


@T_TESTS
def test_a_t_test_with_one_run_is_undefined(t_test: Compare) -> None:
    for pair in ((Sample.of([5]), Sample.of([5, 6])), (Sample.of([5, 6]), Sample.of([5]))):
        with pytest.raises(Undefined, match="how far runs scatter needs two runs or more, not 1"):
            t_test(*pair)


@pytest.mark.parametrize("value", [0.1, 7])
@T_TESTS
def test_a_t_test_without_scatter_is_undefined(t_test: Compare, value: float) -> None:
    message = rf"t test needs values that vary, not only {float(value)} in one and 9\.0 in the other"
    with pytest.raises(Undefined, match=message):
        t_test(Sample.of([value] * 3), Sample.of([9] * 3))


@settings(max_examples=20)
@given(st.permutations(range(1, 8)), st.integers(1, 6))
def test_the_exact_rank_test_is_the_share_of_ways_to_deal_the_runs_out_that_are_as_extreme(
    values: list[int], size: int
) -> None:
    a, b = Sample.of(values[:size]), Sample.of(values[size:])
    found = mann_whitney(a, b)
    sums = np.array([sum(dealt) for dealt in combinations(values, size)])
    centre = size * 8 / 2
    assert found.note == "exact"
    assert found.p_value == pytest.approx(np.mean(abs(sums - centre) >= abs(sum(values[:size]) - centre)))


@given(samples(max_size=20), samples(max_size=20))
def test_the_rank_test_is_scipys_automatic_choice_on_numbers_that_have_the_runs_order(a: Sample, b: Sample) -> None:
    found = mann_whitney(a, b)
    order = [np.where(sample.observed, sample.values, BUDGET + 1) for sample in (a, b)]
    expected = stats.mannwhitneyu(*order)
    assert (found.statistic, found.p_value) == pytest.approx((expected.statistic, expected.pvalue))
    tied = len({*order[0], *order[1]}) < a.size + b.size
    assert ("ties" in found.note) == tied
    assert (found.note == "exact") == (not tied and min(a.size, b.size) <= 8)


def test_large_samples_without_ties_are_compared_by_the_normal_approximation() -> None:
    rng = np.random.default_rng(0)
    a, b = exponential(rng, 9), exponential(rng, 9)
    assert mann_whitney(a, b).note == "normal approximation"
    assert mann_whitney(a, b).p_value == pytest.approx(stats.mannwhitneyu(a.values, b.values).pvalue)


@pytest.mark.parametrize("observed", [True, False])
@pytest.mark.parametrize("size", [1, 2, 20])
def test_runs_that_all_tie_do_not_differ_in_rank(size: int, *, observed: bool) -> None:
    same = Sample.of([BUDGET] * size, [observed] * size)
    assert mann_whitney(same, same).p_value == 1
    assert mann_whitney(same, same).statistic == size**2 / 2


def test_a_stopped_run_ranks_above_one_that_took_the_whole_budget() -> None:
    arrived, stopped = Sample.of([BUDGET] * 3), Sample.of([BUDGET] * 3, [False] * 3)
    assert mann_whitney(arrived, stopped).statistic == 0
    assert improvement(arrived, stopped).value == 1
    assert improvement(stopped, arrived).value == 0
    assert improvement(stopped, stopped).value == 0.5


@given(samples(), samples(), SEEDS)
def test_only_the_order_of_the_episodes_matters_to_ranks(a: Sample, b: Sample, seed: int) -> None:
    slow_a, slow_b = (Sample.of(np.exp(sample.values / 5), sample.observed) for sample in (a, b))
    assert mann_whitney(slow_a, slow_b) == mann_whitney(a, b)
    if min(a.size, b.size) > 1:
        assert improvement(slow_a, slow_b, seed) == improvement(a, b, seed)


@given(samples(), samples(), st.integers(0, 11))
def test_a_run_that_is_stopped_never_makes_its_group_look_faster(a: Sample, b: Sample, run: int) -> None:
    worse = with_one_run_stopped(a, run % a.size)
    assert mann_whitney(worse, b).statistic >= mann_whitney(a, b).statistic
    if min(a.size, b.size) > 1:
        assert improvement(worse, b).value <= improvement(a, b).value


def test_the_log_rank_test_is_right_for_tables_worked_out_by_hand() -> None:
    spread = log_rank(Sample.of([1, 3, 5], [True, True, False]), Sample.of([2, 5, 5], [True, False, False]))
    # At 1, 2, 3 one arrives of 3 + 3, 2 + 3, 2 + 2: of a 1/2, 2/5, 1/2 are expected; the variances are 1/4, 6/25, 1/4.
    assert spread.statistic == pytest.approx((2 - 1.4) / sqrt(0.74))
    assert spread.p_value == pytest.approx(2 * stats.norm.sf(0.6 / sqrt(0.74)))
    tied = log_rank(Sample.of([1, 1, 5], [True, True, False]), Sample.of([1, 5, 5], [True, False, False]))
    # At 1 three of 3 + 3 arrive: expected of a are 3/2, variance 3 * 3 * 3 * 3 / (36 * 5).
    assert tied.statistic == pytest.approx((2 - 1.5) / sqrt(0.45))
    assert tied.degrees_of_freedom is None


def test_the_log_rank_test_calls_the_slower_group_negative() -> None:
    fast, slow = Sample.of([1, 2, 3, 4]), Sample.of([8, 9, 10, 10], [True, True, False, False])
    assert log_rank(slow, fast).statistic < 0 < log_rank(fast, slow).statistic


@given(samples(), samples())
def test_the_log_rank_test_is_undefined_exactly_if_no_time_decides(a: Sample, b: Sample) -> None:
    if decides(a, b):
        assert 0 <= log_rank(a, b).p_value <= 1
    else:
        with pytest.raises(Undefined):
            log_rank(a, b)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (Sample.of([5, 5], [False, False]), Sample.of([5, 5], [False, False])),
        (Sample.of([5, 5]), Sample.of([5, 5, 5])),
        (Sample.of([1] * 3, [False] * 3), Sample.of([*range(2, 51)])),
    ],
)
def test_the_log_rank_test_says_when_it_is_undefined(a: Sample, b: Sample) -> None:
    message = (
        "the log rank test needs a time at which runs of both groups are on and some of all these, not all, arrive"
    )
    with pytest.raises(Undefined, match=message):
        log_rank(a, b)


@pytest.mark.parametrize("compare", [student_t, welch_t, mann_whitney, log_rank])
@given(samples(min_size=2), samples(min_size=2), SEEDS)
def test_swapping_the_groups_and_shuffling_the_runs_changes_no_p_value(
    compare: Compare, a: Sample, b: Sample, seed: int
) -> None:
    assume(varies(a, b) and decides(a, b))
    found, swapped = compare(a, b), compare(b, a)
    assert swapped.p_value == pytest.approx(found.p_value)
    pairs = a.size * b.size if compare is mann_whitney else 0
    assert swapped.statistic == pytest.approx(pairs - found.statistic)
    rng = np.random.default_rng(seed)
    shuffled = compare(reordered(a, rng), reordered(b, rng))
    assert (shuffled.statistic, shuffled.p_value) == pytest.approx((found.statistic, found.p_value))


@pytest.mark.parametrize("compare", [student_t, welch_t, mann_whitney, improvement])
def test_groups_under_different_budgets_are_not_compared(compare: Callable[[Sample, Sample], object]) -> None:
    with pytest.raises(ValueError, match="all runs must share one budget"):
        compare(Sample.of([4, 9], [True, False]), Sample.of([4, 8], [True, False]))


@given(samples(min_size=2), samples(min_size=2), SEEDS)
def test_the_probability_of_improvement_is_the_share_of_pairs_that_are_better(a: Sample, b: Sample, seed: int) -> None:
    found = improvement(a, b, seed)
    assert found.value == pytest.approx(float(num_better_pairs(a, b) / (a.size * b.size)))
    assert found.value == pytest.approx(1 - mann_whitney(a, b).statistic / (a.size * b.size))
    assert found.value + improvement(b, a, seed).value == pytest.approx(1)
    assert 0 <= found.low <= found.high <= 1
    assert found.is_identified
    rng = np.random.default_rng(seed)
    assert improvement(reordered(a, rng), reordered(b, rng), seed) == found


def test_the_interval_of_the_probability_of_improvement_is_scipys_but_for_the_draws() -> None:
    rng = np.random.default_rng(1)
    a, b = exponential(rng, 25), exponential(rng, 15, mean=2)

    def share(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> float:
        return float((ours[:, None] < theirs).mean())

    expected = stats.bootstrap(
        (a.values, b.values), share, method="percentile", vectorized=False, rng=np.random.default_rng(2)
    ).confidence_interval
    found = probability_of_improvement(a, b, np.random.default_rng(3))
    assert (found.low, found.high) == pytest.approx(tuple(expected), abs=0.02)


def test_the_interval_of_the_probability_of_improvement_contains_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    found = [
        probability_of_improvement(exponential(rng, 30), exponential(rng, 30, mean=2), rng, num_resamples=300)
        for _ in range(400)
    ]
    coverage = np.mean([interval.low <= 2 / 3 <= interval.high for interval in found])
    assert 0.9 <= coverage <= 0.98


def test_the_probability_of_improvement_of_one_run_is_undefined() -> None:
    for pair in ((Sample.of([4]), Sample.of([4, 5])), (Sample.of([4, 5]), Sample.of([4]))):
        with pytest.raises(Undefined, match="how far runs scatter needs two runs or more, not 1"):
            improvement(*pair)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((np.nan, 0.5, None), "the statistic of x must be finite, not nan"),
        ((-np.inf, 0.0, None), "the statistic of x must be finite, not -inf"),
        ((1, np.nan, None), "the p value of x must lie from 0 to 1, not at nan"),
        ((1, 1.01, None), "the p value of x must lie from 0 to 1, not at 1.01"),
        ((1, 0.5, 0), "the degrees of freedom of x must be above 0, not 0"),
        ((1, 0.5, np.nan), "the degrees of freedom of x must be above 0, not nan"),
    ],
)
def test_a_result_that_makes_no_sense_is_refused(numbers: tuple[float, float, float | None], message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        two_samples.TestResult("x", *numbers)
