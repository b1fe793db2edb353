import json
from itertools import product
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
from webapp.analysis.paired import paired_t, pairs, rank_biserial_interval, signed_rank, skewness
from webapp.analysis.unpaired_ranks import rank_sum, rank_sum_interval

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


@given(DIFFERENCES.filter(lambda differences: len(differences) > 1), st.integers(0, 1000))
@settings(max_examples=30)
def test_the_bootstrap_interval_is_an_interval_of_correlations(differences: list[int], seed: int) -> None:
    low, high = rank_biserial_interval(differences, np.random.default_rng(seed), 200)
    assert -1 <= low <= high <= 1


def test_the_bootstrap_over_counts_is_the_bootstrap_over_people() -> None:
    differences = np.array([-2, -1, -1, 0, 0, 1, 1, 1, 2, 2, 3, 3, 0, -3, 1, 2.5, 2.5, 0.5, -0.5, 1])
    fast = rank_biserial_interval(differences, np.random.default_rng(1), 20_000)
    rng = np.random.default_rng(2)
    drawn = differences[rng.integers(20, size=(4_000, 20))]
    ranks = stats.rankdata(np.abs(drawn), axis=1) * (drawn != 0)
    slow = (np.sign(drawn) * ranks).sum(axis=1) / ranks.sum(axis=1)
    assert fast == pytest.approx(tuple(np.quantile(slow, [0.025, 0.975])), abs=0.03)


def test_the_bootstrap_covers_a_known_effect_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(3)
    # Of normal differences with mean 0.5 the population's correlation is 2 P(X1 + X2 > 0) - 1.
    truth = 2 * stats.norm.cdf(0.5 * np.sqrt(2)) - 1
    hits = 0
    for _ in range(200):
        low, high = rank_biserial_interval(rng.normal(0.5, 1, 60), rng, 400)
        hits += low <= truth <= high
    assert 176 <= hits <= 200


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


@given(st.lists(st.integers(1, 5), min_size=2, max_size=12), st.lists(st.integers(1, 5), min_size=2, max_size=12))
def test_the_effect_of_the_rank_sum_test_counts_pairs(first: list[int], second: list[int]) -> None:
    if len({*first, *second}) == 1:
        with pytest.raises(Undefined, match="a rank test needs values that vary"):
            rank_sum(first, second)
        return
    wins = np.sign(np.subtract.outer(first, second))
    assert rank_sum(first, second).rank_biserial == pytest.approx(wins.mean())
    low, high = rank_sum_interval(first, second, np.random.default_rng(0), 200)
    assert -1 <= low <= high <= 1


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


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="one row of finite numbers"):
        signed_rank([1, np.nan])
