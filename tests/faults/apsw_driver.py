"""Python's `sqlite3` as far as the program uses it, done by APSW: so the program's own SQL runs on a simulated disk."""

import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import apsw

from tests.faults.disk import VFS_NAME, Disk, Forgetful

_ERRORS: tuple[tuple[type[apsw.Error], type[sqlite3.Error]], ...] = (
    (apsw.ConstraintError, sqlite3.IntegrityError),
    (apsw.Error, sqlite3.OperationalError),
)


@contextmanager
def on_disk(disk: Disk, version: tuple[int, int, int], weakened: Mapping[str, str] | None = None) -> Iterator[None]:
    """Let every database that the program opens meanwhile be written to a simulated disk.

    Args:
        disk: The disk.
        version: Which SQLite the program is to believe it has: it chooses the journal by it.
        weakened: What stands in place of pieces of the program's statements, such as a pragma.
    """
    vfs = Forgetful(disk)

    def connect(path: str, **_options: object) -> "ApswConnection":
        return ApswConnection(str(Path(path).absolute()), weakened or {})

    with mock.patch("sqlite3.dbapi2.connect", connect), mock.patch("sqlite3.sqlite_version_info", version):
        yield
    vfs.unregister()


class ApswConnection(sqlite3.Connection):
    """A connection of APSW in the clothes of one of `sqlite3`; nothing is stored in the latter."""

    def __init__(self, path: str, weakened: Mapping[str, str]) -> None:
        super().__init__(":memory:", check_same_thread=False)
        with translated():
            self._connection = apsw.Connection(path, vfs=VFS_NAME)
            self._connection.set_busy_timeout(10_000)
        self._weakened = weakened

    def cursor(self, factory: object = None) -> "ApswCursor":  # type: ignore[override]  # noqa: ARG002
        """Return a cursor of APSW's."""
        return ApswCursor(self, self._connection, self._weakened)

    def execute(self, sql: str, parameters: Any = ()) -> "ApswCursor":  # noqa: ANN401
        """Run a statement."""
        return self.cursor().execute(sql, parameters)

    def commit(self) -> None:
        """Commit if a transaction is open, as `sqlite3` does."""
        if not self._connection.get_autocommit():
            self.execute("COMMIT")

    def rollback(self) -> None:
        """Undo if a transaction is open."""
        if not self._connection.get_autocommit():
            self.execute("ROLLBACK")

    @property
    def in_transaction(self) -> bool:
        """Whether one is open."""
        return not self._connection.get_autocommit()

    def close(self) -> None:
        """Close both."""
        with translated():
            self._connection.close()
        super().close()


class ApswCursor(sqlite3.Cursor):
    """A cursor, with the rows of a statement fetched at once."""

    def __init__(self, owner: ApswConnection, connection: apsw.Connection, weakened: Mapping[str, str]) -> None:
        super().__init__(owner)
        self._apsw, self._weakened = connection, weakened
        self._rows: list[tuple[Any, ...]] = []
        self._description: Any = None
        self._rowcount = -1
        self._lastrowid: int | None = None

    @property
    def description(self) -> Any:  # noqa: ANN401
        """Seven values for each column; None for what returns no rows."""
        return self._description

    @property
    def rowcount(self) -> int:
        """How many rows were changed."""
        return self._rowcount

    @property
    def lastrowid(self) -> int | None:
        """The row inserted last."""
        return self._lastrowid

    def execute(self, sql: str, parameters: Any = ()) -> "ApswCursor":  # noqa: ANN401
        """Run a statement."""
        for strong, weak in self._weakened.items():
            sql = sql.replace(strong, weak)
        with translated():
            before = self._apsw.total_changes()
            cursor = self._apsw.cursor()
            columns: list[Any] = []
            cursor.exec_trace = _describing(columns)
            self._rows = [tuple(row) for row in cursor.execute(sql, tuple(parameters))]
            self._description = columns[0] if columns and columns[0] else None
            self._rowcount = self._apsw.total_changes() - before
            self._lastrowid = self._apsw.last_insert_rowid()
        return self

    def executemany(self, sql: str, parameters: Iterable[Any]) -> "ApswCursor":
        """Run a statement for each set of parameters."""
        for row in parameters:
            self.execute(sql, row)
        return self

    def fetchone(self) -> Any:  # noqa: ANN401
        """Return the next row or None."""
        return self._rows.pop(0) if self._rows else None

    def fetchmany(self, size: int | None = 1) -> list[Any]:
        """Return the next rows."""
        taken, self._rows = self._rows[: size or 1], self._rows[size or 1 :]
        return taken

    def fetchall(self) -> list[Any]:
        """Return the rows that are left."""
        taken, self._rows = self._rows, []
        return taken

    def __iter__(self) -> Any:  # noqa: ANN401
        return iter(self.fetchall())

    def close(self) -> None:
        """Forget the rows."""
        self._rows = []


@contextmanager
def translated() -> Iterator[None]:
    """Raise the errors of `sqlite3` in place of APSW's."""
    try:
        yield
    except apsw.Error as error:
        raise next(ours for theirs, ours in _ERRORS if isinstance(error, theirs))(str(error)) from error


def _describing(columns: list[Any]) -> Callable[[apsw.Cursor, str, Any], bool]:
    """Note a statement's columns before it runs, for it tells them only until its last row."""

    def note(cursor: apsw.Cursor, _sql: str, _parameters: object) -> bool:
        columns.append([(name, None, None, None, None, None, None) for name, _ in cursor.get_description()])
        return True

    return note
