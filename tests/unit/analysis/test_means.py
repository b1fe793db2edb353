import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tests.unit.analysis.golden_numbers import AGREEMENT, DATA_SETS, numbers, rows
from webapp.analysis.censoring import Undefined
from webapp.analysis.factorial_anova import two_by_two
from webapp.analysis.means import Described, describe, shapiro_wilk, unpaired_t

RATINGS = st.lists(st.integers(1, 7), min_size=2, max_size=30)


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_a_mean_and_its_interval_agree_with_r(data_set: str) -> None:
    known, found = numbers(data_set)["mean"], describe(rows(data_set)["general"])
    assert (found.mean, found.low, found.high, found.sd) == pytest.approx(
        (known["mean"], known["low"], known["high"], known["sd"]), rel=AGREEMENT
    )


@pytest.mark.parametrize("data_set", DATA_SETS)
@pytest.mark.parametrize("level", [0, 1])
def test_an_unpaired_t_test_agrees_with_r_in_both_directions(data_set: str, level: int) -> None:
    own, known = rows(data_set), numbers(data_set)["t_tests"][level]
    cells = [own["general"][(own["likeliness"] == level) & (own["loveliness"] == other)] for other in (1, 0)]
    found = unpaired_t(*cells)
    assert (found.statistic, found.degrees_of_freedom) == pytest.approx((known["t"], known["df"]), rel=AGREEMENT)
    assert (found.p_two_sided, found.p_first_larger, found.p_second_larger) == pytest.approx(
        (known["p_two_sided"], known["p_high_larger"], known["p_low_larger"]), rel=AGREEMENT
    )
    assert (found.difference.low, found.difference.high) == pytest.approx((known["low"], known["high"]), rel=AGREEMENT)


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_shapiro_wilk_of_the_residuals_agrees_with_r(data_set: str) -> None:
    own, known = rows(data_set), numbers(data_set)["shapiro"]
    residuals = own["general"] - own.groupby(["likeliness", "loveliness"])["general"].transform("mean")
    found = shapiro_wilk(residuals)
    assert found.statistic == pytest.approx(known["w"], rel=AGREEMENT)
    assert found.p_value == pytest.approx(known["p"], rel=1e-4)  # Royston's approximation, written down twice.


@given(RATINGS, RATINGS)
def test_a_t_test_is_scipys_and_rejects_exactly_where_its_interval_leaves_out_zero(a: list[int], b: list[int]) -> None:
    if len(set(a)) == len(set(b)) == 1:
        with pytest.raises(Undefined, match="needs ratings that vary"):
            unpaired_t(a, b)
        return
    numbers = [number for one in (a, b) for number in (np.mean(one), np.std(one, ddof=1), len(one))]
    found, oracle = unpaired_t(a, b), stats.ttest_ind_from_stats(*numbers)
    assert (found.p_two_sided, found.statistic) == pytest.approx((oracle.pvalue, oracle.statistic), abs=1e-9)
    assert found.p_first_larger + found.p_second_larger == pytest.approx(1)
    assert (found.p_two_sided < 0.05) is not (found.difference.low <= 0 <= found.difference.high)


@given(RATINGS)
def test_an_interval_of_a_mean_lies_around_it_as_scipy_has_it(values: list[int]) -> None:
    found = describe(values)
    if len(set(values)) == 1:
        assert found == Described(len(values), values[0], 0.0, 0.0)
        return
    low, high = stats.t.interval(0.95, len(values) - 1, np.mean(values), stats.sem(values))
    assert (found.low, found.high) == pytest.approx((low, high))
    assert found.variance == pytest.approx(np.var(values, ddof=1))


def test_one_value_has_a_mean_and_nothing_else() -> None:
    assert describe([4]) == Described(1, 4.0)


@pytest.mark.parametrize(
    ("compute", "reason"),
    [
        (lambda: describe([]), "there is none"),
        (lambda: unpaired_t([1], [2, 3]), "there are 1 and 2"),
        (lambda: shapiro_wilk([1, 2]), "there are 2"),
        (lambda: shapiro_wilk([3, 3, 3]), "all 3 are 3"),
        (lambda: shapiro_wilk(np.arange(5001)), "there are 5001"),
    ],
)
def test_what_the_data_do_not_determine_is_said_with_the_numbers(compute: object, reason: str) -> None:
    with pytest.raises(Undefined, match=reason):
        compute()  # type: ignore[operator]


def test_values_that_are_no_row_of_finite_numbers_are_refused() -> None:
    with pytest.raises(ValueError, match="must be finite, not nan"):
        describe([1, math.nan])
    with pytest.raises(ValueError, match="must be one row"):
        describe([[1, 2]])


def test_an_interaction_is_the_difference_of_the_two_simple_differences() -> None:
    own = rows("mild")
    high, low = own["likeliness"] == 1, own["likeliness"] == 0
    gaps = [
        unpaired_t(own["general"][level & (own["loveliness"] == 1)], own["general"][level & (own["loveliness"] == 0)])
        for level in (high, low)
    ]
    sizes = own.groupby(["likeliness", "loveliness"]).size()
    gap = gaps[0].difference.value - gaps[1].difference.value
    expected = gap**2 / float((1 / sizes).sum())
    found = two_by_two(own["general"], high, own["loveliness"] == 1, 3)
    assert found.effects[2].sum_of_squares == pytest.approx(expected)
