"""What a record of a participant's doings tells: the rows that were stored, as they stand in the tables."""

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import ColumnElement, Connection, Table, select

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

_Rows = Mapping[str, Sequence[Mapping[str, Any]]]

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


def consent_rows(connection: Connection, participant_id: int) -> _Rows:
    """Return what is stored with a consent."""
    who = select(*(participants.c[name] for name in CONSENTED_COLUMNS)).where(participants.c.id == participant_id)
    return {
        "participants": [dict(row) for row in connection.execute(who).mappings()],
        **{table.name: _rows(connection, table, participant_id) for table in (recruits, arrangements, trials)},
    }


def attempt_rows(connection: Connection, participant_id: int, page: int, attempt: int) -> _Rows:
    """Return the answers of one attempt at the questions of a page."""
    return {
        "answers": _rows(
            connection, answers, participant_id, answers.c.page_number == page, answers.c.attempt == attempt
        )
    }


def step_rows(connection: Connection, participant_id: int, page: int, number: int) -> _Rows:
    """Return one action of a drive."""
    of_step = (drive_steps.c.page_number == page, drive_steps.c.number == number)
    return {"drive_steps": _rows(connection, drive_steps, participant_id, *of_step)}


def page_rows(connection: Connection, participant_id: int, page: int, attempt: int | None) -> _Rows:
    """Return what is stored with a page that was sent: of its answers, those of the last attempt."""
    found: dict[str, Sequence[Mapping[str, Any]]] = {
        table.name: _rows(connection, table, participant_id, table.c.page_number == page)
        for table in (ratings, predictions, drives, events)
    }
    found["pages"] = _rows(connection, pages, participant_id, pages.c.number == page)
    return found if attempt is None else {**found, **attempt_rows(connection, participant_id, page, attempt)}


def _rows(
    connection: Connection, table: Table, participant_id: int, *conditions: ColumnElement[bool]
) -> list[dict[str, Any]]:
    columns = [column for column in table.columns if column.name != "participant_id"]
    query = select(*columns).where(table.c.participant_id == participant_id, *conditions)
    return [dict(row) for row in connection.execute(query.order_by(*table.primary_key.columns)).mappings()]
