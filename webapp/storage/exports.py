"""The data as CSV: RFC 4180, UTF-8; see `docs/data-dictionary.md`."""

import csv
import io
import os
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import IO, Literal, get_args

from sqlalchemy import Connection

from webapp.storage import export_columns, export_rows
from webapp.storage.database import Database
from webapp.storage.export_rows import Row

FileName = Literal["ratings.csv", "participants.csv", "answers.csv", "probes.csv", "drives.csv", "events.csv"]

FILE_NAMES: tuple[FileName, ...] = get_args(FileName)
"""The files of the data."""

RecruitsName = Literal["recruits.csv"]

RECRUITS: RecruitsName = "recruits.csv"
"""Who came from where; never among the other files, because it links answers with people's ids elsewhere."""

_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
"""What makes a spreadsheet take a text for a formula, and run it."""


class ExportError(RuntimeError):
    """An export that was not made; the message says why."""


def write_csv(connection: Connection, name: FileName | RecruitsName, file: IO[bytes]) -> int:
    """Write one file of the data as it stands in a transaction.

    A text that a spreadsheet would take for a formula gets an apostrophe in front.

    Args:
        connection: A transaction of `Database.read`.
        name: Which file.
        file: Where to write.

    Returns:
        The number of rows, the header not counted.
    """
    columns, read_rows = _FILES[name]
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(columns)
    num_rows = 0
    for row in read_rows(connection):
        writer.writerow([_cell(value) for value in row])
        num_rows += 1
    text.flush()
    text.detach()
    return num_rows


def export(database: Database, folder: Path) -> dict[FileName, int]:
    """Write all files of the data into a folder, all from one state of the database.

    Args:
        database: What to export.
        folder: Where to; it is made if there is none.

    Returns:
        The number of rows of each file.

    Raises:
        ExportError: One of the files is there already, or cannot be written. Nothing is overwritten.
    """
    for name in FILE_NAMES:
        if (folder / name).exists():
            raise ExportError(f"{folder / name} exists already; choose another folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with database.read() as connection:
            return {name: _write_file(connection, name, folder / name, mode=0o666) for name in FILE_NAMES}
    except OSError as error:
        raise ExportError(f"{error.filename or folder}: {error.strerror}") from error


def export_recruits(database: Database, path: Path) -> int:
    """Write who came from where into a file of its own, which only its owner may read.

    Args:
        database: What to export.
        path: The file.

    Returns:
        The number of rows.

    Raises:
        ExportError: The file is there already, or cannot be written.
    """
    if path.exists():
        raise ExportError(f"{path} exists already; choose another file")
    try:
        with database.read() as connection:
            return _write_file(connection, RECRUITS, path, mode=0o600)
    except OSError as error:
        raise ExportError(f"{error.filename or path}: {error.strerror}") from error


def _write_file(connection: Connection, name: FileName | RecruitsName, path: Path, mode: int) -> int:
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
        return write_csv(connection, name, file)


def _cell(value: object) -> object:
    if isinstance(value, datetime):
        return value.isoformat(timespec="microseconds").replace("+00:00", "Z")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str) and value.startswith(_FORMULA_STARTS):
        return f"'{value}"
    return value


_FILES: dict[FileName | RecruitsName, tuple[tuple[str, ...], Callable[[Connection], Iterator[Row]]]] = {
    "ratings.csv": (export_columns.RATINGS_COLUMNS, export_rows.ratings_rows),
    "participants.csv": (export_columns.PARTICIPANTS_COLUMNS, export_rows.participants_rows),
    "answers.csv": (export_columns.ANSWERS_COLUMNS, export_rows.answers_rows),
    "probes.csv": (export_columns.PROBES_COLUMNS, export_rows.probes_rows),
    "drives.csv": (export_columns.DRIVES_COLUMNS, export_rows.drives_rows),
    "events.csv": (export_columns.EVENTS_COLUMNS, export_rows.events_rows),
    "recruits.csv": (export_columns.RECRUITS_COLUMNS, export_rows.recruits_rows),
}
