"""Looking into a database from outside, past everything that the program does, and changing it as its owner can."""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import psycopg
from sqlalchemy import make_url

from webapp.storage.database import Database

REFUSALS = (sqlite3.IntegrityError, psycopg.errors.RestrictViolation)
"""What a trigger that keeps rows as they are ends with."""


class Outside:
    """A connection of its own; statements have `?` where values go."""

    def __init__(self, connection: Any) -> None:  # noqa: ANN401 - either driver's.
        self._connection = connection
        self._is_sqlite = isinstance(connection, sqlite3.Connection)

    def execute(self, statement: str, values: Sequence[object] = ()) -> Any:  # noqa: ANN401 - either driver's.
        """Run a statement and return its cursor."""
        if self._is_sqlite:
            return self._connection.execute(statement, values)
        words = statement.replace("%", "%%").replace("?", "%s") if values else statement
        # A statement that fails does not end the transaction of those before it, as with SQLite.
        with self._connection.transaction():
            return self._connection.execute(words, values or None)

    def ask(self, question: str, *values: object) -> list[tuple[Any, ...]]:
        """Return all rows; times as SQLite writes them."""
        return [tuple(_plain(value) for value in row) for row in self.execute(question, values).fetchall()]

    def tables(self) -> list[str]:
        """Return the names of all tables."""
        if self._is_sqlite:
            return [name for (name,) in self.ask("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return [name for (name,) in self.ask("SELECT tablename FROM pg_tables WHERE schemaname = 'public'")]

    def columns(self, table: str) -> list[str]:
        """Return the names of a table's columns."""
        if self._is_sqlite:
            return [row[1] for row in self.ask(f"PRAGMA table_info({table})")]
        return [
            name
            for (name,) in self.ask(
                "SELECT column_name FROM information_schema.columns WHERE table_name = ? ORDER BY ordinal_position",
                table,
            )
        ]

    def disarm(self) -> None:
        """Let nothing be refused any more, be it by triggers or by foreign keys."""
        if self._is_sqlite:
            for (name,) in self.ask("SELECT name FROM sqlite_master WHERE type = 'trigger'"):
                self.execute(f"DROP TRIGGER {name}")
        else:
            self.execute("SET session_replication_role = replica")

    def drop_foreign_keys(self) -> None:
        """Let rows go to which others refer, as SQLite does unless it is told not to."""
        if not self._is_sqlite:
            query = "SELECT conrelid::regclass::text, conname FROM pg_constraint WHERE contype = 'f'"
            for table, name in self.ask(query):
                self.execute(f"ALTER TABLE {table} DROP CONSTRAINT {name}")

    def drop_tables(self) -> None:
        """Drop every table, the rows with them."""
        self.disarm()
        for table in self.tables():
            self.execute(f"DROP TABLE {table}" if self._is_sqlite else f"DROP TABLE {table} CASCADE")

    def schema(self) -> list[tuple[str, ...]]:
        """Return what there is, as the database describes it."""
        if self._is_sqlite:
            return self.ask("SELECT name, sql FROM sqlite_schema ORDER BY name")
        columns = (
            "SELECT table_name, column_name, data_type, collation_name, column_default FROM information_schema.columns "
            "WHERE table_schema = 'public' ORDER BY 1, 2"
        )
        others = (
            "SELECT conname, pg_get_constraintdef(oid) FROM pg_constraint ORDER BY 1, 2",
            "SELECT tgname, pg_get_triggerdef(oid) FROM pg_trigger WHERE NOT tgisinternal ORDER BY 1, 2",
            "SELECT indexname, indexdef FROM pg_indexes WHERE schemaname = 'public' ORDER BY 1, 2",
        )
        return [row for query in (columns, *others) for row in self.ask(query)]

    def commit(self) -> None:
        """Keep what was done."""
        self._connection.commit()


@contextmanager
def outside(database: Database | Path, url: str | None = None) -> Iterator[Outside]:
    """Connect to a database for a while; what is not committed is undone."""
    path, url = (database, url) if isinstance(database, Path) else (database.path, database.url)
    if url is None:
        with closing(sqlite3.connect(path, timeout=10)) as connection:
            yield Outside(connection)
        return
    address = make_url(url)
    with closing(psycopg.connect(address.render_as_string(hide_password=False))) as other:
        yield Outside(other)


def on_disk(database: Database) -> bytes:
    """Close a database and return all that lies on disk of its tables; not the log of changes that PostgreSQL keeps."""
    if database.url is None:
        database.close()
        return b"".join(file.read_bytes() for file in database.path.parent.iterdir() if file.is_file())
    with outside(database) as connection:
        connection.execute("CHECKPOINT")
        ((folder,),) = connection.ask("SELECT current_setting('data_directory')")
        ((number,),) = connection.ask("SELECT oid FROM pg_database WHERE datname = current_database()")
    database.close()
    return b"".join(file.read_bytes() for file in (Path(folder) / "base" / str(number)).iterdir() if file.is_file())


def _plain(value: object) -> object:
    return f"{value:%Y-%m-%d %H:%M:%S.%f}" if hasattr(value, "astimezone") else value
