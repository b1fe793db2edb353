from fractions import Fraction
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.explainer.subgoals import ThresholdRule, importance_threshold, possible_counts, subgoal_steps

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


def falls(values: list[float], level: Fraction) -> tuple[int, ...]:
    """The steps at which exact numbers fall through a level."""
    return tuple(step for step in range(1, len(values)) if values[step - 1] > level > values[step])


def bands(values: list[float]) -> list[tuple[Fraction, Fraction]]:
    """The middle and the width of every gap between neighbouring importances, from the highest."""
    ordered = sorted({Fraction(value) for value in values}, reverse=True)
    return [((high + low) / 2, high - low) for high, low in pairwise(ordered)]


def test_the_largest_gap_parts_high_importances_from_low_ones() -> None:
    values = [0.1, 0.9, 0.8, 0.2, 0.7, 0.0]
    assert importance_threshold(values, "largest-gap") == pytest.approx(0.45)
    assert subgoal_steps(values, "largest-gap") == (3, 5)


def test_of_equal_gaps_the_higher_counts() -> None:
    assert importance_threshold([1.0, 0.5, 0.0], "largest-gap") == 0.75
    assert subgoal_steps([1.0, 0.5, 0.0], "largest-gap") == (1,)


def test_top_k_lowers_the_level_until_it_is_fallen_through_k_times_and_takes_the_largest_gap_while_it_is() -> None:
    values = [0.2, 0.95, 0.93, 0.1, 0.6, 0.3, 0.5, 0.0]
    assert subgoal_steps(values, "top-k", 1) == (3,)
    assert subgoal_steps(values, "top-k", 2) == (3, 5)
    assert subgoal_steps(values, "top-k", 3) == (3, 5, 7)
    assert importance_threshold(values, "top-k", 1) == pytest.approx((0.93 + 0.6) / 2)
    assert importance_threshold(values, "top-k", 3) == pytest.approx((0.5 + 0.3) / 2)


def test_top_k_does_not_take_two_steps_of_one_slope() -> None:
    slope = [0.36, 0.58, 0.67, 0.37, 0.12, 0.15, 0.58, 0.0]
    assert subgoal_steps(slope, "top-k", 2) == (3, 7)


@given(IMPORTANCES)
def test_top_k_finds_as_many_steps_as_it_was_asked_for_or_says_how_many_it_can(values: list[float]) -> None:
    possible = {len(falls(values, middle)) for middle, _ in bands(values)} - {0}
    assert possible_counts(values) == tuple(sorted(possible))
    for k in range(1, len(values) + 1):
        if k in possible:
            assert len(subgoal_steps(values, "top-k", k)) == k
        else:
            with pytest.raises(ValueError, match=rf"k = {k} cannot be met"):
                subgoal_steps(values, "top-k", k)


@given(IMPORTANCES)
def test_top_k_takes_the_highest_levels_that_do(values: list[float]) -> None:
    for k in possible_counts(values):
        level = Fraction(importance_threshold(values, "top-k", k))
        counts = [len(falls(values, middle)) for middle, _ in bands(values)]
        first = counts.index(k)
        last = next((place for place in range(first, len(counts)) if counts[place] != k), len(counts))
        widest = max(width for _, width in bands(values)[first:last])
        assert (level, widest) in bands(values)[first:last]


@given(IMPORTANCES)
def test_no_gap_is_larger_than_the_largest_and_none_as_large_lies_higher(values: list[float]) -> None:
    level = Fraction(importance_threshold(values, "largest-gap"))
    widths = dict(bands(values))
    if not widths:
        assert subgoal_steps(values, "largest-gap") == ()
        return
    assert widths[level] == max(widths.values())
    assert all(width < widths[level] for middle, width in widths.items() if middle > level)
    assert subgoal_steps(values, "largest-gap") == falls(values, level)


@given(IMPORTANCES, st.sampled_from([0.25, 8.0, 2.0**40]), st.integers(-64, 64))
def test_only_the_order_and_the_proportions_of_importances_matter(
    values: list[float], scale: float, shift: int
) -> None:
    moved = [scale * (value + shift / 64) for value in values]
    assert subgoal_steps(moved, "largest-gap") == subgoal_steps(values, "largest-gap")
    for k in possible_counts(values):
        assert subgoal_steps(moved, "top-k", k) == subgoal_steps(values, "top-k", k)


@given(IMPORTANCES, st.randoms(use_true_random=False))
def test_what_is_equal_but_for_rounding_has_no_gap(values: list[float], random: Random) -> None:
    rounded = [value + random.choice([-1e-15, 0.0, 1e-15]) * value for value in values]
    assert subgoal_steps(rounded, "largest-gap") == subgoal_steps(values, "largest-gap")
    assert possible_counts(rounded) == possible_counts(values)
    for k in possible_counts(values):
        assert subgoal_steps(rounded, "top-k", k) == subgoal_steps(values, "top-k", k)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False, width=32), max_size=30).map(lambda each: [*each, 0.0]))
def test_under_no_rule_are_adjacent_steps_both_subgoals_whatever_the_range(values: list[float]) -> None:
    found = [subgoal_steps(values), subgoal_steps(values, "largest-gap")]
    found += [subgoal_steps(values, "top-k", k) for k in possible_counts(values)]
    for steps in found:
        assert all(later - earlier > 1 for earlier, later in pairwise(steps))


def test_the_widest_range_of_numbers_is_no_trouble() -> None:
    assert subgoal_steps([1.7e308, -1.7e308, 0.0], "largest-gap") == (1,)
    assert subgoal_steps([1.7e308, -1.7e308, 0.0], "top-k", 1) == (1,)
    assert importance_threshold([1.7e308, 1e308, 1.6e308, 0.0], "top-k", 2) == pytest.approx(1.3e308)


def test_where_all_importances_are_equal_there_is_no_subgoal() -> None:
    assert importance_threshold([0.0, 0.0], "largest-gap") == 0
    assert subgoal_steps([0.0, 0.0, 0.0], "largest-gap") == ()
    assert possible_counts([0.0, 0.0]) == ()
    with pytest.raises(ValueError, match=r"k = 2 cannot be met: importance never falls, so there is no subgoal"):
        subgoal_steps([0.0, 0.0], "top-k", 2)


def test_peaks_of_equal_height_count_at_once() -> None:
    values = [0.0, 0.5, 0.0, 0.5, 0.0]
    assert possible_counts(values) == (2,)
    with pytest.raises(ValueError, match=r"falls through no level 1 times, only 2$"):
        subgoal_steps(values, "top-k", 1)


def test_a_k_that_is_too_large_is_told_how_large_it_can_be() -> None:
    with pytest.raises(
        ValueError, match=r"^k = 4 cannot be met: importance falls through no level 4 times, only 1 to 3$"
    ):
        subgoal_steps([0.2, 0.95, 0.1, 0.6, 0.3, 0.5, 0.0], "top-k", 4)


@pytest.mark.parametrize(
    ("rule", "k", "message"),
    [
        ("median", None, r"'median' is not a threshold; use mean, top-k, largest-gap"),
        ("mean", 3, r"k = 3 belongs to the threshold top-k, and this is mean"),
        ("largest-gap", 1, r"k = 1 belongs to the threshold top-k, and this is largest-gap"),
        ("top-k", None, r"top-k needs k"),
        ("top-k", 0, r"k must be 1 or larger, not 0"),
    ],
)
def test_a_rule_and_a_k_that_do_not_go_together_are_refused(rule: ThresholdRule, k: int | None, message: str) -> None:
    for ask in (importance_threshold, subgoal_steps):
        with pytest.raises(ValueError, match=message):
            ask([0.5, 0.0], rule, k)
