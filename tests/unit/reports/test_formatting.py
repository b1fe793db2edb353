import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.reports.blocks import Cell, Column, ColumnKind
from webapp.reports.formatting import listed, p_clause, p_value, plain, shown


@pytest.mark.parametrize(
    ("cell", "kind", "digits", "told"),
    [
        (None, "number", 2, "\N{EN DASH}"),
        (math.nan, "number", 2, "\N{EN DASH}"),
        (np.float64("nan"), "p", 2, "\N{EN DASH}"),
        (-0.001, "number", 2, "0.00"),
        (-1.239, "number", 2, "\N{MINUS SIGN}1.24"),
        (-math.inf, "number", 2, "\N{MINUS SIGN}∞"),
        (0.4249, "percent", 0, "42\xa0%"),
        (0.4249, "percent", 1, "42.5\xa0%"),
        (12345, "count", 2, "12,345"),
        (np.int64(-3), "count", 2, "\N{MINUS SIGN}3"),
        (0.0123, "p", 2, ".012"),
        (0.0009999, "p", 2, "<\xa0.001"),
        (0.0, "p", 2, "<\xa0.001"),
        (1.0, "p", 2, ">\xa0.999"),
        (True, "text", 2, "yes"),
        (np.bool_(False), "text", 2, "no"),
        ("full \N{MINUS SIGN} random", "text", 2, "full \N{MINUS SIGN} random"),
        (7, "text", 2, "7"),
    ],
)
def test_a_cell_is_shown_as_its_column_says(cell: Cell, kind: ColumnKind, digits: int, told: str) -> None:
    assert shown(cell, Column("name", "Name", kind, digits)) == told


@given(st.floats(0, 1))
def test_no_p_value_is_shown_as_0_or_1_or_on_the_wrong_side_of_the_level(value: float) -> None:
    told = p_value(value)
    assert told[0] in ".<>"
    assert told not in {".000", "1.000"}
    if told[0] == ".":
        assert abs(float(told) - value) <= 0.0005 + 1e-12


def test_a_p_value_stands_in_a_sentence() -> None:
    assert p_clause(0.0123) == "p\xa0=\xa0.012"
    assert p_clause(1e-9) == "p\xa0<\xa0.001"


def test_words_are_listed_as_in_a_sentence() -> None:
    assert [listed(list(words)) for words in ("", "a", "ab", "abc")] == ["", "a", "a and b", "a, b and c"]


@given(st.one_of(st.none(), st.booleans(), st.integers(), st.text(), st.floats(allow_nan=False)))
def test_a_plain_cell_stays_as_it_is(cell: Cell) -> None:
    assert plain(cell) is cell or plain(cell) == cell
