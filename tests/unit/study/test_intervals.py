import itertools
import math
import random
import statistics

import pytest
from scipy import stats

from webapp.study.intervals import (
    LEVEL,
    Group,
    cluster_interval,
    mean_interval,
    normal_quantile,
    t_quantile,
    wilson_interval,
)

PROBABILITIES = (1e-6, 0.025, 0.3, 0.5, 0.51, 0.9, 0.975, 0.995, 0.9999, 1 - 1e-6)


@pytest.mark.parametrize("df", [*range(1, 41), 99, 500, 9_999, 1_000_000])
def test_quantiles_of_t_are_scipys(df: int) -> None:
    for probability in PROBABILITIES:
        assert math.isclose(t_quantile(probability, df), stats.t.ppf(probability, df), rel_tol=1e-8, abs_tol=1e-8), (
            probability
        )


def test_t_goes_over_into_the_normal_distribution() -> None:
    assert math.isclose(t_quantile(0.975, 10**6), normal_quantile(0.975), rel_tol=1e-5)
    assert math.isclose(normal_quantile(0.975), stats.norm.ppf(0.975))


@pytest.mark.parametrize(("probability", "df"), [(0, 3), (1, 3), (-0.1, 3), (0.9, 0)])
def test_quantiles_that_do_not_exist_are_refused(probability: float, df: int) -> None:
    with pytest.raises(ValueError, match=r"between 0 and 1|at least 1 degree"):
        t_quantile(probability, df)


def test_the_interval_of_a_mean_is_scipys() -> None:
    values = [1.0, 2.5, 2.0, 5.0, 3.0]
    mean, sd = statistics.mean(values), statistics.stdev(values)
    expected = stats.t.interval(LEVEL, len(values) - 1, loc=mean, scale=stats.sem(values))
    assert mean_interval(mean, sd, len(values)) == pytest.approx(expected, rel=1e-9)
    with pytest.raises(ValueError, match="at least 2 values, not 1"):
        mean_interval(3.0, 1.0, 1)


@pytest.mark.parametrize("n", [1, 2, 7, 100, 10_000])
def test_intervals_of_shares_are_wilsons_as_scipy_has_them(n: int) -> None:
    for num in {0, 1, n // 3, n - 1, n}:
        expected = stats.binomtest(num, n).proportion_ci(LEVEL, method="wilson")
        lower, upper = wilson_interval(num, n)
        assert (lower, upper) == pytest.approx((expected.low, expected.high), abs=1e-12)
        assert 0 <= lower <= num / n <= upper <= 1


@pytest.mark.parametrize(("num", "n"), [(0, 0), (3, 2), (-1, 5)])
def test_shares_of_nothing_are_refused(num: int, n: int) -> None:
    with pytest.raises(ValueError, match="a share needs"):
        wilson_interval(num, n)


def test_where_everybody_gives_one_value_a_cluster_is_a_person_and_the_interval_is_that_of_a_mean() -> None:
    values = [0, 1, 1, 0, 1, 1, 1]
    half = normal_quantile(0.975) * statistics.stdev(values) / math.sqrt(len(values))
    mean = statistics.mean(values)
    assert cluster_interval((value, 1, 1) for value in values) == pytest.approx((mean - half, mean + half))


def test_people_who_gave_the_same_may_stand_together() -> None:
    apart: list[Group] = [(2, 3, 1), (2, 3, 1), (0, 1, 1), (4, 4, 1), (0, 1, 1)]
    together: list[Group] = [(2, 3, 2), (0, 1, 2), (4, 4, 1)]
    assert cluster_interval(apart) == pytest.approx(cluster_interval(together))


def test_one_person_has_no_spread() -> None:
    assert cluster_interval([(3, 4, 1)]) is None
    assert cluster_interval([]) is None


def test_a_cluster_interval_holds_the_truth_as_often_as_it_says_where_people_repeat_themselves() -> None:
    chooser = random.Random(7)
    held = naive = 0
    for _ in range(600):
        groups: list[Group] = []
        for _ in range(60):
            n, chance = chooser.randint(1, 6), chooser.choice((0.1, 0.9))  # A share of a half over all people.
            groups.append((sum(chooser.random() < chance for _ in range(n)), n, 1))
        interval = cluster_interval(groups)
        assert interval is not None
        held += interval[0] <= 0.5 <= interval[1]
        alone = wilson_interval(sum(total for total, *_ in groups), sum(n for _, n, _ in groups))
        naive += alone[0] <= 0.5 <= alone[1]
    assert 0.92 <= held / 600 <= 0.975
    assert naive / 600 < 0.85


def test_higher_levels_give_wider_intervals() -> None:
    widths = [mean_interval(0.0, 1.0, 5, level)[1] for level in (0.5, 0.8, 0.95, 0.999)]
    assert all(narrow < wide for narrow, wide in itertools.pairwise(widths))
