"""A table of any length is written piece by piece, and the pieces together are the table."""

import csv
import io
import time
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest

from webapp.storage.csv_files import write_table
from webapp.storage.variables import Variable

COLUMNS = (Variable("number", "integer", "Which row."), Variable("said", "text", "Whatever somebody wrote."))
PIECE = 1 << 16
"""So many characters are kept before they are written."""


class Pieces(io.BytesIO):
    """A file that remembers the size of each piece."""

    def __init__(self) -> None:
        super().__init__()
        self.sizes: list[int] = []

    def write(self, content: bytes) -> int:  # type: ignore[override]
        self.sizes.append(len(content))
        return super().write(content)


def rows(num_rows: int, size: int) -> list[tuple[int, str]]:
    return [(number, f"{number} ".ljust(size, "x")) for number in range(num_rows)]


@pytest.mark.parametrize(("num_rows", "size"), [(0, 1), (1, 100_000), (5, 50_000), (3000, 200), (40_000, 9)])
def test_every_row_stands_in_the_file_once_and_in_order(num_rows: int, size: int) -> None:
    file, written = io.BytesIO(), rows(num_rows, size)
    write_table(file, COLUMNS, written, for_spreadsheet=False)
    lines = list(csv.reader(io.StringIO(file.getvalue().decode(), newline="")))
    assert lines == [["number", "said"], *([str(number), text] for number, text in written)]


def test_a_piece_is_written_as_soon_as_it_is_full_and_no_sooner() -> None:
    file = Pieces()
    write_table(file, COLUMNS, rows(3000, 200), for_spreadsheet=False)
    longest_row = len(f"2999,{'x' * 200}\r\n")
    *full, _rest = file.sizes
    assert len(full) > 5
    assert all(PIECE < size <= PIECE + longest_row for size in full)


def test_rows_are_written_while_more_are_still_being_read() -> None:
    file = Pieces()

    def slowly() -> Iterator[tuple[int, str]]:
        yield 1, "x" * (PIECE + 1)
        assert file.sizes, "the first row is kept although it fills a piece"
        yield 2, ""

    assert write_table(file, COLUMNS, slowly(), for_spreadsheet=False).num_rows == 2


def test_a_time_is_written_in_utc_whatever_the_zone_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    file, at = io.BytesIO(), datetime(2031, 3, 1, 9, 30, tzinfo=UTC)
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    try:
        assert at.astimezone().utcoffset() != at.utcoffset()
        write_table(file, (Variable("at", "time", "When."),), [(at,)], for_spreadsheet=False)
    finally:
        monkeypatch.undo()
        time.tzset()
    assert file.getvalue() == b"at\r\n2031-03-01T09:30:00.000000Z\r\n"


def test_lines_end_as_the_standard_for_csv_wants_it() -> None:
    file = io.BytesIO()
    write_table(file, COLUMNS, [(1, "a"), (2, "b\nc")], for_spreadsheet=False)
    assert file.getvalue() == b'number,said\r\n1,a\r\n2,"b\nc"\r\n'
