import re
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from webapp.analysis.multiplicity import holm

P_VALUES = st.lists(st.floats(0, 1), max_size=8)


def rejected_step_by_step(p_values: list[float], alpha: float) -> set[int]:
    """Holm's procedure as he states it: reject from the smallest p value on and stop at the first that is too large."""
    rejected: set[int] = set()
    for rank, test in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        if p_values[test] * (len(p_values) - rank) > alpha:
            break
        rejected.add(test)
    return rejected


def test_a_published_example_is_adjusted_as_published() -> None:
    # The four p values with which the Holm-Bonferroni method is commonly explained: at 0.05 the first and last fall.
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


@given(P_VALUES, st.floats(0, 0.999))
def test_what_is_adjusted_to_the_level_or_less_is_what_the_procedure_rejects(values: list[float], alpha: float) -> None:
    assert set(np.flatnonzero(holm(values) <= alpha)) == rejected_step_by_step(values, alpha)


@given(P_VALUES)
def test_adjusted_values_lie_between_the_given_ones_and_bonferronis_in_the_same_order(values: list[float]) -> None:
    given_values, adjusted = np.array(values), holm(values)
    assert (adjusted >= given_values).all()
    assert (adjusted <= np.minimum(1, len(values) * given_values)).all()
    assert (np.diff(adjusted[np.argsort(given_values)]) >= 0).all()


@given(P_VALUES, st.randoms(use_true_random=False))
def test_the_order_of_the_tests_does_not_matter(values: list[float], random: Random) -> None:
    order = list(range(len(values)))
    random.shuffle(order)
    assert holm([values[test] for test in order]).tolist() == holm(values)[order].tolist()


def test_a_single_p_value_stays_and_none_stay_none() -> None:
    assert holm([0.2]).tolist() == [0.2]
    assert holm([]).tolist() == []


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([0.1, np.nan], "a p value must lie from 0 to 1, not at nan"),
        ([0.1, 1.5], "a p value must lie from 0 to 1, not at 1.5"),
        ([-0.1], "a p value must lie from 0 to 1, not at -0.1"),
        ([[0.1, 0.2]], "p values must be one row, not of shape (1, 2)"),
        (0.1, "p values must be one row, not of shape ()"),
    ],
)
def test_what_is_no_row_of_p_values_is_refused(values: ArrayLike, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        holm(values)
