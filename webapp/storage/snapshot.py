"""One state of the database, held apart: whoever reads it long keeps no participant waiting."""

import fcntl
import os
import sqlite3
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from sqlalchemy import Connection, StaticPool, create_engine

from webapp.storage.database import Database, UnavailableError
from webapp.storage.sqlite_edition import BUSY_TIMEOUT_S

_PREFIX = ".snapshot-"


@contextmanager
def snapshot(database: Database) -> Iterator[Connection]:
    """Open a transaction that may take long. Of SQLite, it is one on a copy, which takes a moment to make.

    The copy lies in the instance's folder, is closed to others, and has no name any more once it is complete: nothing
    is left of it when the process ends. If a process is killed while it copies, the next copy removes what it left.
    """
    if not database.edition.reads_hold_up_writers:
        with database.edition.reading(is_long=True) as connection:
            yield connection
        return
    remove_stale(database)
    handle, path = tempfile.mkstemp(prefix=_PREFIX, dir=database.path.parent)
    fcntl.flock(handle, fcntl.LOCK_EX)  # It says that the copy is in the making, and ends with the process.
    try:
        copy = sqlite3.connect(path, check_same_thread=False)
    except BaseException:
        Path(path).unlink()
        os.close(handle)
        raise
    with closing(copy):
        try:
            copy.execute("PRAGMA journal_mode=OFF").close()
            copy.execute("PRAGMA synchronous=OFF").close()
            _copy(database, copy)
        finally:
            Path(path).unlink()
            os.close(handle)
        copy.isolation_level = None
        copy.execute("PRAGMA query_only=ON").close()
        engine = create_engine("sqlite://", creator=lambda: copy, poolclass=StaticPool, hide_parameters=True)
        with engine.connect() as connection:
            yield connection


def remove_stale(database: Database) -> None:
    """Remove copies that were left half-made by processes that are no more."""
    for path in database.path.parent.glob(f"{_PREFIX}*"):
        with path.open("rb") as file, suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink(missing_ok=True)


def _copy(database: Database, copy: sqlite3.Connection) -> None:
    until = time.monotonic() + BUSY_TIMEOUT_S

    def _wait(status: int, _remaining: int, _total: int) -> None:
        # Whoever holds the file may do so for ever, and SQLite would wait as long.
        if status in {sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED} and time.monotonic() > until:
            raise sqlite3.OperationalError("another program holds the database")

    with database.read() as connection:
        original = connection.connection.driver_connection
        assert isinstance(original, sqlite3.Connection)  # noqa: S101 - for the type checker
        try:
            original.backup(copy, progress=_wait)
        except sqlite3.OperationalError as error:
            raise UnavailableError("backup", None, error) from error
