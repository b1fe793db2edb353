"""A table of numbered names whose writers share commits."""

import sqlite3
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Literal

from sqlalchemy import Connection

from webapp.storage.database import Database
from webapp.storage.group_commit import GroupCommit

Deed = Literal["store", "fail", "break"]


_TABLES = (
    "CREATE TABLE numbers (number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE)",
    "CREATE TABLE owed (name TEXT REFERENCES numbers (name) DEFERRABLE INITIALLY DEFERRED)",
)


class Turns:
    """A database with a table of numbered names, and the turns at it."""

    def __init__(self, path: Path, max_members: int = 32) -> None:
        self.database = Database(path)
        self.group = GroupCommit(self.database.edition.writing, max_members)
        with self.group.write() as connection:
            for table in _TABLES:
                connection.exec_driver_sql(table)
        self.group.num_commits = 0

    def add(self, name: str, deed: Deed = "store") -> int:
        """Add a name under the next number, which is one more than there are, and then perhaps fail."""
        with self.group.write() as connection:
            number = insert(connection, name)
            if deed == "fail":
                raise ValueError(name)
            if deed == "break":
                connection.exec_driver_sql("INSERT OR ROLLBACK INTO numbers VALUES (?, ?)", (number, name))
        return number

    def owe(self, name: str) -> None:
        """Promise a name that will not be there: the commit fails, and only the commit."""
        with self.group.write() as connection:
            connection.exec_driver_sql("INSERT INTO owed VALUES (?)", (name,))

    def stored(self) -> dict[int, str]:
        """What another connection sees."""
        with closing(sqlite3.connect(self.database.path)) as connection:
            return dict(connection.execute("SELECT number, name FROM numbers ORDER BY number"))

    def while_held(self, *actions: Callable[[], object]) -> list[Future[object]]:
        """Start actions one after the other while somebody else has the turn, who then stores the name `first`."""
        with ThreadPoolExecutor(len(actions)) as pool:
            with self.group.write() as connection:
                started = []
                for number, action in enumerate(actions, start=1):
                    started.append(pool.submit(action))
                    while len(self.group._waiting) < number:
                        pass
                insert(connection, "first")
            return started


def insert(connection: Connection, name: str) -> int:
    (last,) = connection.exec_driver_sql("SELECT coalesce(max(number), 0) FROM numbers").one()
    connection.exec_driver_sql("INSERT INTO numbers VALUES (?, ?)", (last + 1, name))
    return int(last) + 1
