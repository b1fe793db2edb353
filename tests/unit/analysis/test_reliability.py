import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from webapp.analysis.censoring import Undefined
from webapp.analysis.reliability import cronbach_alpha, mcdonald_omega, mean_correlation_interval, omega_interval

FOLDER = Path(__file__).parents[2] / "golden" / "analysis"
GOLDEN: dict[str, Any] = json.loads((FOLDER / "reliability.json").read_text())
ITEMS = pd.read_csv(FOLDER / "reliability.csv").to_numpy(dtype=float)
ANSWERS = st.tuples(st.integers(1, 14), st.integers(1, 5)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=st.integers(1, 5).map(float))
)


def test_alpha_and_feldts_interval_are_rs() -> None:
    found = cronbach_alpha(ITEMS)
    ours = (found.value, found.low, found.high, found.mean_correlation)
    assert ours == pytest.approx([GOLDEN[name] for name in ("alpha", "low", "high", "mean_correlation")], rel=1e-9)


def test_omega_and_loadings_are_those_of_rs_factor_analysis() -> None:
    found = mcdonald_omega(ITEMS)
    assert found.value == pytest.approx(GOLDEN["omega"], rel=1e-6)
    assert found.loadings == pytest.approx(GOLDEN["loadings"], rel=1e-5)
    assert not found.is_improper


def test_items_that_are_equally_good_have_alpha_and_omega_alike() -> None:
    rng = np.random.default_rng(1)
    items = rng.normal(size=(20_000, 1)) + rng.normal(size=(20_000, 4))
    truth = 16 / (16 + 4)
    assert cronbach_alpha(items).value == pytest.approx(truth, abs=0.01)
    assert mcdonald_omega(items).value == pytest.approx(truth, abs=0.01)


def test_feldts_interval_covers_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(2)
    hits = 0
    for _ in range(300):
        found = cronbach_alpha(rng.normal(size=(30, 1)) + rng.normal(size=(30, 4)))
        hits += found.low <= 0.8 <= found.high
    assert 273 <= hits <= 297


@given(ANSWERS)
@settings(max_examples=80)
def test_any_answers_give_numbers_or_a_reason(items: NDArray[np.float64]) -> None:
    for estimate in (cronbach_alpha, mcdonald_omega):
        try:
            found = estimate(items)
        except Undefined:
            continue
        assert np.isfinite(found.value)
        assert found.value <= 1 + 1e-9


@pytest.mark.parametrize(
    ("items", "message"),
    [
        ([[1, 2]], "reliability needs 2 people and 2 items or more, not 1 and 2"),
        ([[1], [2]], "reliability needs 2 people and 2 items or more, not 2 and 1"),
        ([[1, 3], [2, 3]], "1 of 2 items do not vary between 2 people"),
        ([[1, 3], [3, 1], [2, 2], [1, 3], [3, 1]], "alpha needs a sum that varies, and all 5 people have the same"),
        ([[1, 2], [2, 3], [3, 5]], "the reliability of 2 items needs 5 people or more, not 3"),
        ([[n, n + 1, n % 3, n % 2, 5 - n, n] for n in range(6)], "the reliability of 6 items needs 7 people or more"),
        ([[1, 2], [2, 3], [3, 4], [4, 5], [5, 6]], "alpha is 1 exactly: the 2 items of all 5 people"),
    ],
)
def test_alpha_says_what_is_missing(items: list[list[float]], message: str) -> None:
    with pytest.raises(Undefined, match=message):
        cronbach_alpha(items)


def test_omega_says_what_is_missing() -> None:
    with pytest.raises(Undefined, match="2 people and 3 items or more, not 3 and 2"):
        mcdonald_omega([[1, 2], [2, 1], [3, 3]])
    with pytest.raises(Undefined, match="a factor of 3 items needs more than 3 people, not 3"):
        mcdonald_omega([[1, 2, 2], [2, 1, 1], [3, 3, 2]])
    rng = np.random.default_rng(3)
    two = rng.normal(size=(20, 2))
    with pytest.raises(Undefined, match="of 3 one does"):
        mcdonald_omega(np.column_stack([two, two.sum(axis=1)]))


def test_the_bootstrap_intervals_cover_about_as_often_as_they_say() -> None:
    rng = np.random.default_rng(9)
    of_omega = of_mean = 0
    for _ in range(30):
        items = rng.normal(size=(60, 1)) + rng.normal(size=(60, 4))
        omega, mean = omega_interval(items, rng, 120), mean_correlation_interval(items, rng, 200)
        assert omega is not None
        assert mean is not None
        of_omega += omega[0] <= 0.8 <= omega[1]
        of_mean += mean[0] <= 0.5 <= mean[1]
    assert of_omega >= 25
    assert of_mean >= 25


def test_the_bootstrap_intervals_are_around_the_estimates_and_the_same_every_time() -> None:
    for estimate, interval in (
        (mcdonald_omega(ITEMS).value, omega_interval),
        (cronbach_alpha(ITEMS).mean_correlation, mean_correlation_interval),
    ):
        found = interval(ITEMS, np.random.default_rng(1), 100)
        assert found == interval(ITEMS, np.random.default_rng(1), 100)
        assert found is not None
        assert found[0] < estimate < found[1]


def test_an_item_that_is_the_same_in_too_many_resamples_leaves_no_interval() -> None:
    items = np.array([[1, 2, 1], [2, 1, 1], [3, 4, 1], [4, 3, 1], [5, 5, 1], [2, 4, 5]], dtype=float)
    assert mean_correlation_interval(items, np.random.default_rng(1), 100) is None
    assert omega_interval(items, np.random.default_rng(1), 100) is None


def test_too_few_people_have_no_bootstrap_interval() -> None:
    with pytest.raises(Undefined, match="needs 5 people or more, not 3"):
        mean_correlation_interval([[1, 2], [2, 1], [3, 5]], np.random.default_rng(1))
    with pytest.raises(Undefined, match="a factor of 3 items needs more than 3 people"):
        omega_interval([[1, 2, 2], [2, 1, 1], [3, 3, 2]], np.random.default_rng(1))


def test_items_that_are_no_table_are_refused() -> None:
    with pytest.raises(ValueError, match="items must be people x items"):
        cronbach_alpha([1, 2, 3])
