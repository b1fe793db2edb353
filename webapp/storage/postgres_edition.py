"""PostgreSQL: any number of processes, one of which writes at a time, and every commit on disk before it returns.

The log of records is one chain, and allocation counts everybody, so writers take turns as with SQLite: each transaction
first takes one lock of the database. What it reads afterwards is fresh, since every statement sees what is committed
by then (READ COMMITTED). Reading transactions see one state throughout and hold up nobody.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import psycopg
from psycopg import ServerCursor
from sqlalchemy import URL, Connection, Engine, ExceptionContext, create_engine, event, func, make_url, select, text
from sqlalchemy.exc import (
    ArgumentError,
    DBAPIError,
    InterfaceError,
    InternalError,
    OperationalError,
    SQLAlchemyError,
)
from sqlalchemy.exc import TimeoutError as NoConnectionError

from webapp.storage.editions import DatabaseError, UnavailableError, UnreachableError

STATEMENT_TIMEOUT_S = 10
"""How long a statement may take, the waiting for other writers included."""

POOL_SIZE = 8
"""How many connections a process keeps, one for each thread that answers; as many again while it needs more."""

WRITERS_LOCK = 0x786172
"""The number of the lock that writers take: any that is always the same."""

_CONNECT_TIMEOUT_S = 5
_OLDEST_VERSION = 13
_CURSORS = "cursors"
_FILES = text(
    "SELECT oid::bigint, pg_relation_filenode(oid)::bigint FROM pg_class "
    "WHERE relnamespace = current_schema()::regnamespace AND relkind = 'r'"
)
_DRIVER = "postgresql+psycopg"
_NAMES = frozenset({"postgres", "postgresql", _DRIVER})
_OPTIONS = {
    "synchronous_commit": "on",
    "statement_timeout": f"{STATEMENT_TIMEOUT_S}s",
    "idle_in_transaction_session_timeout": f"{STATEMENT_TIMEOUT_S}s",
    "timezone": "UTC",
}


class PostgresEdition:
    """An open database of a PostgreSQL server. See `editions.Edition`."""

    reads_hold_up_writers = False
    last_traces = (
        "Somebody was reading meanwhile, or others own the tables, so traces are left on the disk: let the tables' "
        "owner run VACUUM (FULL) in the database."
    )

    def __init__(self, url: str) -> None:
        """Connect, and make sure that the server keeps what it confirms.

        Args:
            url: Such as `postgresql://name:password@host/database`.

        Raises:
            DatabaseError: The server cannot be reached, or could lose what it confirmed.
        """
        address = _address(url)
        self.told = f"{address.database or 'of PostgreSQL'} on {address.host or 'this machine'}"
        self._engine = _engine(address)
        self._reads = self._engine.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)
        self._looks = self._engine.execution_options(isolation_level="AUTOCOMMIT")
        try:
            with self.reading() as connection:
                _check_server(connection, self.told)
        except SQLAlchemyError as error:
            self.close()
            cause = error.orig if isinstance(error, DBAPIError) else error
            reason = str(cause).strip().splitlines()[0]
            kind = UnreachableError if isinstance(error, OperationalError) else DatabaseError
            raise kind(f"the database {self.told} cannot be used: {reason}") from error
        except DatabaseError:
            self.close()
            raise

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Open a transaction that writes, as soon as no other process has one open."""
        with _no_wait_without_end(), self._engine.begin() as connection:
            connection.execute(select(func.pg_advisory_xact_lock(WRITERS_LOCK)))
            with _cursors_closed(connection):
                yield connection
            _make_sure_that_it_can_be_committed(connection)

    @contextmanager
    def reading(self, *, is_long: bool = False) -> Iterator[Connection]:
        """Open a transaction that sees one state throughout."""
        with _no_wait_without_end(), self._reads.begin() as connection:
            if is_long:
                connection.execute(text("SET LOCAL statement_timeout = 0"))
                connection.execute(text("SET LOCAL idle_in_transaction_session_timeout = 0"))
            with _cursors_closed(connection):
                yield connection

    @contextmanager
    def looking(self) -> Iterator[Connection]:
        """Open a connection on which each statement that reads sees a state of its own."""
        with _no_wait_without_end(), self._looks.connect() as connection:
            yield connection

    def close_cursors(self, connection: Connection) -> None:
        """Close what was not read to its end; the server forgets it with what opened it, and closing it later fails."""
        _close_cursors(connection)

    def probe(self) -> None:
        """Write a row again as it is, and undo it; nobody who writes answers is waited for."""
        with _no_wait_without_end(), self._engine.connect() as connection:
            connection.execute(text("UPDATE alembic_version SET version_num = version_num"))
            connection.rollback()

    def after_upgrade(self, connection: Connection) -> None:
        """Let text be compared letter by letter, as SQLite does, whatever the server's language is.

        The order of rows then depends on nothing that differs between servers, and no index on a library that an update
        of the system replaces.
        """
        query = text(
            "SELECT table_name, column_name, character_maximum_length FROM information_schema.columns "
            "WHERE table_schema = current_schema() AND collation_name IS DISTINCT FROM 'C' "
            "AND data_type IN ('character varying', 'text') ORDER BY 1, 2"
        )
        for table, column, length in connection.execute(query).all():
            kind = "text" if length is None else f"varchar({length})"
            connection.execute(text(f'ALTER TABLE "{table}" ALTER COLUMN "{column}" TYPE {kind} COLLATE "C"'))

    def forget(self) -> bool:
        """Write the tables anew, without what was erased; the old files are deleted.

        The server passes over tables that others own and says so in a notice only, so the files are compared.
        What the server's log of changes and its backups keep is told in docs/decisions/0029-two-editions.md.
        """
        with _no_wait_without_end(), self._engine.connect() as plain:
            connection = plain.execution_options(isolation_level="AUTOCOMMIT")
            connection.execute(text("SET lock_timeout = '1s'"))
            connection.execute(text("SET statement_timeout = 0"))
            try:
                before = set(connection.execute(_FILES).all())
                connection.execute(text("VACUUM (FULL)"))
                after = set(connection.execute(_FILES).all())
            except OperationalError:  # Somebody reads on.
                return False
            finally:
                plain.invalidate()
        return before.isdisjoint(after)

    def close(self) -> None:
        """Close every connection."""
        self._engine.dispose()


def _address(url: str) -> URL:
    try:
        address = make_url(url)
    except (ArgumentError, ValueError):
        raise DatabaseError("DATABASE_URL is no address; use postgresql://name:password@host/database") from None
    if address.drivername not in _NAMES:
        raise DatabaseError(f"DATABASE_URL begins with {address.drivername!r}; use postgresql://")
    return address.set(drivername=_DRIVER)


def _engine(address: URL) -> Engine:
    given = address.query.get("options", "")
    options = " ".join([str(given), *(f"-c {name}={value}" for name, value in _OPTIONS.items())]).strip()
    arguments = {"connect_timeout": _CONNECT_TIMEOUT_S, "application_name": "xar", "keepalives_idle": 30}
    engine = create_engine(
        address,
        connect_args={**arguments, "tcp_user_timeout": 1000 * STATEMENT_TIMEOUT_S, **address.query, "options": options},
        isolation_level="READ COMMITTED",
        # Parameters hold hashes of tokens: they do not belong in messages and logs.
        hide_parameters=True,
        pool_size=POOL_SIZE,
        max_overflow=POOL_SIZE,
        pool_timeout=STATEMENT_TIMEOUT_S,
        pool_pre_ping=True,
    )
    event.listen(engine, "handle_error", _is_unavailable)
    event.listen(engine, "after_cursor_execute", _remember_cursor)
    return engine


def _remember_cursor(connection: Connection, cursor: object, *_: object) -> None:
    if isinstance(cursor, ServerCursor):
        connection.info.setdefault(_CURSORS, []).append(cursor)


@contextmanager
def _cursors_closed(connection: Connection) -> Iterator[None]:
    """Close at the end what was not read to its end: closed later, it would be while others use the connection."""
    try:
        yield
    finally:
        _close_cursors(connection)


def _close_cursors(connection: Connection) -> None:
    if not connection.invalidated:
        for cursor in connection.info.pop(_CURSORS, ()):
            with suppress(psycopg.Error):
                cursor.close()


def _make_sure_that_it_can_be_committed(connection: Connection) -> None:
    """Refuse to commit what an error has ended, which PostgreSQL would undo without a word.

    Raises:
        UnavailableError: Nothing of it can be stored.
    """
    driver = connection.connection.driver_connection
    assert isinstance(driver, psycopg.Connection)  # noqa: S101 - for the type checker
    status = driver.info.transaction_status
    if status != psycopg.pq.TransactionStatus.INTRANS:
        cause = psycopg.errors.InFailedSqlTransaction(f"the transaction is {status.name}")
        raise UnavailableError("COMMIT", None, cause)


def _is_unavailable(context: ExceptionContext) -> Exception | None:
    """Give one name to all that a server says while it cannot do its work, such as when the connection is lost."""
    error = context.sqlalchemy_exception
    if isinstance(error, InterfaceError | InternalError) or (
        context.is_disconnect and not isinstance(error, OperationalError)
    ):
        return OperationalError(context.statement, None, context.original_exception, hide_parameters=True)
    return None


@contextmanager
def _no_wait_without_end() -> Iterator[None]:
    """Say of a process whose connections are all in use that nothing can be stored at the moment."""
    try:
        yield
    except NoConnectionError as error:
        raise OperationalError("connect", None, error) from error


def _check_server(connection: Connection, told: str) -> None:
    def setting(name: str) -> str:
        return str(connection.execute(select(func.current_setting(name))).scalar_one())

    version = int(setting("server_version_num")) // 10_000
    if version < _OLDEST_VERSION:
        raise DatabaseError(f"{told} is kept by PostgreSQL {version}; xar needs {_OLDEST_VERSION} or later")
    if setting("server_encoding") != "UTF8":
        raise DatabaseError(f"the database {told} is in {setting('server_encoding')}; make one with ENCODING 'UTF8'")
    for name in ("fsync", "full_page_writes", "synchronous_commit"):
        if setting(name) != "on":
            wish = "set it to on: answers that were confirmed could be lost"
            raise DatabaseError(f"the server of the database {told} has {name} = {setting(name)}; {wish}")
    if setting("transaction_read_only") == "on" and connection.execute(select(func.pg_is_in_recovery())).scalar_one():
        raise DatabaseError(f"the database {told} is a copy that cannot be written to; name the primary server")
