"""The data as CSV: RFC 4180, UTF-8, one row per rating or per participant; see `docs/data-dictionary.md`."""

import csv
import io
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import IO, Literal

from sqlalchemy import Connection, and_, func, select

from webapp.storage.database import Database
from webapp.storage.tables import pages, participants, ratings, trials

FileName = Literal["ratings.csv", "participants.csv"]

RATINGS_COLUMNS = (
    "study",
    "study_version",
    "mode",
    "participant",
    "experiment",
    "trial",
    "layout",
    "kind",
    "draw",
    "item",
    "rating",
    "response_time_ms",
    "submitted_at",
)

PARTICIPANTS_COLUMNS = (
    "study",
    "study_version",
    "mode",
    "participant",
    "consent_version",
    "consented_at",
    "last_seen_at",
    "completed_at",
    "withdrawn_at",
    "num_pages_sent",
    "num_pages",
    "assignment",
)

_Row = tuple[object, ...]


class ExportError(RuntimeError):
    """An export that was not made; the message says why."""


def write_csv(connection: Connection, name: FileName, file: IO[bytes]) -> int:
    """Write one file of the data as it stands in a transaction.

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
    for name in _FILES:
        if (folder / name).exists():
            raise ExportError(f"{folder / name} exists already; choose another folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with database.read() as connection:
            return {name: _write_file(connection, name, folder / name) for name in _FILES}
    except OSError as error:
        raise ExportError(f"{error.filename or folder}: {error.strerror}") from error


def _write_file(connection: Connection, name: FileName, path: Path) -> int:
    with path.open("xb") as file:
        return write_csv(connection, name, file)


def _cell(value: object) -> object:
    if isinstance(value, datetime):
        return value.isoformat(timespec="microseconds").replace("+00:00", "Z")
    return value


def _ratings(connection: Connection) -> Iterator[_Row]:
    on_page = and_(pages.c.participant_id == ratings.c.participant_id, pages.c.number == ratings.c.page_number)
    on_trial = and_(trials.c.participant_id == pages.c.participant_id, trials.c.number == pages.c.trial_number)
    query = (
        select(
            participants.c.study,
            participants.c.study_version,
            participants.c.mode,
            participants.c.code,
            trials.c.experiment,
            trials.c.position,
            trials.c.layout,
            trials.c.kind,
            trials.c.draw,
            ratings.c.item,
            ratings.c.rating,
            ratings.c.response_time_ms,
            pages.c.submitted_at,
        )
        .select_from(ratings)
        .join(pages, on_page)
        .join(trials, on_trial)
        .join(participants, participants.c.id == ratings.c.participant_id)
        .order_by(ratings.c.participant_id, ratings.c.page_number, ratings.c.item)
    )
    for row in connection.execution_options(yield_per=1000).execute(query):
        yield tuple(row)


def _participants(connection: Connection) -> Iterator[_Row]:
    num_sent = (
        select(func.count()).select_from(pages).where(pages.c.participant_id == participants.c.id).scalar_subquery()
    )
    query = select(
        participants.c.study,
        participants.c.study_version,
        participants.c.mode,
        participants.c.code,
        participants.c.consent_version,
        participants.c.consented_at,
        participants.c.last_seen_at,
        participants.c.completed_at,
        participants.c.withdrawn_at,
        num_sent,
        participants.c.num_pages,
        participants.c.id,
    ).order_by(participants.c.id)
    assignments = _assignments(connection)
    for *values, participant_id in connection.execute(query):
        yield (*values, " ".join(assignments.get(participant_id, [])))


def _assignments(connection: Connection) -> dict[int, list[str]]:
    """Return each participant's trials, by the row's number, such as `1/experiment1-a/random/7`."""
    found: dict[int, list[str]] = {}
    for trial in connection.execute(select(trials).order_by(trials.c.participant_id, trials.c.number)):
        parts = [trial.experiment, trial.layout, trial.kind, *([] if trial.draw is None else [str(trial.draw)])]
        found.setdefault(trial.participant_id, []).append("/".join(parts))
    return found


_FILES: dict[FileName, tuple[tuple[str, ...], Callable[[Connection], Iterator[_Row]]]] = {
    "ratings.csv": (RATINGS_COLUMNS, _ratings),
    "participants.csv": (PARTICIPANTS_COLUMNS, _participants),
}
