"""What a record of a participant's doings tells: the rows that were stored, as they stand in the tables."""

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any, Protocol

from sqlalchemy import Connection, Select, Table, bindparam, select

from webapp.storage.tables import (
    answers,
    arrangements,
    drive_steps,
    drives,
    events,
    pages,
    participants,
    predictions,
    ratings,
    recruits,
    trials,
)

_Row = Mapping[str, Any]
_Rows = Mapping[str, Sequence[_Row]]

CONSENTED_COLUMNS = (
    "code",
    "mode",
    "study",
    "study_version",
    "consent_version",
    "language",
    "translation",
    "guardian_agreed",
    "num_pages",
    "consented_at",
)
"""What of a participant's row never changes."""


class Source(Protocol):
    """Where a participant's rows come from."""

    def rows(self, table: Table, participant_id: int, **wanted: int) -> Sequence[_Row]:
        """Return a participant's rows of a table that have some values, in the order of the primary key."""


class Stored:
    """Rows as one needs them: for what was written just now."""

    def __init__(self, connection: Connection, written: Mapping[Table, Sequence[_Row]] | None = None) -> None:
        """Read within a transaction.

        Args:
            connection: The transaction.
            written: By table, all rows to be asked for, where they are known; these tables are not asked.
        """
        self._connection = connection
        self._written = written or {}

    def rows(self, table: Table, participant_id: int, **wanted: int) -> Sequence[_Row]:
        """Ask for these rows alone."""
        if table in self._written:
            return self._written[table]
        found = self._connection.execute(_rows_with(table, *wanted), {"owner_": participant_id, **wanted})
        return [dict(row) for row in found.mappings()]


class Remembered:
    """All rows of groups of participants: for reading a whole log, in which people who came together take turns."""

    _GROUP = 256
    _NUM_KEPT = 16

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._kept: OrderedDict[int, dict[str, dict[int, list[_Row]]]] = OrderedDict()

    def rows(self, table: Table, participant_id: int, **wanted: int) -> Sequence[_Row]:
        """Ask once for the rows of everybody in the participant's group, and choose among them."""
        group = participant_id // self._GROUP
        tables = self._kept.setdefault(group, {})
        self._kept.move_to_end(group)
        if len(self._kept) > self._NUM_KEPT:
            self._kept.popitem(last=False)
        if table.name not in tables:
            tables[table.name] = self._read(table, group)
        found = tables[table.name].get(participant_id, [])
        return [row for row in found if all(row[name] == value for name, value in wanted.items())]

    def _read(self, table: Table, group: int) -> dict[int, list[_Row]]:
        owner = _owner(table)
        first = group * self._GROUP
        query = select(table).where(table.c[owner].between(first, first + self._GROUP - 1))
        query = query.order_by(*table.primary_key.columns)
        found: dict[int, list[_Row]] = {}
        for row in self._connection.execute(query).mappings():
            values = dict(row)
            found.setdefault(values.pop(owner), []).append(values)
        return found


def as_stored(table: Table, rows: Iterable[_Row]) -> Sequence[_Row]:
    """Return one participant's rows, given as they were inserted, as `Source` does: whole, in the same order."""
    names, key = _names(table)
    whole = [{name: row.get(name) for name in names} for row in rows]
    return sorted(whole, key=lambda row: tuple(row[name] for name in key))


def consent_rows(source: Source, participant_id: int) -> _Rows:
    """Return what is stored with a consent."""
    (person,) = source.rows(participants, participant_id) or ({},)
    return {
        "participants": [{name: person.get(name) for name in CONSENTED_COLUMNS}],
        **{table.name: source.rows(table, participant_id) for table in (recruits, arrangements, trials)},
    }


def attempt_rows(source: Source, participant_id: int, page: int, attempt: int) -> _Rows:
    """Return the answers of one attempt at the questions of a page."""
    return {"answers": source.rows(answers, participant_id, page_number=page, attempt=attempt)}


def step_rows(source: Source, participant_id: int, page: int, number: int) -> _Rows:
    """Return one action of a drive."""
    return {"drive_steps": source.rows(drive_steps, participant_id, page_number=page, number=number)}


def page_rows(
    source: Source, participant_id: int, page: int, attempt: int | None, ended: Sequence[_Row] | None = None
) -> _Rows:
    """Return what is stored with a page that was sent: of its answers, those of the last attempt.

    Args:
        source: Where the rows come from.
        participant_id: Whose page it is.
        page: Its number.
        attempt: The number of the last attempt at its questions; None where it has none.
        ended: Whether and when the study ended with it, as `_ending` tells, where that need not be asked.
    """
    of_page = {
        table.name: source.rows(table, participant_id, page_number=page)
        for table in (ratings, predictions, drives, events)
    }
    found = {
        **of_page,
        "pages": source.rows(pages, participant_id, number=page),
        "ended": _ending(source, participant_id, page) if ended is None else ended,
    }
    return found if attempt is None else {**found, **attempt_rows(source, participant_id, page, attempt)}


def _ending(source: Source, participant_id: int, page: int) -> Sequence[_Row]:
    """Return whether and when the study ended with a page, if it is the last one there is."""
    is_last = page == max((row["number"] for row in source.rows(pages, participant_id)), default=0)
    person = source.rows(participants, participant_id) if is_last else ()
    ended = [
        {
            "completed_at": row["completed_at"] if page == row["num_pages"] else None,
            "screened_out_at": row["screened_out_at"],
        }
        for row in person
    ]
    return [entry for entry in ended if any(entry.values())]


@cache
def _names(table: Table) -> tuple[Sequence[str], Sequence[str]]:
    """Return the columns that rows are told with, and those of them that they are ordered by."""
    owner = _owner(table)
    names = [column.name for column in table.columns if column.name != owner]
    return names, [column.name for column in table.primary_key.columns if column.name != owner]


@cache
def _rows_with(table: Table, *names: str) -> Select[Any]:
    """Return the query for the rows of somebody with some values; putting it together takes longer than asking."""
    owner = _owner(table)
    columns = [column for column in table.columns if column.name != owner]
    query = select(*columns).where(table.c[owner] == bindparam("owner_"))
    return query.where(*(table.c[name] == bindparam(name) for name in names)).order_by(*table.primary_key.columns)


def _owner(table: Table) -> str:
    """Return the column that says whose row it is."""
    return "id" if table is participants else "participant_id"
