"""Bringing a database to this version of xar, with a backup before."""

from contextlib import closing
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from webapp.storage.backups import back_up
from webapp.storage.database import Database
from webapp.storage.instance import only_server, prepare_instance
from webapp.storage.postgres_dumps import dump
from webapp.storage.revisions import known_revisions


@dataclass(frozen=True, slots=True)
class Migrated:
    """What was done.

    Attributes:
        before: The revision that the tables had; None if there were none.
        after: The revision that they have.
        backup: What was backed up before; None if nothing was.
    """

    before: str | None
    after: str
    backup: Path | None


def migrate(database: Path, backups: Path | None, now: datetime, *, url: str | None = None) -> Migrated:
    """Bring the tables of a database to this program's revision, in one transaction; make them if there are none.

    Args:
        database: The file of the SQLite edition; its folder is the instance in both editions.
        backups: Where the backup goes that is made before anything is changed; None for no backup.
        now: The time.
        url: The address of the PostgreSQL edition's database; None for the SQLite edition.

    Raises:
        webapp.storage.instance.InstanceError: A server runs on the instance.
        webapp.storage.database.DatabaseError: The database cannot be used or backed up, or is of a later version.
    """
    prepare_instance(database.parent)
    with only_server(database.parent), closing(Database(database, url)) as opened:
        before, newest = opened.revision(), known_revisions()[0]
        kept = None
        if before is not None and before in known_revisions()[1:] and backups is not None:
            kept, _ = back_up(database, backups, now) if url is None else dump(opened, backups, now)
        opened.upgrade()
    return Migrated(before, newest, kept)
