"""What the dashboard asks for besides numbers: which data there are, the log, exclusions, who may see the arms."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Row, func, select

from webapp.storage.database import Database
from webapp.storage.people import Exclusion, exclusion_states
from webapp.storage.records import Action, Head, head
from webapp.storage.scope import Mode, Scope
from webapp.storage.tables import participants, record_contents, records


@dataclass(frozen=True, slots=True)
class PresentScope:
    """Data that the database holds.

    Attributes:
        mode: Who took part.
        study_version: The hash of the bundle.
        num_people: How many of them there are.
    """

    mode: Mode
    study_version: str
    num_people: int


@dataclass(frozen=True, slots=True)
class RecordLine:
    """One record of the log, with what it tells about as far as that is still there.

    Attributes:
        number: Its number.
        at: When it happened.
        actor: `participant`, `system`, or the name of an account.
        action: What happened.
        mode: Of whose data; None for what concerns accounts alone.
        study_version: The same.
        code: The participant it is about; None for nobody, and for whoever was erased.
        is_about_somebody: Whether it is about a participant, erased or not.
        page: The page it is about, if any.
        part: The number of the attempt or of the drive's action, if any.
        detail: What was recorded besides.
        hash: Its hash.
    """

    number: int
    at: datetime
    actor: str
    action: Action
    mode: Mode | None
    study_version: str | None
    code: str | None
    is_about_somebody: bool
    page: int | None
    part: int | None
    detail: Mapping[str, Any]
    hash: str


def scopes_present(database: Database, study: str) -> tuple[PresentScope, ...]:
    """Return which data of a study there are, the version that began last first."""
    people = participants.c
    query = (
        select(people.mode, people.study_version, func.count())
        .where(people.study == study)
        .group_by(people.mode, people.study_version)
        .order_by(func.max(people.id).desc())
    )
    with database.read() as connection:
        return tuple(PresentScope(*row) for row in connection.execute(query))


def head_of_log(database: Database) -> Head:
    """Return the end of the log."""
    with database.read() as connection:
        return head(connection)


def excluded_people(database: Database, scope: Scope) -> tuple[tuple[str, Exclusion], ...]:
    """Return the codes of those who are excluded, with why, the latest decision first."""
    with database.read() as connection:
        states = exclusion_states(connection, scope)
        query = select(participants.c.id, participants.c.code).where(scope.of(participants))
        codes = {row.id: row.code for row in connection.execute(query)} if states else {}
    known = [(codes[person], exclusion) for person, exclusion in states.items() if person in codes]
    return tuple(sorted(known, key=lambda told: told[1].at, reverse=True))


def num_corrections(database: Database, scope: Scope) -> int:
    """Return how many corrections are recorded about people who are still there: erasing takes the contents away."""
    about = record_contents.c.number == records.c.number
    query = (
        select(func.count())
        .select_from(records)
        .join(record_contents, about)
        .where(records.c.action == "corrected", scope.of(records))
    )
    with database.read() as connection:
        return connection.execute(query).scalar_one()


def latest_records(
    database: Database, actions: Sequence[Action] | None, before: int | None, limit: int
) -> tuple[RecordLine, ...]:
    """Return records, the latest first.

    Args:
        database: Where they are.
        actions: Only these kinds; None for all.
        before: Only those with a smaller number; None for all.
        limit: How many at most.
    """
    told = record_contents.c
    query = (
        select(
            records,
            participants.c.code,
            records.c.subject.is_not(None).label("is_about_somebody"),
            told.page_number,
            told.part,
            told.content,
        )
        .outerjoin(record_contents, told.number == records.c.number)
        .outerjoin(participants, participants.c.id == told.participant_id)
        .order_by(records.c.number.desc())
        .limit(limit)
    )
    if actions is not None:
        query = query.where(records.c.action.in_(actions))
    if before is not None:
        query = query.where(records.c.number < before)
    with database.read() as connection:
        return tuple(_line(row) for row in connection.execute(query))


def _line(row: Row[Any]) -> RecordLine:
    return RecordLine(
        number=row.number,
        at=row.at,
        actor=row.actor,
        action=row.action,
        mode=row.mode,
        study_version=row.study_version,
        code=row.code,
        is_about_somebody=row.is_about_somebody,
        page=row.page_number,
        part=row.part,
        detail={} if row.content is None else json.loads(row.content),
        hash=row.hash,
    )
