import json
from itertools import combinations, product
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
from webapp.analysis.paired import is_normal_enough, known_skewness, paired_t, pairs, signed_rank, skewness
from webapp.analysis.unpaired_ranks import rank_sum

FOLDER = Path(__file__).parents[2] / "golden" / "analysis"
GOLDEN: dict[str, Any] = json.loads((FOLDER / "paired.json").read_text())
DATA = pd.read_csv(FOLDER / "paired.csv")
DIFFERENCES = st.lists(st.integers(-4, 4), min_size=1, max_size=40)


def by_all_signs(differences: NDArray[np.float64]) -> float:
    """The exact two-sided p-value by trying every choice of signs."""
    ranks = np.where(differences == 0, 0.0, stats.rankdata(np.abs(differences)))
    kept = ranks[ranks > 0]
    found = abs(float((np.sign(differences) * ranks).sum()))
    sums = [abs(float(np.dot(signs, kept))) for signs in product((-1, 1), repeat=kept.size)]
    return float(np.mean([total >= found - 1e-9 for total in sums]))


def test_the_signed_rank_test_without_ties_and_zeros_is_rs() -> None:
    few = DATA["exact_first"][:20] - DATA["exact_second"][:20]
    found = signed_rank(few)
    assert (found.method, found.num_zeros) == ("exact", 0)
    assert (found.plus, found.p_value) == pytest.approx(
        (GOLDEN["signed_rank"]["exact_v"], GOLDEN["signed_rank"]["exact_p"]), rel=1e-9
    )


def test_the_normal_signed_rank_test_with_ties_is_rs() -> None:
    differences = (DATA["first"] - DATA["second"]).to_numpy(dtype=float)
    kept = differences[differences != 0]
    found = signed_rank(kept)
    assert found.method == "normal"
    assert (found.plus, found.p_value) == pytest.approx(
        (GOLDEN["signed_rank"]["normal_v"], GOLDEN["signed_rank"]["normal_p"]), rel=1e-9
    )


@given(st.lists(st.integers(-4, 4), min_size=26, max_size=60).filter(any))
def test_the_normal_signed_rank_test_is_scipys_with_pratts_zeros(differences: list[int]) -> None:
    theirs = stats.wilcoxon(differences, zero_method="pratt", method="asymptotic", correction=False)
    ours = signed_rank(differences)
    assert ours.p_value == pytest.approx(theirs.pvalue)
    assert min(ours.plus, ours.minus) == pytest.approx(theirs.statistic)


@given(st.lists(st.integers(-4, 4), min_size=1, max_size=10).filter(any))
@settings(max_examples=40)
def test_up_to_twenty_five_people_every_choice_of_signs_counts_with_ties_and_zeros_too(differences: list[int]) -> None:
    found = signed_rank(differences)
    assert found.method == "exact"
    assert found.p_value == pytest.approx(by_all_signs(np.array(differences, dtype=float)))


@given(DIFFERENCES.filter(any))
def test_to_swap_the_kinds_turns_the_effect_around_and_leaves_the_p_value(differences: list[int]) -> None:
    ours, theirs = signed_rank(differences), signed_rank([-difference for difference in differences])
    assert ours.p_value == pytest.approx(theirs.p_value)
    assert ours.rank_biserial == pytest.approx(-theirs.rank_biserial)
    assert -1 <= ours.rank_biserial <= 1
    assert 0 < ours.p_value <= 1


def test_means_that_differ_by_rounding_alone_are_ties() -> None:
    assert signed_rank([0.1 + 0.2 - 0.3, 1.0, 1.0 + 1e-15, -1.0]).num_zeros == 1
    assert signed_rank([0.1 + 0.2, -0.3]).z == 0


def test_no_difference_at_all_is_no_signed_rank_test() -> None:
    with pytest.raises(Undefined, match="all 3 are 0"):
        signed_rank([0, 0, 0])
    with pytest.raises(Undefined, match="all 2 are 0"):
        signed_rank([0.1 + 0.2 - 0.3, 0])
    with pytest.raises(Undefined, match="it takes 1 people or more, not 0"):
        signed_rank([])


def test_the_paired_t_test_and_its_effect_sizes_are_rs() -> None:
    found = paired_t(DATA["first"], DATA["second"])
    t, d_z, d_av = GOLDEN["t"], GOLDEN["d_z"], GOLDEN["d_av"]
    assert (found.mean, found.low, found.high, found.t, found.df, found.p_value) == pytest.approx(
        (t["mean"], t["low"], t["high"], t["t"], t["df"], t["p"]), rel=1e-9
    )
    assert found.d_z == pytest.approx((d_z["value"], d_z["low"], d_z["high"]), rel=1e-7)
    assert found.d_av == pytest.approx((d_av["value"], d_av["low"], d_av["high"]), rel=1e-9)


@given(st.lists(st.tuples(st.integers(1, 5), st.integers(1, 5)), min_size=2, max_size=30))
def test_the_paired_t_test_is_scipys_or_says_why_there_is_none(rated: list[tuple[int, int]]) -> None:
    first, second = (np.array(side, dtype=float) for side in zip(*rated, strict=True))
    if np.ptp(first - second) == 0:
        with pytest.raises(Undefined, match="a t test needs differences that vary"):
            paired_t(first, second)
        return
    ours, theirs = paired_t(first, second), stats.ttest_rel(first, second)
    assert (ours.t, ours.p_value) == pytest.approx((theirs.statistic, theirs.pvalue))
    assert (ours.low, ours.high) == pytest.approx(tuple(theirs.confidence_interval()))
    assert ours.d_z[1] < ours.d_z[0] < ours.d_z[2]


def test_an_effect_that_is_huge_still_has_an_interval() -> None:
    found = paired_t([5, 5, 5, 4.999] * 5, [1, 1, 1, 1] * 5)
    assert found.d_z[1] < found.d_z[0] < found.d_z[2]


def test_the_rank_sum_test_is_rs() -> None:
    normal = rank_sum(DATA["first"][:20], DATA["second"][20:40])
    exact = rank_sum(DATA["exact_first"][:7], DATA["exact_second"][7:20])
    theirs = GOLDEN["rank_sum"]
    assert (normal.method, exact.method) == ("normal", "exact")
    assert (normal.u, normal.p_value) == pytest.approx((theirs["u"], theirs["p"]), rel=1e-9)
    assert (exact.u, exact.p_value) == pytest.approx((theirs["exact_u"], theirs["exact_p"]), rel=1e-9)


def test_the_rank_sum_test_is_exact_with_ties_too() -> None:
    found = rank_sum([4, 4, 5], [1, 2, 2])
    assert found.method == "exact"
    assert found.p_value == pytest.approx(0.1)


@given(st.lists(st.integers(1, 5), min_size=2, max_size=5), st.lists(st.integers(1, 5), min_size=2, max_size=5))
@settings(max_examples=40)
def test_every_division_into_two_groups_counts(first: list[int], second: list[int]) -> None:
    if len({*first, *second}) == 1:
        return
    ranks = stats.rankdata([*first, *second])
    sums = [sum(ranks[list(chosen)]) for chosen in combinations(range(ranks.size), len(first))]
    middle = np.mean(sums)
    expected = np.mean([abs(each - middle) >= abs(ranks[: len(first)].sum() - middle) - 1e-9 for each in sums])
    assert rank_sum(first, second).p_value == pytest.approx(float(expected))


@given(st.lists(st.integers(1, 5), min_size=2, max_size=12), st.lists(st.integers(1, 5), min_size=2, max_size=12))
def test_the_effect_of_the_rank_sum_test_counts_pairs(first: list[int], second: list[int]) -> None:
    if len({*first, *second}) == 1:
        with pytest.raises(Undefined, match="a rank test needs values that vary"):
            rank_sum(first, second)
        return
    wins = np.sign(np.subtract.outer(first, second))
    assert rank_sum(first, second).rank_biserial == pytest.approx(wins.mean())


def test_people_who_saw_a_kind_several_times_count_with_their_mean() -> None:
    frame = pd.DataFrame(
        [("p1", "a", 2), ("p1", "a", 4), ("p1", "b", 1), ("p2", "a", 5), ("p3", "b", 2), ("p4", "c", 5)],
        columns=["participant", "kind", "rating"],
    )
    found = pairs(frame, "a", "b")
    assert found.differences.tolist() == [2.0]
    assert (found.first_only.tolist(), found.second_only.tolist(), found.num_averaged) == ([5.0], [2.0], 1)
    assert not found.is_within


def test_half_of_the_people_with_both_are_enough_for_differences_within_persons() -> None:
    rows = [("p1", "a", 2), ("p1", "b", 4), ("p2", "a", 4)]
    assert pairs(pd.DataFrame(rows, columns=["participant", "kind", "rating"]), "a", "b").is_within
    rows.append(("p3", "b", 1))
    assert not pairs(pd.DataFrame(rows, columns=["participant", "kind", "rating"]), "a", "b").is_within


def test_ratings_of_no_such_kind_are_no_pairs() -> None:
    found = pairs(pd.DataFrame({"participant": ["p"], "kind": ["c"], "rating": [1]}), "a", "b")
    assert (found.first.size, found.first_only.size, found.is_within) == (0, 0, False)


def test_symmetric_differences_have_no_skewness() -> None:
    assert skewness([-2, -1, 0, 1, 2]) == pytest.approx(0)
    with pytest.raises(Undefined, match="it takes 3 people or more, not 2"):
        skewness([1, 2])


def test_skewness_of_few_or_equal_differences_is_unknown() -> None:
    assert known_skewness([]) is None
    assert known_skewness([1, 2, 3, 4, 5, 6, 9]) is None
    assert known_skewness([1] * 8) is None
    assert known_skewness([-1, 1] * 4) == pytest.approx(0)


@pytest.mark.parametrize(("skew", "num_people", "expected"), [(0.0, 29, False), (0.0, 30, True), (1.5, 56, False)])
def test_thirty_people_are_enough_unless_differences_are_skewed(skew: float, num_people: int, expected: bool) -> None:
    assert is_normal_enough(skew, num_people) == expected


def test_the_intervals_of_standardized_differences_cover_about_as_often_as_they_say() -> None:
    rng = np.random.default_rng(8)
    # Both kinds with variance 1 and correlation .5, so that the differences have variance 1 too.
    d_z = d_av = 0
    for _ in range(400):
        own = rng.normal(0, np.sqrt(0.5), 25)
        first, second = (own + rng.normal(mean, np.sqrt(0.5), 25) for mean in (0.6, 0.0))
        found = paired_t(first, second)
        assert found.d_av is not None
        d_z += found.d_z[1] <= 0.6 <= found.d_z[2]
        d_av += found.d_av[1] <= 0.6 <= found.d_av[2]
    assert 366 <= d_z <= 394
    assert 366 <= d_av <= 394


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="one row of finite numbers"):
        signed_rank([1, np.nan])
