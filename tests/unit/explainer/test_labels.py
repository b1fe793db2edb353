from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.explainer import labels
from webapp.explainer.labels import RowLabels, are_distinct


class Place(NamedTuple):
    row: int
    column: int


PLACES = st.lists(st.builds(Place, st.integers(-3, 3), st.integers(0, 9)), min_size=1, max_size=12, unique=True)


def as_rows(places: Sequence[Place]) -> RowLabels:
    return RowLabels(np.array(places, dtype=np.int32), Place._make)


@given(PLACES, st.data())
def test_labels_made_from_rows_are_like_a_tuple_of_them(places: list[Place], data: st.DataObject) -> None:
    rows, expected = as_rows(places), tuple(places)
    assert len(rows) == len(expected)
    assert (rows == expected, expected == rows, hash(rows) == hash(expected)) == (True, True, True)
    assert tuple(rows) == expected
    assert all(isinstance(label, Place) for label in rows)
    part = slice(*data.draw(st.tuples(*[st.integers(-13, 13)] * 2)))
    assert rows[part] == expected[part]
    place = data.draw(st.integers(-len(expected), len(expected) - 1))
    assert rows[place] == expected[place]
    assert isinstance(rows[place], Place)
    assert (rows.index(expected[place]), expected[place] in rows) == (place % len(expected), True)
    other = data.draw(PLACES)
    assert (rows == as_rows(other), rows == tuple(other)) == (expected == tuple(other),) * 2


def test_components_are_plain_numbers_which_json_can_write() -> None:
    assert [type(part) for part in (*as_rows([Place(1, 2)])[0], *next(iter(as_rows([Place(1, 2)]))))] == [int] * 4  # type: ignore[misc]


def test_labels_are_no_list_and_end_where_the_rows_do() -> None:
    rows = as_rows([Place(1, 2), Place(3, 4)])
    assert rows != [Place(1, 2), Place(3, 4)]
    with pytest.raises(IndexError):
        rows[2]


def test_an_array_of_the_labels_is_that_of_their_components(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = RowLabels(np.array([[1, 2], [3, 4]], dtype=np.int32), lambda _: pytest.fail("no label is needed"))
    wide = np.array(rows, dtype=np.int64)
    assert wide.tolist() == [[1, 2], [3, 4]]
    assert wide.dtype == np.int64
    wide[0, 0] = 9
    assert rows.rows[0, 0] == 1
    monkeypatch.setattr(labels, "_CHUNK", 1)
    assert list(as_rows([Place(1, 2), Place(3, 4)])) == [(1, 2), (3, 4)]


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        ([[1, 2], [0, 5], [1, 2]], "the state labels are not distinct"),
        ([[2**60, 2], [0, -1], [2**60, 2]], "the state labels are not distinct"),
        ([[2**63 - 1, 2], [-(2**63), 0], [2**63 - 1, 2]], "the state labels are not distinct"),
        ([1, 2], r"must be \[S, C\] integers, not \(2,\) of int64"),
        ([[0.5]], r"must be \[S, C\] integers, not \(1, 1\) of float64"),
    ],
)
def test_rows_that_cannot_be_labels_are_refused(rows: list[object], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        RowLabels(np.array(rows), tuple)


@pytest.mark.parametrize("far", [2**60, 2**63 - 1])
def test_numbers_of_any_size_and_no_numbers_at_all_are_labels(far: int) -> None:
    rows = [[far, 2], [-far, 0], [far, 3]]
    assert list(RowLabels(np.array(rows), tuple)) == [tuple(row) for row in rows]
    assert len(RowLabels(np.zeros((0, 2), dtype=np.int64), tuple)) == 0
    assert list(RowLabels(np.zeros((1, 0), dtype=np.int64), tuple)) == [()]
    with pytest.raises(ValueError, match="not distinct"):
        RowLabels(np.zeros((2, 0), dtype=np.int64), tuple)


def test_labels_are_distinct_if_no_two_are_alike() -> None:
    assert are_distinct(("a", "b"))
    assert not are_distinct(("a", "b", "a"))
    assert are_distinct(as_rows([Place(0, 0), Place(0, 1)]))
