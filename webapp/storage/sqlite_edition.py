"""SQLite: one connection that writes, others that read, and every commit on disk before it returns.

SQLite 3.7.0 to 3.51.2 can lose committed rows in WAL mode when two connections write or checkpoint at once (fixed in
3.51.3, and in 3.50.7 and 3.44.6). Those versions get the rollback journal, which with a single writer is as fast.
"""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import URL, Connection, Engine, ExceptionContext, StaticPool, create_engine, event

from webapp.storage.editions import DatabaseError, UnavailableError

BUSY_TIMEOUT_S = 10
"""How long a connection waits for another process that holds the database."""

# The option of connections that begin no transaction.
_LOOKS = "xar_looks"


def journal_mode(version: tuple[int, int, int]) -> str:
    """Return the journal that keeps every commit on this version of SQLite.

    Distributions may mend an old version without changing its number, so this errs on the safe side.

    Args:
        version: Such as `sqlite3.sqlite_version_info`.
    """
    fixed = version >= (3, 51, 3) or (3, 50, 7) <= version < (3, 51, 0) or (3, 44, 6) <= version < (3, 45, 0)
    return "wal" if fixed else "delete"


class SqliteEdition:
    """An open database file. See `editions.Edition`."""

    reads_hold_up_writers = True
    last_traces = (
        "Something kept the database open meanwhile, so the last traces leave the disk when the server is restarted."
    )

    def __init__(self, path: Path) -> None:
        """Open the file, making an empty one if there is none.

        Raises:
            DatabaseError: The file cannot be opened, or is no database.
        """
        self.told = str(path)
        try:
            os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o600))
        except OSError as error:
            raise DatabaseError(f"the database {path} cannot be opened: {error.strerror}") from error
        self._writer = _engine(path, writes=True)
        self._readers = _engine(path, writes=False)
        self._lookers = self._readers.execution_options(**{_LOOKS: True})
        try:
            with self._writer.connect() as connection:
                _choose_journal(connection, path)
        except Exception as error:
            self.close()
            if isinstance(error, DatabaseError):
                raise
            raise DatabaseError(f"{path} cannot be used as the database: {error.__cause__ or error}") from error

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Open a transaction on the one connection that writes; whoever calls sees to it that only one is open."""
        with self._writer.begin() as connection:
            yield connection
            driver = connection.connection.driver_connection
            assert isinstance(driver, sqlite3.Connection)  # noqa: S101 - for the type checker
            if not driver.in_transaction:  # Some errors end it, and nobody told.
                raise UnavailableError("COMMIT", None, sqlite3.OperationalError("the transaction has ended"))

    @contextmanager
    def reading(self, *, is_long: bool = False) -> Iterator[Connection]:  # noqa: ARG002 - nothing ends it here.
        """Open a transaction that sees one state throughout."""
        with self._readers.begin() as connection:
            yield connection

    def looking(self) -> AbstractContextManager[Connection]:
        """Open a connection on which each statement that reads sees a state of its own."""
        return self._lookers.connect()

    def close_cursors(self, connection: Connection) -> None:
        """Do nothing: nothing can go wrong with them."""

    def probe(self) -> None:
        """Begin to make a table and undo it."""
        with self._writer.connect() as connection:
            connection.exec_driver_sql("CREATE TABLE health_check (id INTEGER)")
            connection.rollback()

    def after_upgrade(self, connection: Connection) -> None:
        """Do nothing more."""

    def forget(self) -> bool:
        """Empty the journal into the database, whose freed pages are overwritten with zeros (`secure_delete`)."""
        with self._writer.connect() as connection:
            driver = connection.connection.driver_connection
            assert isinstance(driver, sqlite3.Connection)  # noqa: S101 - for the type checker
            driver.execute("PRAGMA busy_timeout=0").close()
            try:
                (is_busy, *_) = driver.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            finally:
                driver.execute(f"PRAGMA busy_timeout={1000 * BUSY_TIMEOUT_S}").close()
        return not is_busy

    def close(self) -> None:
        """Close every connection."""
        self._readers.dispose()
        self._writer.dispose()


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
        for pragma in ("foreign_keys=ON", "synchronous=EXTRA", "trusted_schema=OFF", "secure_delete=ON", "mmap_size=0"):
            connection.execute(f"PRAGMA {pragma}").close()
        if not writes:
            connection.execute("PRAGMA query_only=ON").close()

    @event.listens_for(engine, "handle_error")
    def _tell(context: ExceptionContext) -> None:
        # SQLite calls a page damaged that the disk did not give; another time it may, and if not, `doctor` finds out.
        if type(context.original_exception) is sqlite3.DatabaseError:
            raise UnavailableError(context.statement, None, context.original_exception)

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        if connection.get_execution_options().get(_LOOKS):
            return
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
