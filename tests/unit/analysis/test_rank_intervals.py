import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.rank_intervals import rank_biserial_interval, rank_sum_interval

DIFFERENCES = st.lists(st.integers(-4, 4), min_size=2, max_size=40)
RATINGS = st.lists(st.integers(1, 5), min_size=2, max_size=12)


def correlation(differences: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    ranks = stats.rankdata(np.abs(differences)) * (differences != 0)
    return float((np.sign(differences) * ranks).sum() / max(1.0, ranks.sum()))


@given(DIFFERENCES.filter(lambda differences: min(differences) < 0 < max(differences)))
def test_within_persons_the_interval_is_the_jackknifes_on_fishers_z(given_: list[int]) -> None:
    differences = np.array(given_, dtype=float)
    n, value = differences.size, correlation(differences)
    without = np.array([correlation(np.delete(differences, place)) for place in range(n)])
    error = np.sqrt((n - 1) / n * ((without - without.mean()) ** 2).sum()) / (1 - value**2)
    low, high = rank_biserial_interval(differences)
    half = stats.t.ppf(0.975, n - 1) * error
    assert (low, high) == pytest.approx((np.tanh(np.arctanh(value) - half), np.tanh(np.arctanh(value) + half)))
    assert -1 <= low < value < high <= 1


@pytest.mark.parametrize("differences", [[1, 1], [1, 1, 1], [0, -2, -1], [0, 0], [1e-12, 1, 2]])
def test_where_all_differ_in_one_direction_nothing_tells_how_certain_that_is(differences: list[float]) -> None:
    with pytest.raises(Undefined, match="needs differences on both sides of 0"):
        rank_biserial_interval(differences)


def test_one_person_has_no_interval() -> None:
    with pytest.raises(Undefined, match="it takes 2 people or more, not 1"):
        rank_biserial_interval([1])


@pytest.mark.parametrize("num_people", [8, 20])
def test_within_persons_the_interval_covers_at_least_as_often_as_it_says_nearly(num_people: int) -> None:
    rng = np.random.default_rng(3)
    truth = correlation(np.rint(rng.normal(0.8, 1.1, 200_000)))
    hits = made = 0
    for _ in range(400):
        try:
            low, high = rank_biserial_interval(np.rint(rng.normal(0.8, 1.1, num_people)))
        except Undefined:
            continue
        made += 1
        hits += low <= truth <= high
    assert made > 200
    assert hits / made > 0.93


@given(RATINGS, RATINGS)
def test_between_persons_to_swap_the_groups_turns_the_interval_around(first: list[int], second: list[int]) -> None:
    try:
        low, high = rank_sum_interval(first, second)
    except Undefined:
        with pytest.raises(Undefined):
            rank_sum_interval(second, first)
        return
    assert rank_sum_interval(second, first) == pytest.approx((-high, -low))
    assert -1 <= low < high <= 1


@pytest.mark.parametrize(("first", "second"), [([4, 5], [1, 2]), ([1, 1, 1], [2, 5])])
def test_where_groups_do_not_overlap_nothing_tells_how_certain_that_is(first: list[int], second: list[int]) -> None:
    with pytest.raises(Undefined, match="needs groups that overlap"):
        rank_sum_interval(first, second)


def test_groups_of_equal_ratings_have_no_interval() -> None:
    with pytest.raises(Undefined, match="needs people who differ"):
        rank_sum_interval([3, 3], [3, 3])


@pytest.mark.parametrize("num_people", [8, 25])
def test_between_persons_the_interval_covers_at_least_as_often_as_it_says_nearly(num_people: int) -> None:
    rng = np.random.default_rng(4)
    first, second = (np.clip(np.rint(rng.normal(mean, 1, 3_000)), 1, 5) for mean in (4.0, 2.0))
    truth = float(np.sign(first[:, None] - second[None, :]).mean())
    hits = made = 0
    for _ in range(400):
        try:
            low, high = rank_sum_interval(rng.choice(first, num_people), rng.choice(second, num_people))
        except Undefined:
            continue
        made += 1
        hits += low <= truth <= high
    assert made > 300
    assert hits / made > 0.93
