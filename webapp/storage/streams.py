"""Rows of queries as they come, and several queries read alongside one another: never more than a few rows at once."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Generic, TypeVar

from sqlalchemy import Connection, Executable

Row = tuple[Any, ...]
_Key = TypeVar("_Key", int, tuple[int, int])

_BATCH = 500
"""How many rows are fetched at once."""


def stream(connection: Connection, query: Executable) -> Iterator[Row]:
    """Yield the rows of a query; several may be read in turns on one connection."""
    for row in connection.execute(query, execution_options={"yield_per": _BATCH}):
        yield tuple(row)


class Alongside(Generic[_Key]):
    """Rows in ascending order of a key, handed out key by key.

    Args:
        rows: The rows.
        key: Reads a row's key.
    """

    def __init__(self, rows: Iterable[Row], key: Callable[[Row], _Key]) -> None:
        self._rows = iter(rows)
        self._key: Callable[[Row], _Key] = key
        self._next = next(self._rows, None)

    def of(self, key: _Key) -> list[Row]:
        """Return the rows of a key. Ask in ascending order: rows of smaller keys are gone."""
        found: list[Row] = []
        while self._next is not None and self._key(self._next) <= key:
            if self._key(self._next) == key:
                found.append(self._next)
            self._next = next(self._rows, None)
        return found
