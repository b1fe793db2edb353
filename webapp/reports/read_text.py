"""A CSV file from its bytes: which encoding it has, and its cells as text."""

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from webapp.reports.read_problems import MOST_TOLD, DataSetError, first_of, shown

_ENCODINGS = (
    (codecs.BOM_UTF32_LE, None),
    (codecs.BOM_UTF32_BE, None),
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""The encodings by the mark at a file's beginning, the longer marks first; None is not read."""

_LINE_END = re.compile("\r\n|\r|\n")


@dataclass(frozen=True, slots=True)
class RawTable:
    """A table as it is written.

    Attributes:
        file: The file's name, as messages tell it.
        cells: A column of texts for each name of the first line; an empty cell is an empty text.
        text: The whole file.
    """

    file: str
    cells: pd.DataFrame
    text: str

    def lines(self, rows: Sequence[int]) -> list[int]:
        """Return the lines, from 1, on which some rows begin, given by their places from 0."""
        wanted, last = set(rows), max(rows, default=-1)
        found: dict[int, int] = {}
        for place, (line, _) in enumerate(_lined(self.text), start=-1):
            if place > last:
                break
            if place in wanted:
                found[place] = line
        return [found[row] for row in rows]


def read_table(file: str, content: bytes) -> RawTable:
    """Read a table.

    Args:
        file: Its name.
        content: Its bytes: UTF-8 with or without a byte order mark, or UTF-16 with one.

    Raises:
        DataSetError: It is empty, in another encoding, or no table.
    """
    text = decode(file, content)
    names, *rows = _rows(file, text)
    problems = list(_wrong_names(names))
    if problems:
        raise DataSetError(f"{file}, line 1: {problem}" for problem in problems)
    blank = [place for place, row in enumerate(rows) if not any(row)]
    if blank:
        raise DataSetError(_told(file, text, blank, lambda _: "is blank; delete it"))
    uneven = [place for place, row in enumerate(rows) if len(row) != len(names)]
    if uneven:
        has = f"and the first line has {len(names)}; make them equal"
        raise DataSetError(
            _told(file, text, uneven, lambda row: f"has {len(row)} {'cell' if len(row) == 1 else 'cells'}, {has}")
        )
    columns = zip(*rows, strict=True) if rows else ((),) * len(names)
    cells = {name: pd.array(list(column), dtype="str") for name, column in zip(names, columns, strict=True)}
    return RawTable(file, pd.DataFrame(cells), text)


def decode(file: str, content: bytes) -> str:
    """Return a file's text, without the mark at its beginning.

    Raises:
        DataSetError: It is in another encoding than UTF-8 and marked UTF-16, or holds a NUL.
    """
    encoding = next((name for mark, name in _ENCODINGS if content.startswith(mark)), "utf-8")
    if encoding is None:
        raise DataSetError([f"{file}: is in UTF-32; save it as UTF-8"])
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        line = len(_LINE_END.findall(content[: error.start].decode(encoding, errors="replace"))) + 1
        name = "UTF-16" if encoding == "utf-16" else "UTF-8"
        wish = "the file is in another encoding; save it as UTF-8"
        raise DataSetError(
            [f"{file}, line {line}: the byte 0x{content[error.start]:02X} cannot be read as {name}; {wish}"]
        ) from None
    if "\0" in text:
        line = len(_LINE_END.findall(text[: text.index("\0")])) + 1
        wish = "the file is damaged or in UTF-16 without a byte order mark; save it as UTF-8"
        raise DataSetError([f"{file}, line {line}: holds the byte 0x00; {wish}"])
    return text


def _rows(file: str, text: str) -> list[list[str]]:
    """Return the cells of each row, the names first; lines without anything are no rows."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        rows = [row for row in reader if row]
    except csv.Error as error:
        raise DataSetError([f"{file}, line {reader.line_num}: is no CSV: {error}; check the quotes there"]) from None
    if not rows:
        raise DataSetError([f"{file}: is empty; its first line should have the names of the columns"])
    return rows


def _lined(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield every row again, with the line on which it begins."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    begins = 1
    for row in reader:
        if row:
            yield begins, row
        begins = reader.line_num + 1


def _wrong_names(names: Sequence[str]) -> Iterator[str]:
    for separator, word in ((";", "semicolons"), ("\t", "tabs")):
        if len(names) == 1 and separator in names[0]:
            yield f"has {word} between the columns: {shown(names[0])}; save it with commas"
    for name, count in Counter(names).items():
        if count > 1:
            yield f"has the column {shown(name)} {count} times; keep one"


def _told(file: str, text: str, places: Sequence[int], say: Callable[[list[str]], str]) -> tuple[str, ...]:
    """Return a line for each of some rows, given by their ascending places from 0, and how many more there are."""
    wanted, last = set(places[:MOST_TOLD]), places[:MOST_TOLD][-1]
    told: list[str] = []
    for place, (line, row) in enumerate(_lined(text), start=-1):
        if place in wanted:
            told.append(f"{file}, line {line}: {say(row)}")
        if place >= last:
            break
    return first_of(told, file, len(places))
