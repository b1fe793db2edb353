import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from webapp.analysis.calibration import discrimination, within_and_between
from webapp.analysis.censoring import Undefined
from webapp.analysis.shares import mean_of_several, share_of

JUDGED = st.lists(st.tuples(st.sampled_from("abcde"), st.integers(1, 5), st.booleans()), min_size=1, max_size=30)


@given(JUDGED, st.integers(0, 100))
@settings(max_examples=60)
def test_the_area_is_mann_whitneys_and_gamma_counts_pairs(judged: list[tuple[str, int, bool]], seed: int) -> None:
    people, ratings, right = zip(*judged, strict=True)
    given_, is_right = np.array(ratings, dtype=float), np.array(right)
    if is_right.all() or not is_right.any():
        with pytest.raises(Undefined, match="discrimination needs right and wrong outcomes"):
            discrimination(people, ratings, right, np.random.default_rng(seed), 50)
        return
    found = discrimination(people, ratings, right, np.random.default_rng(seed), 50)
    u = stats.mannwhitneyu(given_[is_right], given_[~is_right], method="asymptotic").statistic
    assert found.area == pytest.approx(u / (is_right.sum() * (~is_right).sum()))
    signs = np.sign(np.subtract.outer(given_[is_right], given_[~is_right]))
    if not signs.any():
        assert found.gamma is None
    else:
        assert found.gamma == pytest.approx(signs.sum() / np.abs(signs).sum())
    for interval in (found.area_interval, found.gamma_interval):
        assert interval is None or interval[0] <= interval[1]


def test_the_bootstrap_over_people_is_wider_where_people_repeat_themselves() -> None:
    rng = np.random.default_rng(4)
    ratings, right = rng.integers(1, 6, 40), rng.random(40) < 0.5
    people = [f"p{number}" for number in range(40)]
    alone = discrimination(people, ratings, right, np.random.default_rng(0))
    fivefold = discrimination(people * 5, np.tile(ratings, 5), np.tile(right, 5), np.random.default_rng(0))
    assert alone.area_interval == pytest.approx(fivefold.area_interval, abs=0.02)
    independent = [f"p{number}" for number in range(200)]
    narrow = discrimination(independent, np.tile(ratings, 5), np.tile(right, 5), np.random.default_rng(0)).area_interval
    assert narrow is not None
    assert fivefold.area_interval is not None
    assert narrow[1] - narrow[0] < 0.6 * (fivefold.area_interval[1] - fivefold.area_interval[0])


@given(st.lists(st.tuples(st.sampled_from("abc"), st.integers(1, 5)), min_size=1, max_size=20))
def test_parts_within_and_between_add_up_and_are_apart(rated: list[tuple[str, int]]) -> None:
    frame = within_and_between(pd.DataFrame(rated, columns=["participant", "rating"]), "rating")
    assert (frame["between"] + frame["within"]).to_numpy() == pytest.approx(frame["rating"].to_numpy(), abs=1e-8)
    assert frame.groupby("participant")["within"].sum().to_numpy() == pytest.approx(0, abs=1e-7)
    assert float((frame["within"] * frame["between"]).sum()) == pytest.approx(0, abs=1e-6)


def test_the_cluster_interval_is_the_sandwich_of_a_regression_on_a_constant() -> None:
    rng = np.random.default_rng(1)
    people = [f"p{number}" for number in np.repeat(np.arange(30), 3)]
    right = rng.random(90) < np.repeat(rng.random(30), 3)
    found = share_of(people, right)
    residuals = pd.Series(right - right.mean()).groupby(people).sum()
    error = np.sqrt(30 / 29 * (residuals**2).sum()) / 90
    assert found.cluster is not None
    assert found.cluster[1] - found.value == pytest.approx(stats.t.ppf(0.975, 29) * error)
    assert (found.num, found.total, found.num_people) == (int(right.sum()), 90, 30)


@pytest.mark.parametrize(("people", "right"), [(["a", "a"], [True, False]), (["a", "b"], [True, True])])
def test_without_spread_between_people_there_is_no_cluster_interval(people: list[str], right: list[bool]) -> None:
    found = share_of(people, right)
    assert found.cluster is None
    assert found.wilson[0] < 1


def test_the_cluster_interval_of_eight_people_covers_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    people = [f"p{number}" for number in np.repeat(np.arange(8), 3)]
    hits = 0
    for _ in range(600):
        found = mean_of_several(people, np.repeat(rng.normal(size=8), 3) + rng.normal(size=24))
        assert found.interval is not None
        hits += found.interval[0] <= 0 <= found.interval[1]
    # With the normal quantile it is 90 %.
    assert 0.93 < hits / 600 < 0.975


def test_a_mean_of_nothing_is_none() -> None:
    with pytest.raises(Undefined, match="a mean needs a value"):
        mean_of_several([], [])
