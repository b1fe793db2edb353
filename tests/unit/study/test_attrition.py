import itertools
import math
import random
import sys
from math import comb

import pytest
from scipy import stats

from webapp.study.attrition import NUM_PERMUTATIONS, chi_square_survival, compare_drop_out


@pytest.mark.parametrize("df", range(1, 41))
def test_tails_of_chi_square_are_scipys(df: int) -> None:
    for statistic in (0, 1e-9, 0.1, 1, 3.841, 10, 50, 200, 3000):
        assert math.isclose(
            chi_square_survival(statistic, df), stats.chi2.sf(statistic, df), rel_tol=1e-10, abs_tol=1e-300
        )


@pytest.mark.parametrize(("statistic", "df"), [(-1, 2), (1, 0)])
def test_tails_that_do_not_exist_are_refused(statistic: float, df: int) -> None:
    with pytest.raises(ValueError, match="a chi-square is at least 0"):
        chi_square_survival(statistic, df)


@pytest.mark.parametrize(
    ("started", "dropped"), [((100, 120), (10, 30)), ((90, 100, 80, 70), (20, 20, 9, 15)), ((50, 50, 50), (45, 30, 44))]
)
def test_where_many_dropped_the_test_is_pearsons(started: tuple[int, ...], dropped: tuple[int, ...]) -> None:
    test = compare_drop_out(started, dropped, seed=1)
    assert test is not None
    table = [dropped, [begun - lost for begun, lost in zip(started, dropped, strict=True)]]
    expected = stats.chi2_contingency(table, correction=False)
    assert (test.method, test.standard_error, test.df) == ("chi_square", None, expected.dof)
    assert (test.statistic, test.p_value) == pytest.approx((expected.statistic, expected.pvalue))


@pytest.mark.parametrize(
    ("started", "dropped"),
    [((30, 31), (2, 5)), ((12, 9, 11), (1, 0, 4)), ((5, 5, 5, 5), (5, 4, 5, 2)), ((400, 3, 380), (40, 2, 30))],
)
def test_where_few_dropped_the_p_value_is_that_of_all_permutations_within_its_error(
    started: tuple[int, ...], dropped: tuple[int, ...]
) -> None:
    test = compare_drop_out(started, dropped, seed=3)
    assert test is not None
    assert test.method == "permutation"
    exact = exact_p_value(started, dropped)
    assert test.standard_error is not None
    assert test.standard_error == pytest.approx(
        math.sqrt(test.p_value * (1 - test.p_value) / (NUM_PERMUTATIONS + 1)), rel=1e-9
    )
    assert abs(test.p_value - exact) < 4 * test.standard_error + 1 / NUM_PERMUTATIONS


def test_a_p_value_is_above_0_however_uneven_the_arms_are() -> None:
    test = compare_drop_out((100_000, 100_000), (60_000, 40_000), seed=1)
    assert test is not None
    assert (test.method, test.p_value) == ("chi_square", sys.float_info.min)


def test_the_same_seed_gives_the_same_p_value_and_another_one_does_not() -> None:
    tests = [compare_drop_out((30, 31), (2, 5), seed) for seed in (1, 1, 2)]
    p_values = [test.p_value for test in tests if test is not None]
    assert p_values[0] == p_values[1] != p_values[2]


@pytest.mark.parametrize(
    ("started", "dropped"),
    [((), ()), ((50,), (3,)), ((50, 0), (3, 0)), ((20, 30), (0, 0)), ((20, 30), (20, 30)), ((0, 0), (0, 0))],
)
def test_where_there_is_nothing_to_compare_there_is_no_test(started: tuple[int, ...], dropped: tuple[int, ...]) -> None:
    assert compare_drop_out(started, dropped, seed=1) is None


def test_an_arm_that_nobody_started_takes_no_degree_of_freedom() -> None:
    assert compare_drop_out((100, 0, 120), (10, 0, 30), 1) == compare_drop_out((100, 120), (10, 30), 1)


@pytest.mark.parametrize(("started", "dropped"), [((3, 3), (4, 0)), ((3, 3), (-1, 0)), ((3, 3), (1,))])
def test_more_drop_outs_than_trials_are_refused(started: tuple[int, ...], dropped: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"drop-outs must be|zip\(\)"):
        compare_drop_out(started, dropped, seed=1)


def test_equal_arms_are_called_different_no_more_often_than_the_level_although_people_drop_once() -> None:
    chooser = random.Random(11)
    num_alarms = sum(is_alarm(chooser) for _ in range(400))
    assert num_alarms <= 400 * 0.05 + 3 * math.sqrt(400 * 0.05 * 0.95)


def is_alarm(chooser: random.Random) -> bool:
    """150 people, each with her own readiness to leave, see three kinds in random order until one drops out."""
    started, dropped = [0, 0, 0], [0, 0, 0]
    for _ in range(150):
        readiness = chooser.choice((0.02, 0.3))
        for kind in chooser.sample(range(3), 3):
            started[kind] += 1
            if chooser.random() < readiness:
                dropped[kind] += 1
                break
    test = compare_drop_out(started, dropped, seed=1)
    return test is not None and test.p_value < 0.05


def exact_p_value(started: tuple[int, ...], dropped: tuple[int, ...]) -> float:
    """The chance, over all ways of dealing the drop-outs out to trials, of a chi-square as large."""
    share = sum(dropped) / sum(started)

    def statistic(lost: tuple[int, ...]) -> float:
        return sum((seen - share * begun) ** 2 / begun for begun, seen in zip(started, lost, strict=True))

    as_uneven = total = 0
    for lost in itertools.product(*(range(begun + 1) for begun in started[:-1])):
        last = sum(dropped) - sum(lost)
        if not 0 <= last <= started[-1]:
            continue
        ways = math.prod(comb(begun, seen) for begun, seen in zip(started, (*lost, last), strict=True))
        total += ways
        as_uneven += ways if statistic((*lost, last)) >= statistic(dropped) - 1e-9 else 0
    return as_uneven / total
