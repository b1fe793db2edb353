import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tests.unit.analysis.golden_numbers import AGREEMENT, DATA_SETS, numbers, rows
from webapp.analysis.censoring import Undefined
from webapp.analysis.variances import brown_forsythe, pitman_morgan, variance_interval, variance_ratio

RATINGS = st.lists(st.integers(1, 7), min_size=2, max_size=30)
PAIRS = st.lists(st.tuples(st.integers(1, 5), st.integers(1, 5)), max_size=25)


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_three_tests_of_variances_agree_with_r(data_set: str) -> None:
    own, known = rows(data_set), numbers(data_set)
    groups = [own["general"][own["likeliness"] == level].to_numpy() for level in (0, 1)]
    ratio, expected = variance_ratio(*groups), known["variances"]
    assert (ratio.ratio.value, ratio.ratio.low, ratio.ratio.high, ratio.p_value) == pytest.approx(
        (expected["ratio"], expected["low"], expected["high"], expected["p"]), rel=AGREEMENT
    )
    brown, expected = brown_forsythe(*groups), known["brown_forsythe"]
    assert (brown.statistic, brown.p_value) == pytest.approx((expected["f"], expected["p"]), rel=AGREEMENT)
    size = min(map(len, groups))
    morgan, expected = pitman_morgan(*(group[:size] for group in groups)), known["pitman_morgan"]
    assert (morgan.statistic, morgan.p_value) == pytest.approx((expected["t"], expected["p"]), rel=AGREEMENT)


@given(RATINGS, RATINGS)
def test_exchanging_two_samples_inverts_their_ratio_and_keeps_its_p_value(a: list[int], b: list[int]) -> None:
    if 1 in (len(set(a)), len(set(b))):
        with pytest.raises(Undefined, match="needs values that vary"):
            variance_ratio(a, b)
        return
    found, other = variance_ratio(a, b), variance_ratio(b, a)
    assert found.ratio.low == pytest.approx(1 / other.ratio.high)
    assert found.p_value == pytest.approx(other.p_value)
    assert (found.p_value < 0.05) is not (found.ratio.low <= 1 <= found.ratio.high)


@given(RATINGS)
def test_the_ends_of_an_interval_of_a_variance_are_where_the_found_one_has_probability_025(values: list[int]) -> None:
    if len(set(values)) == 1:
        return
    found, freedom = variance_interval(values), len(values) - 1
    assert stats.chi2.sf(freedom * found.value / found.low, freedom) == pytest.approx(0.025)
    assert stats.chi2.cdf(freedom * found.value / found.high, freedom) == pytest.approx(0.025)


@given(st.lists(RATINGS, min_size=1, max_size=4))
def test_brown_forsythe_is_the_analysis_of_variance_of_distances_from_medians(samples: list[list[int]]) -> None:
    distances = [np.abs(np.array(one) - np.median(one)) for one in samples]
    if len(samples) == 1 or all(np.ptp(one) == 0 for one in distances):
        with pytest.raises(Undefined, match="Brown-Forsythe"):
            brown_forsythe(*samples)
        return
    found, pooled = brown_forsythe(*samples), np.concatenate(distances)
    within = sum(np.var(one) * len(one) for one in distances)
    between = np.var(pooled) * len(pooled) - within
    freedoms = len(samples) - 1, len(pooled) - len(samples)
    expected = (between / freedoms[0]) / (within / freedoms[1])
    assert found.statistic == pytest.approx(expected, abs=1e-9)
    assert found.p_value == pytest.approx(stats.f.sf(max(0.0, expected), *freedoms), abs=1e-7)
    assert found.note == f"F({len(samples) - 1}, {sum(map(len, samples)) - len(samples)})"


@given(PAIRS)
def test_pitman_morgan_is_positive_where_the_first_varies_more_and_symmetric(pairs: list[tuple[int, int]]) -> None:
    a, b = [one for one, _ in pairs], [two for _, two in pairs]
    try:
        found = pitman_morgan(a, b)
    except Undefined:
        return
    gap = np.var(a) - np.var(b)
    assert (found.statistic > 1e-9) is bool(gap > 1e-9)
    other = pitman_morgan(b, a)
    assert other.statistic == pytest.approx(-found.statistic, abs=1e-9)
    assert other.p_value == pytest.approx(found.p_value)


def test_pitman_morgan_sees_what_the_f_test_of_correlated_pairs_misses() -> None:
    rng = np.random.default_rng(3)
    shared = rng.normal(size=60)
    first, second = shared + rng.normal(size=60) * 0.1, 1.25 * shared + rng.normal(size=60) * 0.1
    assert variance_ratio(first, second).p_value > 0.05
    assert pitman_morgan(first, second).p_value < 1e-6


@pytest.mark.parametrize(
    ("compute", "reason"),
    [
        (lambda: variance_interval([3]), "there is 1"),
        (lambda: variance_interval([]), "there are 0"),
        (lambda: variance_ratio([1, 2], [4, 4, 4]), "all 3 are 4"),
        (lambda: brown_forsythe([1, 2]), "one sample"),
        (lambda: brown_forsythe([1, 2], [3]), "there are 2, 1"),
        (lambda: brown_forsythe([1, 5], [2, 4]), r"\(2, 2 values\)"),
        (lambda: pitman_morgan([1, 2, 3], [2, 3, 5]), "there are 3"),
        (lambda: pitman_morgan([1, 2, 3, 4], [2, 3, 4, 5]), "of 4 pairs one does not"),
    ],
)
def test_what_the_data_do_not_determine_is_said_with_the_numbers(compute: object, reason: str) -> None:
    with pytest.raises(Undefined, match=reason):
        compute()  # type: ignore[operator]


def test_pairs_without_a_second_value_are_refused() -> None:
    with pytest.raises(ValueError, match="not 1 for 2"):
        pitman_morgan([1, 2], [1])
