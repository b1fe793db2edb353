import csv
import io
import math
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from webapp.reports.blocks import Cell, Column, Table
from webapp.reports.csv_tables import csv_of

TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\r\0"))


def read(table: Table) -> list[list[str]]:
    return list(csv.reader(io.StringIO(csv_of(table).decode(), newline="")))


def one_column(*cells: Cell) -> Table:
    columns = (Column("value", "Value"), Column("more", "More"))
    return Table("table", "Table", columns, tuple((each, 1) for each in cells))


@given(st.lists(st.floats(allow_nan=False)))
def test_a_file_has_all_digits(values: list[float]) -> None:
    assert [float(row[0]) for row in read(one_column(*values))[1:]] == values


@given(st.lists(TEXT))
def test_every_text_reads_back_as_it_was(texts: list[str]) -> None:
    assert [row[0] for row in read(one_column(*texts))[1:]] == texts


def test_what_is_missing_is_an_empty_field_and_truth_is_told_as_in_the_data() -> None:
    cells: tuple[Any, ...] = (None, math.nan, True, np.bool_(False), np.float64(0.1), np.int64(3))
    assert [row[0] for row in read(one_column(*cells))] == ["value", "", "", "true", "false", "0.1", "3"]


def test_lines_end_as_in_the_data_set() -> None:
    assert csv_of(one_column("a")) == b"value,more\r\na,1\r\n"
