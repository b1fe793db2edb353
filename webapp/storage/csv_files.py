"""Rows as CSV: exactly as stored, or as a copy that is safe to open in a spreadsheet."""

import codecs
import csv
import hashlib
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import IO

from webapp.storage.streams import Row
from webapp.storage.variables import Variable

_SIGNS = "=+@\uff1d\uff0b\uff0d\uff20-"
"""With what a formula begins; those after `@` are the wide forms of Japanese keyboards."""

_FORMULA_STARTS = (*_SIGNS, "\t", "\r", "\n")
"""What makes a spreadsheet take a text for a formula, and run it."""

_AFTER_A_SEPARATOR = re.compile(rf"""([;\t\r\n][\s"']*)(?=[{_SIGNS}])""")
"""Where a formula begins within a text for a spreadsheet that separates by semicolons or tabs, as many countries' do.

Quotes do not keep such a text together there, because its field begins elsewhere.
"""

_BUFFERED = 1 << 16
"""How many characters are kept before they are written."""


@dataclass(frozen=True, slots=True)
class Written:
    """What was written into a file.

    Attributes:
        num_rows: The number of rows, the header not counted; None for a file that is no table.
        num_bytes: Its size.
        sha256: Of its content, in hexadecimal.
    """

    num_rows: int | None
    num_bytes: int
    sha256: str


class Counting:
    """A file that is counted and digested while it is written."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._digest = hashlib.sha256()
        self._num_bytes = 0

    def write(self, content: bytes) -> None:
        """Write on."""
        self._file.write(content)
        self._digest.update(content)
        self._num_bytes += len(content)

    def written(self, num_rows: int | None = None) -> Written:
        """Return what was written so far."""
        return Written(num_rows, self._num_bytes, self._digest.hexdigest())


def write_table(file: IO[bytes], columns: Sequence[Variable], rows: Iterable[Row], *, for_spreadsheet: bool) -> Written:
    """Write a table: RFC 4180, UTF-8, lines that end in CR LF; an empty field means that there is no value.

    Args:
        file: Where to write.
        columns: The columns.
        rows: A value for each column; times with their zone.
        for_spreadsheet: Whether to begin with a byte order mark, by which spreadsheets know the encoding, and to put
            an apostrophe before each text that they would take for a formula, and before each part of a text that
            they would if semicolons or tabs separated fields. Numbers stay numbers.
    """
    counting = Counting(file)
    if for_spreadsheet:
        counting.write(codecs.BOM_UTF8)
    cell = _guarded if for_spreadsheet else _exact
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer, lineterminator="\r\n")
    writer.writerow([variable.name for variable in columns])
    num_rows = 0
    for row in rows:
        writer.writerow([cell(value) for value in row])
        num_rows += 1
        if buffer.tell() > _BUFFERED:
            _empty(buffer, counting)
    _empty(buffer, counting)
    return counting.written(num_rows)


def _empty(buffer: io.StringIO, file: Counting) -> None:
    file.write(buffer.getvalue().encode())
    buffer.seek(0)
    buffer.truncate()


def _exact(value: object) -> object:
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
    if isinstance(value, bool):
        return "true" if value else "false"
    return value


def _guarded(value: object) -> object:
    if not isinstance(value, str):
        return _exact(value)
    guarded = _AFTER_A_SEPARATOR.sub(r"\1'", value)
    return f"'{guarded}" if guarded.startswith(_FORMULA_STARTS) else guarded
