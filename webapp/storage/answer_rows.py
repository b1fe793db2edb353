"""The rows of what participants send, inserted within the transaction that decides whether they may."""

from collections.abc import Sequence
from dataclasses import fields
from datetime import datetime

from sqlalchemy import Connection, Table, bindparam, insert, select, update

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
    trials,
)
from webapp.study.answers import Answer, DriveResult, DriveStep, Event, PageContent, Prediction
from webapp.study.questionnaire import Ratings
from webapp.study.session import Page

# Every page that is sent needs these; putting them together takes longer than asking.
_INSERTS = {table: insert(table) for table in (answers, drive_steps, drives, events, pages, predictions, ratings)}
_OF_PAGES = frozenset({ratings, predictions, drives, events})
_TOUCH = update(participants).where(participants.c.id == bindparam("whose")).values(last_seen_at=LATEST_SIGN)
_TRIAL_NUMBER = select(trials.c.number).where(
    trials.c.participant_id == bindparam("whose"),
    trials.c.experiment == bindparam("experiment"),
    trials.c.position == bindparam("position"),
)


def insert_page(
    connection: Connection, participant: Participant, page: Page, nonce: str, content: PageContent, now: datetime
) -> frozenset[Table]:
    """Insert a page with what stands on it; answers to questions have been inserted by then.

    Returns:
        The tables that hold nothing of the page.
    """
    number = trial_number(connection, participant.id, page)
    row = {"participant_id": participant.id, "number": page.number, "kind": page.kind, "trial_number": number}
    connection.execute(_INSERTS[pages], {**row, "nonce": nonce, "submitted_at": now})
    key = {"participant_id": participant.id, "page_number": page.number}
    filled: set[Table] = set()
    for table, rows in (
        (ratings, _rating_rows(content.ratings)),
        (predictions, _rows(content.predictions, Prediction)),
        (drives, _drive_rows(content.drive)),
        (events, _event_rows(content.events, page)),
    ):
        if rows:
            connection.execute(_INSERTS[table], [key | values for values in rows])
            filled.add(table)
    return _OF_PAGES - filled


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


def insert_step(
    connection: Connection, participant_id: int, page: Page, step: DriveStep, number: int, now: datetime
) -> None:
    """Insert one action of a drive under its number within the page."""
    row = {"number": number, "action": step.action, "elapsed_ms": step.elapsed_ms}
    of_page = {"participant_id": participant_id, "page_number": page.number, "page_kind": page.kind}
    trial = trial_number(connection, participant_id, page)
    connection.execute(_INSERTS[drive_steps], {**of_page, **row, "trial_number": trial, "received_at": now})


def trial_number(connection: Connection, participant_id: int, page: Page) -> int | None:
    """Return the number of the trial that a page belongs to; None before the trials."""
    if page.trial is None:
        return None
    wanted = {"whose": participant_id, "experiment": page.trial.experiment, "position": page.trial.position}
    return int(connection.execute(_TRIAL_NUMBER, wanted).scalar_one())


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
