"""The database: one transaction writes at a time, others read, and every commit is on disk before it returns.

There are two editions of it, chosen by the settings: `sqlite_edition` and `postgres_edition`.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, inspect

from webapp.storage.baton import Baton
from webapp.storage.editions import DatabaseError, Edition, Place, UnavailableError, UnreachableError
from webapp.storage.group_commit import GroupCommit
from webapp.storage.instance import prepare_instance
from webapp.storage.revisions import CURRENT, known_revisions, revision_of, run_migrations
from webapp.storage.sqlite_edition import SqliteEdition, journal_mode

__all__ = [
    "Database",
    "DatabaseError",
    "Place",
    "UnavailableError",
    "UnreachableError",
    "journal_mode",
    "open_database",
]


class Database:
    """An open database. Threads may share it.

    Attributes:
        path: The file of the SQLite edition. Its folder is the instance in both editions.
        url: The address of the PostgreSQL edition; None for the SQLite edition.
        edition: The kind of database.
        baton: What a thread that works for a participant holds.
    """

    def __init__(self, path: Path, url: str | None = None) -> None:
        """Open the database; SQLite makes an empty one if there is none.

        Raises:
            DatabaseError: It cannot be opened, is no database, or could lose what it confirmed.
        """
        self.path, self.url = path, url
        self.edition: Edition = SqliteEdition(path) if url is None else _postgres(url)
        self.baton = Baton()
        self._turns = GroupCommit(self.edition.writing, baton=self.baton, before_undoing=self.edition.close_cursors)

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """Open a transaction that may write; no other runs meanwhile, in this or any other process.

        What was done is on disk when the context ends, or is undone if it ends with an exception. Threads that wait for
        each other share a flush of the disk.
        """
        with self._turns.write() as connection:
            yield connection

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a transaction that sees one state of the database throughout. Keep it short: it may hold up writers."""
        with self.edition.reading() as connection:
            yield connection

    @contextmanager
    def look(self) -> Iterator[Connection]:
        """Open a connection for a single question, not for changes: each statement on it sees a state of its own."""
        with self.edition.looking() as connection:
            yield connection

    def prepare(self) -> None:
        """Make the tables where there are none at all, and make sure that they are this program's.

        Raises:
            DatabaseError: There are tables, and of another version.
        """
        with self.read() as connection:
            is_empty = not inspect(connection).get_table_names()
        if is_empty:
            self.upgrade()
        self.check_version()

    def upgrade(self) -> None:
        """Bring the tables to this program's version, all or nothing.

        Raises:
            DatabaseError: The database was made by a later version of the program.
        """
        if self._is_of_later_version():
            raise DatabaseError(self._later())
        with self._turns.alone(), self.edition.writing() as connection:
            run_migrations(connection)
            self.edition.after_upgrade(connection)

    def check_version(self) -> None:
        """Make sure that the tables are this program's.

        Raises:
            DatabaseError: They are not.
        """
        if (revision := self.revision()) == CURRENT:
            return
        if revision is None:
            raise DatabaseError(f"there is no database of xar in {self.edition.told}; `xar serve` makes one")
        if self._is_of_later_version():
            raise DatabaseError(self._later())
        raise DatabaseError(
            f"the database {self.edition.told} is of another version of xar; stop the server and run `xar migrate`"
        )

    def check_writable(self) -> None:
        """Begin to write and undo it.

        Raises:
            UnavailableError: Nothing can be written at the moment.
        """
        with self._turns.alone():
            self.edition.probe()

    def forget(self, tries: int = 20) -> bool:
        """Let nothing of erased rows stay behind on disk.

        Whoever reads at the moment holds that up; between the tries, a quarter of a second apart, others may write.

        Returns:
            Whether it is done. If not, `edition.last_traces` tells what of the rest.
        """
        for _ in range(tries):
            with self._turns.alone():
                is_done = self.edition.forget()
            if is_done:
                return True
            time.sleep(0.25)
        return False

    def revision(self) -> str | None:
        """Return the revision of the tables; None without tables of ours."""
        with self.read() as connection:
            return revision_of(connection)

    def close(self) -> None:
        """Close every connection."""
        self.edition.close()

    def _is_of_later_version(self) -> bool:
        current = self.revision()
        return current is not None and current not in known_revisions()

    def _later(self) -> str:
        return f"the database {self.edition.told} was made by a later version of xar; install that version"


@contextmanager
def open_database(place: Path | Place, *, make: bool = True) -> Iterator[Database]:
    """Open the database of an instance for a while, outside the server.

    Args:
        place: The settings, or the file of the SQLite edition; its folder is the instance.
        make: Whether to make the database where there is none; if not, it must be there. An old one is refused.

    Raises:
        DatabaseError: The database cannot be used, is not there, or is of another version.
        webapp.storage.instance.InstanceError: The instance folder cannot be used.
    """
    path, url = (place, None) if isinstance(place, Path) else (place.database_path, place.database_url)
    if not make and url is None and not path.exists():
        raise DatabaseError(f"there is no database {path}; `xar serve` makes one, XAR_INSTANCE says where")
    prepare_instance(path.parent)
    database = Database(path, url)
    try:
        if make:
            database.prepare()
        else:
            database.check_version()
        yield database
    finally:
        database.close()


def _postgres(url: str) -> Edition:
    from webapp.storage.postgres_edition import PostgresEdition  # noqa: PLC0415 - 10 MB that no other edition needs.

    return PostgresEdition(url)
