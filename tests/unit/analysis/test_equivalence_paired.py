import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.analysis.censoring import Undefined
from webapp.analysis.equivalence_paired import conclusion, level_with_skewness, paired_tost

FOLDER = Path(__file__).parents[2] / "golden" / "analysis"
GOLDEN: dict[str, Any] = json.loads((FOLDER / "paired.json").read_text())["tost"]


def test_both_one_sided_tests_and_the_interval_are_rs() -> None:
    data = pd.read_csv(FOLDER / "paired.csv")
    found = paired_tost(data["first"] - data["second"], margin=0.5)
    names = ("t_lower", "p_lower", "t_upper", "p_upper", "low", "high")
    assert [getattr(found, name) for name in names] == pytest.approx([GOLDEN[name] for name in names], rel=1e-9)


@given(
    st.lists(st.integers(-8, 8), min_size=2, max_size=30).filter(lambda values: len(set(values)) > 1),
    st.floats(0.05, 3),
    st.floats(0.01, 0.2),
)
def test_equivalence_is_the_interval_within_the_margin(values: list[int], margin: float, alpha: float) -> None:
    found = paired_tost(np.array(values) / 4, margin, alpha)
    is_inside = -margin < found.low and found.high < margin
    assert is_inside == (found.p_equivalence < alpha)
    assert (found.p_lower < alpha) == (found.low > -margin)


@given(st.lists(st.integers(-8, 8), min_size=2, max_size=20).filter(lambda values: len(set(values)) > 1))
def test_to_swap_the_kinds_swaps_the_sides(values: list[int]) -> None:
    ours, theirs = paired_tost(values, 1.0), paired_tost([-value for value in values], 1.0)
    assert (ours.p_lower, ours.p_upper) == pytest.approx((theirs.p_upper, theirs.p_lower))
    assert ours.p_difference == pytest.approx(theirs.p_difference)


def test_differences_that_are_all_equal_show_no_spread() -> None:
    with pytest.raises(Undefined, match="all 4 are 0"):
        paired_tost([0, 0, 0, 0], 0.5)
    with pytest.raises(Undefined, match="it takes 2 people or more, not 1"):
        paired_tost([1], 0.5)


def test_skewness_shifts_the_level_of_a_one_sided_test_as_foretold() -> None:
    rng = np.random.default_rng(6)
    # Gamma with shape 4 has the skewness 1.
    drawn = rng.gamma(4, size=(40_000, 50)) - 4
    t = drawn.mean(axis=1) / (drawn.std(axis=1, ddof=1) / np.sqrt(50))
    erred = max(float((t < -1.6766).mean()), float((t > 1.6766).mean()))
    assert erred > 0.06
    assert level_with_skewness(1.0, 50, 0.05) == pytest.approx(erred, abs=0.004)
    assert level_with_skewness(-1.0, 50, 0.05) == level_with_skewness(1.0, 50, 0.05)


@pytest.mark.parametrize(("margin", "alpha"), [(0, 0.05), (-1, 0.05), (np.inf, 0.05), (0.5, 0), (0.5, 0.5)])
def test_a_margin_or_level_that_makes_no_sense_is_refused(margin: float, alpha: float) -> None:
    with pytest.raises(ValueError, match=r"a margin must be|the level must lie"):
        paired_tost([1, 2], margin, alpha)


@pytest.mark.parametrize(
    ("p_equivalence", "p_difference", "expected"),
    [
        (0.01, 0.5, "equivalent"),
        (0.01, 0.01, "equivalent though different"),
        (0.5, 0.01, "different"),
        (0.5, 0.5, "undecided"),
        (0.05, 0.06, "undecided"),
        (0.06, 0.05, "undecided"),
        (0.049, 0.05, "equivalent"),
    ],
)
def test_there_are_four_conclusions(p_equivalence: float, p_difference: float, expected: str) -> None:
    assert conclusion(p_equivalence, p_difference, 0.05) == expected
