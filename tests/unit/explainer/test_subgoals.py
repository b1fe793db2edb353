from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.explainer.subgoals import importance_threshold, subgoal_steps

# Multiples of 1/64 add up without rounding, so that what equals the mean does so exactly.
IMPORTANCES = st.lists(st.integers(0, 64), max_size=30).map(lambda counts: [count / 64 for count in counts] + [0.0])


def test_a_subgoal_is_the_last_step_above_the_mean() -> None:
    assert subgoal_steps([0.1, 0.9, 0.9, 0.1, 0.8, 0.0]) == (3, 5)


def test_the_last_step_can_be_a_subgoal_because_the_target_counts_as_zero() -> None:
    assert subgoal_steps([0.1, 0.9, 0.0]) == (2,)


def test_importance_equal_to_the_mean_is_neither_above_nor_below_it() -> None:
    assert importance_threshold([0.75, 0.375, 0.0]) == 0.375
    assert subgoal_steps([0.75, 0.375, 0.0]) == ()
    assert subgoal_steps([0.375, 0.75, 0.375, 0.375, 0.0]) == ()


def test_a_path_without_steps_has_no_subgoals() -> None:
    assert subgoal_steps([0.0]) == ()


@given(IMPORTANCES)
def test_the_threshold_is_the_mean_of_all_states_the_target_included(values: list[float]) -> None:
    assert importance_threshold(values) == float(sum(map(Fraction, values), Fraction(0)) / len(values))


@given(IMPORTANCES)
def test_each_subgoal_falls_through_the_threshold_and_no_other_step_does(values: list[float]) -> None:
    steps = subgoal_steps(values)
    mean = sum(map(Fraction, values), Fraction(0)) / len(values)
    falls = {step for step in range(1, len(values)) if values[step - 1] > mean and values[step] < mean}
    assert set(steps) == falls
    assert list(steps) == sorted(steps)


@given(IMPORTANCES)
def test_two_adjacent_steps_are_never_both_subgoals(values: list[float]) -> None:
    steps = subgoal_steps(values)
    assert all(later - earlier > 1 for earlier, later in pairwise(steps))


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_an_importance_that_is_no_number_is_refused_by_its_step(bad: float) -> None:
    with pytest.raises(ValueError, match=r"importance of step 2 must be a finite number"):
        subgoal_steps([0.5, bad, 0.0])


def test_no_importance_at_all_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one state"):
        subgoal_steps([])
