"""What the database needs of an edition, and what goes wrong with every one of them."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError

UnavailableError = OperationalError
"""What is raised while nothing can be read or stored, such as on a full disk; trying again later may help."""


class DatabaseError(RuntimeError):
    """A database that cannot be used; the message says what to do."""


class UnreachableError(DatabaseError):
    """A database that does not answer at the moment."""


class Place(Protocol):
    """Where an instance keeps its data, as the settings say."""

    @property
    def database_path(self) -> Path:
        """The file of the SQLite edition; its folder is the instance."""

    @property
    def database_url(self) -> str | None:
        """The address of the PostgreSQL edition's database; None for the SQLite edition."""


class Edition(Protocol):
    """One kind of database: how transactions are begun there, and what it takes that nothing is lost.

    Attributes:
        told: What messages call the database; no password is in it.
        reads_hold_up_writers: Whether somebody who reads for long keeps others from writing.
        last_traces: What to say where `forget` could not do all, and when or how the rest goes.
    """

    told: str
    reads_hold_up_writers: bool
    last_traces: str

    def writing(self) -> AbstractContextManager[Connection]:
        """Open a transaction that writes; it is on disk when the context ends, or undone if that ends with an error."""

    def reading(self, *, is_long: bool = False) -> AbstractContextManager[Connection]:
        """Open a transaction that sees one state throughout.

        Args:
            is_long: Whether it may take as long as it likes.
        """

    def looking(self) -> AbstractContextManager[Connection]:
        """Open a connection on which each statement that reads sees a state of its own, which takes less time."""

    def close_cursors(self, connection: Connection) -> None:
        """Let nothing be read further on a connection, before what opened it is undone."""

    def probe(self) -> None:
        """Write something and undo it."""

    def after_upgrade(self, connection: Connection) -> None:
        """Do what this edition's tables need besides the migrations, in the same transaction."""

    def forget(self) -> bool:
        """Let nothing of erased rows stay behind, unless somebody's reading holds that up; tell whether it is done."""

    def close(self) -> None:
        """Close every connection."""
