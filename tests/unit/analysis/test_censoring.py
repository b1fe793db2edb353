import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy import stats

from tests.unit.analysis.samples import samples
from webapp.analysis.censoring import Sample, check_one_budget, kaplan_meier


@pytest.mark.parametrize(
    ("values", "observed", "message"),
    [
        ([], None, "a sample must be one row of one run or more, not of shape (0,)"),
        ([[1, 2]], None, "a sample must be one row of one run or more, not of shape (1, 2)"),
        ([1, 2], [True], "observed must have the values' shape (2,), not (1,)"),
        ([1, 2], [1, 0], "values and observed must be float64 and bool, not float64 and int64"),
        ([1, 0], None, "a run's episodes must be finite and above 0, not 0.0"),
        ([1, -3], None, "a run's episodes must be finite and above 0, not -3.0"),
        ([1, np.inf], None, "a run's episodes must be finite and above 0, not inf"),
        ([1, np.nan], None, "a run's episodes must be finite and above 0, not nan"),
    ],
)
def test_a_sample_that_makes_no_sense_is_refused(values: ArrayLike, observed: ArrayLike | None, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        Sample.of(values, observed)


def test_a_samples_values_must_not_be_whole_numbers_by_type() -> None:
    with pytest.raises(ValueError, match="values and observed must be float64 and bool, not int64 and bool"):
        Sample(np.array([1, 2]), np.array([True, True]))


def test_a_sample_does_not_change_with_the_array_it_was_built_from() -> None:
    source = np.array([1.0, 2.0])
    sample = Sample.of(source)
    source[0] = 9
    assert sample.values.tolist() == [1, 2]


def test_a_sample_counts_its_runs_and_ranks_stopped_ones_above_one_that_took_the_whole_budget() -> None:
    sample = Sample.of([5, 3, 5], [False, True, True])
    assert (sample.size, sample.num_censored) == (3, 1)
    assert sample.ranked.tolist() == [3, 5, np.inf]


def test_the_share_without_the_optimum_is_right_for_a_case_worked_out_by_hand() -> None:
    times, share = kaplan_meier(Sample.of([2, 1, 2, 3, 4], [True, True, False, True, False]))
    assert times.tolist() == [0, 1, 2, 3, 4]
    # After 1: 4/5. After 2, where four are at risk: 4/5 * 3/4. After 3, where two are: half of that. At 4 none arrives.
    assert share == pytest.approx([1, 0.8, 0.6, 0.3, 0.3])


@given(st.lists(st.tuples(st.integers(1, 9), st.booleans()), min_size=1, max_size=20))
def test_the_share_without_the_optimum_is_scipys_under_any_censoring(runs: list[tuple[int, bool]]) -> None:
    values = np.array([value for value, _ in runs], dtype=np.float64)
    observed = np.array([arrived for _, arrived in runs])
    times, share = kaplan_meier(Sample.of(values, observed))
    expected = stats.ecdf(stats.CensoredData(uncensored=values[observed], right=values[~observed])).sf
    assert times[0] == 0
    assert share[0] == 1
    assert times[1:].tolist() == expected.quantiles.tolist()
    assert share[1:] == pytest.approx(expected.probabilities)


@given(samples(max_size=20))
def test_under_one_budget_the_share_left_at_the_end_is_that_of_the_stopped_runs(sample: Sample) -> None:
    _, share = kaplan_meier(sample)
    assert share[-1] == pytest.approx(sample.num_censored / sample.size)
    assert (np.diff(share) <= 0).all()


@given(samples(), samples())
def test_runs_under_one_budget_are_accepted(a: Sample, b: Sample) -> None:
    check_one_budget(a, b)


def test_runs_under_two_budgets_are_refused() -> None:
    a, b = Sample.of([1, 5], [True, False]), Sample.of([1, 9], [True, False])
    with pytest.raises(ValueError, match=r"all runs must share one budget, but they were stopped at 5\.0 and at 9\.0"):
        check_one_budget(a, b)


def test_a_run_that_took_longer_than_anothers_budget_is_refused() -> None:
    a, b = Sample.of([1, 5], [True, False]), Sample.of([1, 6])
    with pytest.raises(ValueError, match=r"all runs must share one budget, but one took 6\.0 and one was stopped at 5"):
        check_one_budget(a, b)
