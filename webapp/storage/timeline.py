"""Everything that happened to one participant, in order."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, cast

from sqlalchemy import Connection, select

from webapp.storage.database import Database
from webapp.storage.people import read_person
from webapp.storage.records import Action
from webapp.storage.tables import events, pages, record_contents, records


@dataclass(frozen=True, slots=True)
class TimelineEntry:
    """Something that happened.

    Attributes:
        number: Of the record.
        at: When.
        actor: `participant`, `system`, or the name of an account.
        action: What.
        page: The page it is about; None for no page.
        page_kind: What stands on that page; None where it was not sent.
        part: The number of the attempt or of the drive's action, if any.
        detail: What was recorded besides; empty for answers, which stand with the pages.
        away: How often the window was left on a page that was sent.
    """

    number: int
    at: datetime
    actor: str
    action: Action
    page: int | None
    page_kind: str | None
    part: int | None
    detail: Mapping[str, Any]
    away: int


def timeline(database: Database, code: str) -> tuple[TimelineEntry, ...]:
    """Return what happened to a participant, oldest first.

    Raises:
        webapp.storage.people.PersonError: There is no such participant.
    """
    with database.read() as connection:
        person = read_person(connection, code)
        kinds = _kinds(connection, person.id)
        away = _away(connection, person.id)
        told = record_contents.c
        query = (
            select(records.c.number, records.c.at, records.c.actor, records.c.action, told.page_number, told.part)
            .add_columns(told.content)
            .join(record_contents, told.number == records.c.number)
            .where(told.participant_id == person.id)
            .order_by(records.c.number)
        )
        return tuple(
            TimelineEntry(
                number=row.number,
                at=row.at,
                actor=row.actor,
                action=cast("Action", row.action),
                page=row.page_number,
                page_kind=kinds.get(row.page_number),
                part=row.part,
                detail={} if row.content is None else json.loads(row.content),
                away=away.get(row.page_number, 0) if row.action == "sent" else 0,
            )
            for row in connection.execute(query)
        )


def _kinds(connection: Connection, participant_id: int) -> dict[int, str]:
    query = select(pages.c.number, pages.c.kind).where(pages.c.participant_id == participant_id)
    return dict(tuple(row) for row in connection.execute(query))


def _away(connection: Connection, participant_id: int) -> dict[int, int]:
    query = select(events.c.page_number).where(
        events.c.participant_id == participant_id, events.c.event.in_(("focus_lost", "hidden"))
    )
    found: dict[int, int] = {}
    for page in connection.execute(query).scalars():
        found[page] = found.get(page, 0) + 1
    return found
