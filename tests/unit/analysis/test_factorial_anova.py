from random import Random
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tests.unit.analysis.golden_numbers import AGREEMENT, DATA_SETS, numbers, rows
from webapp.analysis.censoring import Undefined
from webapp.analysis.factorial_anova import EFFECTS, SumsOfSquares, noncentrality, simple_effects, two_by_two

TYPES: dict[SumsOfSquares, str] = {1: "I", 2: "II", 3: "III"}
RATING = st.integers(1, 5)
CELL = st.lists(RATING, min_size=2, max_size=9)


def designed(cells: list[list[int]]) -> tuple[list[int], list[bool], list[bool]]:
    """Return values, first and second factor of the cells low low, low high, high low, high high."""
    levels = [(place > 1, place % 2 == 1) for place, cell in enumerate(cells) for _ in cell]
    return [value for cell in cells for value in cell], [one for one, _ in levels], [two for _, two in levels]


@pytest.mark.parametrize("data_set", DATA_SETS)
@pytest.mark.parametrize("kind", get_args(SumsOfSquares))
def test_every_type_agrees_with_car_and_base_r(data_set: str, kind: SumsOfSquares) -> None:
    own, known = rows(data_set), numbers(data_set)
    found = two_by_two(own["general"], own["likeliness"] == 1, own["loveliness"] == 1, kind)
    expected = known["types"][TYPES[kind]]
    assert [effect.sum_of_squares for effect in found.effects] == pytest.approx(expected["sum_sq"], rel=AGREEMENT)
    assert [effect.statistic for effect in found.effects] == pytest.approx(expected["f"], rel=AGREEMENT)
    assert [effect.p_value for effect in found.effects] == pytest.approx(expected["p"], rel=AGREEMENT)
    assert found.residual == pytest.approx(known["residual"], rel=AGREEMENT)
    assert found.degrees_of_freedom == known["df"]


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_simple_effects_are_the_contrasts_of_cells_that_emmeans_has(data_set: str) -> None:
    own, known = rows(data_set), numbers(data_set)["cell_contrasts"]
    found = simple_effects(own["general"], own["likeliness"] == 1, own["loveliness"] == 1)
    assert [one.difference.value for one in found] == pytest.approx(known["estimate"], rel=AGREEMENT)
    assert [one.difference.low for one in found] == pytest.approx(known["low"], rel=AGREEMENT)
    assert [one.difference.high for one in found] == pytest.approx(known["high"], rel=AGREEMENT)
    assert [one.statistic for one in found] == pytest.approx(known["t"], rel=AGREEMENT)
    assert [one.p_two_sided for one in found] == pytest.approx(known["p"], rel=AGREEMENT)
    assert [one.degrees_of_freedom for one in found] == known["df"]


def test_the_types_differ_on_the_golden_data_so_that_none_can_stand_for_another() -> None:
    squares = [numbers("strong")["types"][name]["sum_sq"][:2] for name in ("I", "II", "III")]
    assert squares[0] != pytest.approx(squares[1], rel=0.01)
    assert squares[1] != pytest.approx(squares[2], rel=0.01)


@given(
    st.integers(2, 4).flatmap(
        lambda size: st.lists(st.lists(RATING, min_size=size, max_size=size), min_size=4, max_size=4)
    )
)
def test_with_cells_of_one_size_the_three_types_agree_and_the_squares_add_up(cells: list[list[int]]) -> None:
    values, first, second = designed(cells)
    if all(len(set(cell)) == 1 for cell in cells):
        return
    found = [two_by_two(values, first, second, kind) for kind in get_args(SumsOfSquares)]
    for place in range(3):
        squares = [one.effects[place].sum_of_squares for one in found]
        assert squares == pytest.approx([squares[0]] * 3, abs=1e-9)
    parts = sum(effect.sum_of_squares for effect in found[0].effects) + found[0].residual
    assert parts == pytest.approx(np.var(values) * len(values), abs=1e-9)


@given(st.lists(CELL, min_size=4, max_size=4))
def test_an_effect_size_has_zero_outside_its_interval_exactly_where_p_is_below_05(cells: list[list[int]]) -> None:
    values, first, second = designed(cells)
    if all(len(set(cell)) == 1 for cell in cells):
        with pytest.raises(Undefined, match="vary within a cell"):
            two_by_two(values, first, second, 3)
        return
    for effect in two_by_two(values, first, second, 3).effects:
        share = effect.partial_eta_squared
        assert 0 <= share.low <= share.high < 1
        assert (share.low > 0) is (effect.p_value < 0.05)
        assert share.value == pytest.approx(effect.statistic / (effect.statistic + len(values) - 4), abs=1e-9)


@given(st.floats(0, 300), st.integers(1, 3), st.integers(1, 500), st.sampled_from([0.05, 0.5, 0.95]))
def test_a_noncentrality_has_the_found_f_at_the_wanted_quantile(
    statistic: float, numerator: int, denominator: int, below: float
) -> None:
    found = noncentrality(statistic, (numerator, denominator), below)
    if found == 0:
        assert stats.f.cdf(statistic, numerator, denominator) <= below + 1e-12
    else:
        assert stats.ncf.cdf(statistic, numerator, denominator, found) == pytest.approx(below, abs=1e-7)


def test_the_ends_of_an_effect_size_are_the_shares_whose_f_would_be_found_this_far_out() -> None:
    own = rows("mild")
    effect = two_by_two(own["general"], own["likeliness"] == 1, own["loveliness"] == 1, 3).effects[0]
    share, num = effect.partial_eta_squared, len(own)
    # A share of the variance is f² / (1 + f²), and N values have the noncentrality N f².
    sizes = [num * end / (1 - end) for end in (share.low, share.high)]
    found = [stats.ncf.cdf(effect.statistic, 1, num - 4, size) for size in sizes]
    assert found == pytest.approx([0.95, 0.05], abs=1e-7)


@given(st.lists(CELL, min_size=4, max_size=4), st.randoms(use_true_random=False))
def test_the_order_of_the_ratings_does_not_matter(cells: list[list[int]], random: Random) -> None:
    values, first, second = designed(cells)
    if all(len(set(cell)) == 1 for cell in cells):
        return
    order = list(range(len(values)))
    random.shuffle(order)
    columns = [[column[place] for place in order] for column in (values, first, second)]
    shuffled = two_by_two(columns[0], columns[1], columns[2], 2)
    for one, other in zip(two_by_two(values, first, second, 2).effects, shuffled.effects, strict=True):
        assert other.sum_of_squares == pytest.approx(one.sum_of_squares, abs=1e-9)


@pytest.mark.parametrize("sizes", [(0, 3, 3, 3), (3, 1, 3, 3), (0, 0, 0, 0)])
def test_a_cell_of_fewer_than_two_is_told_with_the_sizes_of_all(sizes: tuple[int, ...]) -> None:
    values, first, second = designed([[1, 2, 3][:size] for size in sizes])
    with pytest.raises(Undefined, match=", ".join(map(str, sizes))):
        two_by_two(values, first, second, 3)
    with pytest.raises(Undefined, match="four cells"):
        simple_effects(values, first, second)


def test_columns_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="needs both its levels"):
        two_by_two([1, 2, 3], [True, False], [True, False, True], 3)


def test_thousands_of_ratings_with_a_huge_effect_stay_finite() -> None:
    rng = np.random.default_rng(0)
    first = rng.random(20_000) < 0.4
    values = np.where(first, 5, 1) + (rng.random(20_000) < 0.001)
    found = two_by_two(values, first, rng.random(20_000) < 0.5, 3)
    assert found.effects[0].partial_eta_squared.low > 0.99
    assert [effect.name for effect in found.effects] == list(EFFECTS)
