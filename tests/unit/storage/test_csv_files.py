import csv
import hashlib
import io
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.unit.storage.readers import read_variables
from webapp.storage.csv_files import write_table
from webapp.storage.variables import Variable

COLUMNS = (
    Variable("said", "text", "Whatever somebody wrote."),
    Variable("count", "integer", "A whole number."),
    Variable("share", "number", "Any number."),
    Variable("is_so", "boolean", "Whether it is so."),
    Variable("at", "time", "When."),
)
ODD = [
    "NA",
    "null",
    "-5",
    "=1+1",
    "'",
    '"',
    ",",
    "a\r\nb",
    "\r",
    "\n",
    " ",
    "\t",
    "1e5",
    "007",
    "ロボット",
    "\ufeff",
    "#",
]
TEXTS = st.none() | st.sampled_from(ODD) | st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))
ROWS = st.lists(
    st.tuples(
        TEXTS,
        st.none() | st.integers(-(2**62), 2**62),
        st.none() | st.floats(allow_nan=False, allow_infinity=False),
        st.none() | st.booleans(),
        st.none() | st.datetimes(datetime(2000, 1, 1), datetime(2200, 1, 1), timezones=st.just(UTC)),  # noqa: DTZ001
    ),
    max_size=8,
)
Row = tuple[object, ...]


def content(rows: Sequence[Row], *, for_spreadsheet: bool = False) -> bytes:
    file = io.BytesIO()
    write_table(file, COLUMNS, rows, for_spreadsheet=for_spreadsheet)
    return file.getvalue()


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(rows=ROWS)
@example(rows=[(text, None, None, None, None) for text in ODD])
def test_pandas_reads_back_what_was_written(tmp_path: Path, rows: list[Row]) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(content(rows))
    frame = read_variables(path, COLUMNS)
    read = [
        tuple(None if cell is pd.NA or cell is pd.NaT else cell for cell in row)
        for row in frame.astype({"at": object}).itertuples(index=False)
    ]
    assert read == [(text or None, *rest) for text, *rest in rows]


@given(rows=ROWS)
def test_without_its_mark_and_apostrophes_a_spreadsheets_copy_is_the_file(rows: list[Row]) -> None:
    copy = list(csv.reader(io.StringIO(content(rows, for_spreadsheet=True).decode("utf-8-sig"), newline="")))
    exact = list(csv.reader(io.StringIO(content(rows).decode("utf-8"), newline="")))
    assert [row[1:] for row in copy] == [row[1:] for row in exact]
    for guarded, plain in zip(copy, exact, strict=True):
        starts = tuple("=+-@\t\r\n\uff1d\uff0b\uff0d\uff20")
        assert guarded[0].replace("'", "") == plain[0].replace("'", "")
        assert guarded[0].startswith("'") == plain[0].startswith((*starts, "'"))
        parts = re.split(r"[;\t\r\n]", guarded[0])
        assert not [part for part in parts if part.lstrip(' "').startswith(tuple(set(starts) - set("\t\r\n")))]


@pytest.mark.parametrize(
    ("text", "guarded"),
    [
        ("=1", "'=1"),
        ("a;=1", "a;'=1"),
        ("a\n=1\t@b", "a\n'=1\t'@b"),
        ('a;"=1', "a;\"'=1"),
        ("- one\n- two", "'- one\n'- two"),
        ("a, =1; b = 1", "a, =1; b = 1"),
        ("1 - 2; x", "1 - 2; x"),
    ],
)
def test_apostrophes_stand_where_any_separator_would_begin_a_formula(text: str, guarded: str) -> None:
    copy = csv.reader(io.StringIO(content([(text, None, None)], for_spreadsheet=True).decode("utf-8-sig"), newline=""))
    assert list(copy)[1][0] == guarded


def test_what_was_written_is_counted_and_digested() -> None:
    file = io.BytesIO()
    written = write_table(file, COLUMNS, [("x" * 50_000, 1, None, None, None)] * 5, for_spreadsheet=True)
    assert (written.num_rows, written.num_bytes) == (5, len(file.getvalue()))
    assert written.sha256 == hashlib.sha256(file.getvalue()).hexdigest()


@pytest.mark.parametrize("zone", [UTC, timezone(timedelta(hours=9))])
def test_a_time_is_written_in_utc_with_all_its_digits(zone: timezone) -> None:
    at = datetime(2031, 3, 1, 9, 30, tzinfo=UTC).astimezone(zone)
    assert content([(None, None, None, None, at)]).endswith(b",,,,2031-03-01T09:30:00.000000Z\r\n")
