import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tests.unit.analysis.golden_numbers import AGREEMENT, DATA_SETS, numbers, rows
from webapp.analysis.censoring import Undefined
from webapp.analysis.correlation import intraclass, pearson, repeated_measures

PAIRS = st.lists(st.tuples(st.integers(1, 5), st.integers(1, 5)), max_size=25)
RATED = st.lists(st.tuples(st.sampled_from("abcd"), st.integers(1, 5), st.integers(1, 5)), max_size=25)


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_a_correlation_with_its_interval_agrees_with_r(data_set: str) -> None:
    own, known = rows(data_set), numbers(data_set)["correlation"]
    found = pearson(own["general"] + own["likeliness"], own["general"] - 2 * own["loveliness"])
    assert (found.value.value, found.value.low, found.value.high, found.p_value) == pytest.approx(
        (known["r"], known["low"], known["high"], known["p"]), rel=AGREEMENT
    )


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_a_correlation_within_persons_agrees_with_the_analysis_of_covariance_in_r(data_set: str) -> None:
    own, known = rows(data_set), numbers(data_set)["within"]
    found = repeated_measures(
        own["general"] + own["likeliness"], own["general"] - 2 * own["loveliness"], list(own["person"])
    )
    assert found.value.value**2 == pytest.approx(known["r_squared"], rel=AGREEMENT)
    assert found.p_value == pytest.approx(known["p"], rel=AGREEMENT)
    assert found.degrees_of_freedom == known["df"]


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_the_f_test_of_an_intraclass_correlation_agrees_with_r(data_set: str) -> None:
    own, known = rows(data_set), numbers(data_set)["between"]
    found = intraclass(own["general"], list(own["person"]))
    assert found.p_value == pytest.approx(known["p"], rel=AGREEMENT)
    assert [found.num_people - 1, found.num_values - found.num_people] == known["df"]


def test_the_intraclass_correlation_of_shrout_and_fleiss_is_found_on_their_data() -> None:
    # Shrout and Fleiss 1979, tables 2 and 4: six targets, four judges, ICC(1, 1) = .17.
    table = np.array([[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]])
    found = intraclass(table.ravel(), np.repeat(list("abcdef"), 4).tolist())
    assert found.value.value == pytest.approx(0.1657, abs=5e-5)
    assert (found.value.low, found.value.high) == pytest.approx((-0.1329, 0.7226), abs=5e-5)


@given(PAIRS)
def test_a_correlation_is_scipys_or_says_why_there_is_none(pairs: list[tuple[int, int]]) -> None:
    x, y = [one for one, _ in pairs], [two for _, two in pairs]
    try:
        found = pearson(x, y)
    except Undefined:
        line = np.linalg.matrix_rank(np.array(pairs) - pairs[0]) < 2 if pairs else True
        assert len(pairs) < 4 or line
        return
    oracle = stats.pearsonr(x, y)
    low, high = oracle.confidence_interval()
    assert (found.value.value, found.value.low, found.value.high, found.p_value) == pytest.approx(
        (oracle.statistic, low, high, oracle.pvalue), abs=1e-9
    )


@given(RATED)
def test_whoever_rates_everything_higher_changes_nothing_within_persons(rated: list[tuple[str, int, int]]) -> None:
    people, x, y = ([row[0] for row in rated], [row[1] for row in rated], [row[2] for row in rated])
    shift = {"a": 0, "b": 7, "c": -3, "d": 100}
    try:
        found = repeated_measures(x, y, people)
    except Undefined:
        return
    shifted = repeated_measures([one + shift[who] for one, who in zip(x, people, strict=True)], y, people)
    assert shifted.value.value == pytest.approx(found.value.value, abs=1e-9)
    assert -1 < found.value.low <= found.value.value <= found.value.high < 1


def test_people_with_one_pair_do_not_count_within_persons() -> None:
    x, y, people = [1, 2, 4, 5, 3, 2], [2, 1, 5, 3, 4, 2], list("aaabbb")
    found = repeated_measures(x, y, people)
    assert repeated_measures([*x, 5], [*y, 1], [*people, "c"]) == found
    assert (found.num_pairs, found.num_people) == (6, 2)


def test_people_who_differ_only_as_persons_correlate_over_all_and_not_within() -> None:
    x, y = [1, 2, 1, 2, 4, 5, 4, 5], [1, 1, 2, 2, 4, 4, 5, 5]
    assert pearson(x, y).value.value == pytest.approx(0.9)
    assert repeated_measures(x, y, list("aaaabbbb")).value.value == pytest.approx(0)


@given(st.lists(st.tuples(st.sampled_from("abcde"), st.integers(1, 5)), max_size=30))
def test_an_intraclass_correlation_is_finite_and_in_order_or_says_why(rated: list[tuple[str, int]]) -> None:
    try:
        found = intraclass([value for _, value in rated], [who for who, _ in rated])
    except Undefined:
        return
    assert found.value.low <= found.value.value <= found.value.high < 1
    assert 0 <= found.p_value <= 1


@pytest.mark.parametrize(
    ("compute", "reason"),
    [
        (lambda: pearson([1, 2, 3], [1, 3, 2]), "there are 3"),
        (lambda: pearson([1, 1, 1, 1], [1, 2, 3, 4]), "of 4 pairs one does not"),
        (lambda: pearson([1, 2, 3, 4], [4, 3, 2, 1]), r"r = -1"),
        (lambda: repeated_measures([1, 2, 3], [1, 2, 3], ["a", "a", "b"]), "2 pairs of 1 people"),
        (lambda: intraclass([1, 2], ["a", "b"]), "2 values of 2 people"),
        (lambda: intraclass([1, 1, 2, 2], ["a", "a", "b", "b"]), "none of 2"),
    ],
)
def test_what_the_data_do_not_determine_is_said_with_the_numbers(compute: object, reason: str) -> None:
    with pytest.raises(Undefined, match=reason):
        compute()  # type: ignore[operator]


def test_columns_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="not 1 for 2"):
        pearson([1, 2], [1])
    with pytest.raises(ValueError, match="there are 1"):
        intraclass([1, 2], ["a"])
