"""The files of the data, one by one; `storage.dataset` writes all of them with what describes them."""

import os
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import IO, Literal, get_args

from sqlalchemy import Connection

from webapp.storage import export_columns, export_rows, people_rows, quality_rows, wide_rows
from webapp.storage.csv_files import Written, write_table
from webapp.storage.database import Database
from webapp.storage.records import COMMAND_LINE, Entry, append
from webapp.storage.streams import Row
from webapp.storage.variables import Variable
from webapp.storage.wanted import AS_STORED, Wanted

FileName = Literal[
    "ratings.csv",
    "participants.csv",
    "answers.csv",
    "probes.csv",
    "drives.csv",
    "events.csv",
    "allocation.csv",
    "decisions.csv",
    "quality.csv",
    "wide.csv",
]

FILE_NAMES: tuple[FileName, ...] = get_args(FileName)
"""The files of the data."""

RecruitsName = Literal["recruits.csv"]

RECRUITS: RecruitsName = "recruits.csv"
"""Who came from where; never among the other files, because it links answers with people's ids elsewhere."""


class ExportError(RuntimeError):
    """An export that was not made; the message says why."""


def write_csv(
    connection: Connection,
    name: FileName | RecruitsName,
    file: IO[bytes],
    wanted: Wanted = AS_STORED,
    *,
    for_spreadsheet: bool = False,
) -> Written:
    """Write one file of the data as it stands in a transaction.

    Args:
        connection: A transaction of `Database.read`, or a `snapshot`.
        name: Which file.
        file: Where to write.
        wanted: Which rows.
        for_spreadsheet: Whether it is made safe to open in a spreadsheet; otherwise it holds exactly what is stored.
    """
    columns = columns_of(connection, name, wanted)
    rows = wide_rows.wide_rows(connection, wanted, columns) if name == "wide.csv" else _ROWS[name](connection, wanted)
    return write_table(file, columns, rows, for_spreadsheet=for_spreadsheet)


def columns_of(connection: Connection, name: FileName | RecruitsName, wanted: Wanted) -> Sequence[Variable]:
    """Return the columns of a file; those of `wide.csv` follow from the studies."""
    return wide_rows.wide_columns(connection, wanted) if name == "wide.csv" else COLUMNS[name]


def export_recruits(database: Database, path: Path, now: datetime) -> int:
    """Write who came from where into a file of its own, which only its owner may read; that it was done is recorded.

    Args:
        database: What to export.
        path: The file.
        now: The time.

    Returns:
        The number of rows.

    Raises:
        ExportError: The file is there already, or cannot be written.
    """
    if path.exists():
        raise ExportError(f"{path} exists already; choose another file")
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise ExportError(f"{path}: {error.strerror}") from error
    try:
        with os.fdopen(handle, "wb") as file, database.write() as connection:
            append(connection, Entry(now, COMMAND_LINE, "downloaded", content={"file": RECRUITS}))
            return write_csv(connection, RECRUITS, file).num_rows or 0
    except BaseException as error:
        path.unlink()
        if isinstance(error, OSError):
            raise ExportError(f"{path}: {error.strerror}") from error
        raise


COLUMNS: dict[FileName | RecruitsName, tuple[Variable, ...]] = {
    "ratings.csv": export_columns.RATINGS,
    "participants.csv": export_columns.PARTICIPANTS,
    "answers.csv": export_columns.ANSWERS,
    "probes.csv": export_columns.PROBES,
    "drives.csv": export_columns.DRIVES,
    "events.csv": export_columns.EVENTS,
    "allocation.csv": export_columns.ALLOCATION,
    "decisions.csv": export_columns.DECISIONS,
    "quality.csv": export_columns.QUALITY,
    "recruits.csv": export_columns.RECRUITS,
}
"""The columns of every file but `wide.csv`."""

_ROWS: dict[str, Callable[[Connection, Wanted], Iterator[Row]]] = {
    "ratings.csv": export_rows.ratings_rows,
    "participants.csv": people_rows.participants_rows,
    "answers.csv": export_rows.answers_rows,
    "probes.csv": export_rows.probes_rows,
    "drives.csv": export_rows.drives_rows,
    "events.csv": export_rows.events_rows,
    "allocation.csv": people_rows.allocation_rows,
    "decisions.csv": people_rows.decisions_rows,
    "quality.csv": quality_rows.quality_rows,
    "recruits.csv": people_rows.recruits_rows,
}
