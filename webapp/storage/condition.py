"""How the server is doing, in what can be told at every look: the last answer, room on the disk, the newest backup."""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from sqlalchemy import select

from webapp.storage.backup_manifests import Manifest, newest_backup
from webapp.storage.database import Database
from webapp.storage.findings import Finding
from webapp.storage.health import MAX_BACKUP_AGE, name_of
from webapp.storage.records import Action
from webapp.storage.surroundings import disk
from webapp.storage.tables import records

_ANSWERS: tuple[Action, ...] = ("sent", "attempted", "acted")


@dataclass(frozen=True, slots=True)
class Condition:
    """How the server is doing.

    Attributes:
        last_answer_at: When the last answer of anybody was stored; None if there is none yet.
        disk: Whether there is room where the instance is.
        backup_at: When the newest backup was made; None if there is none.
        backup: Whether that is young enough.
    """

    last_answer_at: datetime | None
    disk: Finding
    backup_at: datetime | None
    backup: Finding


def condition(database: Database, backups: Path, now: datetime, *, is_live: bool) -> Condition:
    """Look at the end of the log, the disk and one manifest.

    Args:
        database: The database that is served; the folder of its file is the instance in both editions.
        backups: The folder of its backups.
        now: The time.
        is_live: Whether real data are collected, which must not be without a backup.
    """
    newest = newest_backup(backups, name_of(database))
    made_at = None if newest is None else newest.made_at
    room = disk(database.path.parent, holds_answers=database.url is None)
    return Condition(_last_answer(database), room, made_at, _judged(newest, now, is_live=is_live))


def _last_answer(database: Database) -> datetime | None:
    """Walk from the end of the log back to the last answer, which is near while people take part."""
    # As an expression, so that neither database takes the index on actions, in which a common one has many rows to
    # be sorted. Which ones are common, PostgreSQL knows only once it has counted.
    is_answer = records.c.action.concat("").in_(_ANSWERS)
    query = select(records.c.at).where(is_answer).order_by(records.c.number.desc()).limit(1)
    with database.read() as connection:
        return connection.execute(query).scalar_one_or_none()


def _judged(newest: Manifest | None, now: datetime, *, is_live: bool) -> Finding:
    wish = "run xar backup, and every few hours during a study"
    if newest is None:
        return Finding("backups", "problem", "none", wish) if is_live else Finding("backups", "ok", "none")
    is_old = now - newest.made_at > MAX_BACKUP_AGE
    return Finding("backups", "warning" if is_old and is_live else "ok", "", wish if is_old and is_live else "")
