"""The SQLite database: one connection that writes, others that read, and every commit on disk before it returns.

SQLite 3.7.0 to 3.51.2 can lose committed rows in WAL mode when two connections write or checkpoint at once (fixed in
3.51.3, and in 3.50.7 and 3.44.6). Those versions get the rollback journal, which with a single writer is as fast.
"""

import os
import sqlite3
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config as AlembicConfig
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import URL, Connection, Engine, StaticPool, create_engine, event
from sqlalchemy.exc import OperationalError

from webapp.storage.instance import prepare_instance

UnavailableError = OperationalError
"""What is raised while nothing can be read or stored, such as on a full disk; trying again later may help."""

BUSY_TIMEOUT_S = 10
"""How long a connection waits for another process that holds the database."""

_MIGRATIONS = Path(__file__).parent / "migrations"


class DatabaseError(RuntimeError):
    """A database that cannot be used; the message says what to do."""


def journal_mode(version: tuple[int, int, int]) -> str:
    """Return the journal that keeps every commit on this version of SQLite.

    Distributions may mend an old version without changing its number, so this errs on the safe side.

    Args:
        version: Such as `sqlite3.sqlite_version_info`.
    """
    fixed = version >= (3, 51, 3) or (3, 50, 7) <= version < (3, 51, 0) or (3, 44, 6) <= version < (3, 45, 0)
    return "wal" if fixed else "delete"


class Database:
    """An open database file. Threads may share it.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, making an empty one if there is none.

        Raises:
            DatabaseError: The file cannot be opened, or is no database.
        """
        self.path = path
        self._write_lock = threading.Lock()
        try:
            os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o600))
        except OSError as error:
            raise DatabaseError(f"the database {path} cannot be opened: {error.strerror}") from error
        self._writer = _engine(path, writes=True)
        self._readers = _engine(path, writes=False)
        try:
            with self._writer.connect() as connection:
                _choose_journal(connection, path)
        except Exception as error:
            self.close()
            if isinstance(error, DatabaseError):
                raise
            raise DatabaseError(f"{path} cannot be used as the database: {error.__cause__ or error}") from error

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """Open a transaction that may write; no other runs meanwhile, in this or any other process.

        What was done is on disk when the context ends, or is undone if it ends with an exception.
        """
        with self._write_lock, self._writer.begin() as connection:
            yield connection

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a transaction that sees one state of the database throughout. Keep it short: it may hold up writers."""
        with self._readers.begin() as connection:
            yield connection

    def upgrade(self) -> None:
        """Bring the tables to this program's version, all or nothing.

        Raises:
            DatabaseError: The database was made by a later version of the program.
        """
        current = self._revision()
        if current is not None and current not in {script.revision for script in _scripts().walk_revisions()}:
            raise DatabaseError(f"the database {self.path} was made by a later version of xar; install that version")
        with self.write() as connection:
            config = AlembicConfig()
            config.set_main_option("script_location", str(_MIGRATIONS))
            config.attributes["connection"] = connection
            command.upgrade(config, "head")

    def check_version(self) -> None:
        """Make sure that the tables are this program's.

        Raises:
            DatabaseError: They are not.
        """
        if self._revision() != _scripts().get_current_head():
            raise DatabaseError(f"the database {self.path} is of another version of xar; `xar serve` upgrades it")

    def check_writable(self) -> None:
        """Begin to write and undo it.

        Raises:
            UnavailableError: Nothing can be written at the moment.
        """
        with self._write_lock, self._writer.connect() as connection:
            connection.exec_driver_sql("CREATE TABLE health_check (id INTEGER)")
            connection.rollback()

    def forget(self, tries: int = 20) -> bool:
        """Let nothing of erased rows stay behind on disk.

        The journal is emptied into the database, whose freed pages are overwritten with zeros (`secure_delete`).
        Whoever reads at the moment holds that up; between the tries, a quarter of a second apart, others may write.

        Returns:
            Whether it is done. If not, it is when the last connection is closed.
        """
        for _ in range(tries):
            if self._empty_journal():
                return True
            time.sleep(0.25)
        return False

    def close(self) -> None:
        """Close every connection."""
        self._readers.dispose()
        self._writer.dispose()

    def _empty_journal(self) -> bool:
        with self._write_lock, self._writer.connect() as connection:
            driver = connection.connection.driver_connection
            assert isinstance(driver, sqlite3.Connection)  # noqa: S101 - for the type checker
            driver.execute("PRAGMA busy_timeout=0").close()
            try:
                (is_busy, *_) = driver.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            finally:
                driver.execute(f"PRAGMA busy_timeout={1000 * BUSY_TIMEOUT_S}").close()
        return not is_busy

    def _revision(self) -> str | None:
        with self.read() as connection:
            return MigrationContext.configure(connection).get_current_revision()


@contextmanager
def open_database(path: Path, *, make: bool = True) -> Iterator[Database]:
    """Open the database of an instance for a while, outside the server.

    Args:
        path: The database file; its folder is the instance.
        make: Whether to make or upgrade the database where needed; if not, it must be there and up to date.

    Raises:
        DatabaseError: The database cannot be used, or is not there.
        webapp.storage.instance.InstanceError: The instance folder cannot be used.
    """
    if not make and not path.exists():
        raise DatabaseError(f"there is no database {path}; `xar serve` makes one, XAR_INSTANCE says where")
    prepare_instance(path.parent)
    database = Database(path)
    try:
        if make:
            database.upgrade()
        else:
            database.check_version()
        yield database
    finally:
        database.close()


def _scripts() -> ScriptDirectory:
    return ScriptDirectory(str(_MIGRATIONS))


def _engine(path: Path, *, writes: bool) -> Engine:
    arguments = {"check_same_thread": False, "timeout": BUSY_TIMEOUT_S}
    url = URL.create("sqlite", database=str(path))
    pool: dict[str, Any] = {"poolclass": StaticPool} if writes else {"pool_size": 8, "max_overflow": 8}
    # Parameters hold hashes of tokens: they do not belong in messages and logs.
    engine = create_engine(url, connect_args=arguments, hide_parameters=True, **pool)

    @event.listens_for(engine, "connect")
    def _connect(connection: sqlite3.Connection, _record: Any) -> None:  # noqa: ANN401
        # Without this, Python's driver would begin and end transactions on its own.
        connection.isolation_level = None
        for pragma in ("foreign_keys=ON", "synchronous=FULL", "trusted_schema=OFF", "secure_delete=ON", "mmap_size=0"):
            connection.execute(f"PRAGMA {pragma}").close()
        if not writes:
            connection.execute("PRAGMA query_only=ON").close()

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        # A transaction that reads first and writes later could otherwise fail half-way.
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _choose_journal(connection: Connection, path: Path) -> None:
    wanted = journal_mode(sqlite3.sqlite_version_info)
    driver = connection.connection.driver_connection
    assert isinstance(driver, sqlite3.Connection)  # noqa: S101 - for the type checker
    (actual,) = driver.execute(f"PRAGMA journal_mode={wanted}").fetchone()
    if actual != wanted:
        raise DatabaseError(
            f"the database {path} keeps journal mode {actual}, not {wanted}; close other programs using it"
        )
