"""The rows of what participants send, inserted within the transaction that decides whether they may."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from datetime import datetime

from sqlalchemy import Connection, Table, bindparam, func, insert, select, update

from webapp.storage.contents import as_stored
from webapp.storage.ledger import resume_slot
from webapp.storage.participants import LATEST_SIGN, Participant
from webapp.storage.tables import (
    answers,
    drive_steps,
    drives,
    events,
    pages,
    participants,
    predictions,
    ratings,
)
from webapp.study.answers import Answer, DriveResult, DriveStep, Event, PageContent, Prediction
from webapp.study.questionnaire import Ratings
from webapp.study.session import Page

# Every page that is sent needs these; putting them together takes longer than asking.
_INSERTS = {table: insert(table) for table in (answers, drive_steps, drives, events, pages, predictions, ratings)}
_TOUCH = update(participants).where(participants.c.id == bindparam("whose")).values(last_seen_at=LATEST_SIGN)
# How far somebody was when their page was looked at; where anything of it changed since, no row has all of this.
_AS_READ = (
    participants.c.id == bindparam("whose"),
    participants.c.salt == bindparam("whose_salt"),
    participants.c.withdrawn_at.is_(None),
    participants.c.screened_out_at.is_(None),
    participants.c.slot_released_at.is_(None),
    select(func.count()).where(pages.c.participant_id == participants.c.id).scalar_subquery() == bindparam("stored"),
)
_GO_ON = update(participants).where(*_AS_READ).values(last_seen_at=LATEST_SIGN)


def insert_page(
    connection: Connection, participant: Participant, page: Page, nonce: str, content: PageContent, now: datetime
) -> Mapping[Table, Sequence[Mapping[str, object]]]:
    """Insert a page with what stands on it; answers to questions have been inserted by then.

    Returns:
        The rows, by table, as they stand there now.
    """
    row = {"number": page.number, "kind": page.kind, "trial_number": page.trial_number, "nonce": nonce}
    key = {"page_number": page.number}
    rows: dict[Table, list[dict[str, object]]] = {
        pages: [row | {"submitted_at": now}],
        ratings: [key | values for values in _rating_rows(content.ratings)],
        predictions: [key | values for values in _rows(content.predictions, Prediction)],
        drives: [key | values for values in _drive_rows(content.drive)],
        events: [key | values for values in _event_rows(content.events, page)],
    }
    for table, of_table in rows.items():
        if of_table:
            connection.execute(_INSERTS[table], [{"participant_id": participant.id} | values for values in of_table])
    return {table: as_stored(table, of_table) for table, of_table in rows.items()}


def insert_answers(
    connection: Connection, participant_id: int, page: Page, content: PageContent, attempt: int, now: datetime
) -> None:
    """Insert the answers of one attempt at the questions of a page."""
    purpose = {"background": "background", "quiz": "quiz"}.get(page.kind, "attention")
    key = {"participant_id": participant_id, "page_number": page.number, "attempt": attempt}
    rows = [key | row | {"purpose": purpose, "submitted_at": now} for row in _rows(content.answers, Answer)]
    connection.execute(_INSERTS[answers], rows)


def touch(connection: Connection, participant: Participant, now: datetime, **changes: datetime | None) -> None:
    """Note a sign of life; the place of somebody who comes back late counts again."""
    connection.execute(_TOUCH, {"whose": participant.id, "now": now, **changes})
    if participant.slot_released_at is not None:
        resume_slot(connection, participant.scope, participant.subject, now)


def go_on(connection: Connection, participant: Participant, now: datetime, **changes: datetime | None) -> bool:
    """Note a sign of life, as `touch`, of somebody in progress who is as far as when they were read.

    Returns:
        Whether it was noted. If not, it takes a closer look to tell what is different, or special about them.
    """
    if participant.was_ended_early or participant.slot_released_at is not None:
        return False
    wanted = {"whose": participant.id, "whose_salt": participant.salt, "stored": participant.num_stored}
    return bool(connection.execute(_GO_ON, {**wanted, "now": now, **changes}).rowcount)


def insert_step(
    connection: Connection, participant_id: int, page: Page, step: DriveStep, number: int, now: datetime
) -> None:
    """Insert one action of a drive under its number within the page."""
    row = {"number": number, "action": step.action, "elapsed_ms": step.elapsed_ms}
    of_page = {"participant_id": participant_id, "page_number": page.number, "page_kind": page.kind}
    told = {"trial_number": page.trial_number, "received_at": now}
    connection.execute(_INSERTS[drive_steps], {**of_page, **row, **told})


def _rows(entries: Sequence[Answer] | Sequence[Prediction], kind: type[Answer | Prediction]) -> list[dict[str, object]]:
    return [{field.name: getattr(entry, field.name) for field in fields(kind)} for entry in entries]


def _rating_rows(given: Ratings | None) -> list[dict[str, object]]:
    if given is None:
        return []
    return [
        {"item": item, "rating": rating, "response_time_ms": given.response_times[item]}
        for item, rating in given.values.items()
    ]


def _drive_rows(result: DriveResult | None) -> list[dict[str, object]]:
    if result is None:
        return []
    row = {field.name: getattr(result, field.name) for field in fields(DriveResult)}
    lists = {name: " ".join(map(str, row[name])) for name in ("subgoals_passed", "key_points")}
    return [row | lists]


def _event_rows(entries: Sequence[Event], page: Page) -> list[dict[str, object]]:
    """Return a log to store; on the page of background questions without what was answered and taken back again."""
    is_private = page.kind == "background"
    return [
        {
            "number": number,
            "event": entry.name,
            "target": entry.target,
            "value": "" if is_private else entry.value,
            "at_ms": entry.at_ms,
        }
        for number, entry in enumerate(entries, start=1)
    ]
