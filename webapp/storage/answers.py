"""What participants send: pages with everything on them, and the steps of a drive. Each is one transaction."""

from collections.abc import Sequence
from dataclasses import fields
from datetime import datetime
from typing import Literal

from sqlalchemy import Connection, func, insert, select, update

from webapp.storage.database import Database
from webapp.storage.participants import Participant, read_participant
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
from webapp.study.session import DRIVEN, Decision, Page, decide

Outcome = Decision | Literal["ended"]
"""What became of a page that was sent; `ended`: the study is over for the participant, who left or was screened out."""

RATED_PAGES = frozenset({"rating", "satisfaction"})
"""The pages that hold ratings."""


def store_page(
    database: Database, participant: Participant, page: Page, nonce: str, content: PageContent, now: datetime
) -> Outcome:
    """Store a page with everything on it, if it is this page's turn. What was stored first stands.

    Args:
        database: Where to store.
        participant: Whose page it is; how far the participant is, is read anew.
        page: The page.
        nonce: The nonce that came with it.
        content: What stands on it. If it is not final only the answers of the attempt are stored.
        now: The time of the answer.

    Returns:
        `accept` if it was stored; else why nothing was.

    Raises:
        ValueError: The content does not belong to this kind of page.
        webapp.study.session.NoSuchPageError: There is no page of this number.
    """
    _check(page, content)
    with database.write() as connection:
        fresh, outcome = _decide(connection, participant, page)
        if fresh is None or outcome != "accept":
            return outcome
        if content.answers and content.attempt != _num_attempts(connection, fresh.id, page.number) + 1:
            return "already_answered"
        if content.drive and content.drive.num_steps != _num_steps(connection, fresh.id, page.number):
            return "already_answered"  # An action that came from another window in between stands.
        _insert_answers(connection, fresh.id, page, content, now)
        if content.is_final:
            _insert_page(connection, fresh, page, nonce, content, now)
        else:
            _touch(connection, fresh.id, last_seen_at=now)
    return "accept"


def store_step(database: Database, participant: Participant, page: Page, step: DriveStep, now: datetime) -> Outcome:
    """Store one action of a drive that goes on after it. The first action of a number stands.

    Raises:
        webapp.study.session.NoSuchPageError: There is no page of this number.
    """
    return _store_step(database, participant, page, step, now)


def store_last_step(
    database: Database,
    participant: Participant,
    page: Page,
    nonce: str,
    step: DriveStep,
    content: PageContent,
    now: datetime,
) -> Outcome:
    """Store the action with which a drive ends, together with the page.

    Raises:
        ValueError: The content does not belong to this kind of page.
        webapp.study.session.NoSuchPageError: There is no page of this number.
    """
    _check(page, content)
    return _store_step(database, participant, page, step, now, ending=(nonce, content))


def drive_actions(database: Database, participant: Participant, page_number: int) -> tuple[str, ...]:
    """Return the actions that are stored of a drive, in order."""
    query = (
        select(drive_steps.c.action)
        .where(drive_steps.c.participant_id == participant.id, drive_steps.c.page_number == page_number)
        .order_by(drive_steps.c.number)
    )
    with database.read() as connection:
        return tuple(connection.execute(query).scalars())


def num_attempts(database: Database, participant: Participant, page_number: int) -> int:
    """Return how often the questions of a page were answered so far."""
    with database.read() as connection:
        return _num_attempts(connection, participant.id, page_number)


def last_answers(database: Database, participant: Participant, page_number: int) -> dict[str, Answer]:
    """Return by question the answers of the latest attempt at a page; none if there was no attempt."""
    with database.read() as connection:
        query = select(answers.c.question, answers.c.answer, answers.c.is_correct).where(
            answers.c.participant_id == participant.id,
            answers.c.page_number == page_number,
            answers.c.attempt == _num_attempts(connection, participant.id, page_number),
        )
        return {row.question: Answer(*row) for row in connection.execute(query)}


def _store_step(
    database: Database,
    participant: Participant,
    page: Page,
    step: DriveStep,
    now: datetime,
    ending: tuple[str, PageContent] | None = None,
) -> Outcome:
    with database.write() as connection:
        fresh, outcome = _decide(connection, participant, page)
        if fresh is None or outcome != "accept":
            return outcome
        outcome = _insert_step(connection, fresh.id, page, step, now)
        if outcome == "accept" and ending is not None:
            _insert_page(connection, fresh, page, *ending, now)
        return outcome


def _check(page: Page, content: PageContent) -> None:
    if (content.ratings is not None) != (page.kind in RATED_PAGES):
        raise ValueError(f"ratings belong to rating pages and to no others, and this is {page.kind!r}")
    if (content.drive is not None) != (page.kind in DRIVEN):
        raise ValueError(f"a drive's result belongs to its page and to no other, and this is {page.kind!r}")
    if bool(content.predictions) != (page.kind == "probe"):
        raise ValueError(f"predictions belong to probe pages and to no others, and this is {page.kind!r}")


def _decide(connection: Connection, participant: Participant, page: Page) -> tuple[Participant | None, Outcome]:
    fresh = read_participant(connection, participant.token_hash)
    if fresh is None or fresh.was_ended_early:
        return None, "ended"
    return fresh, decide(page.number, fresh.num_stored, fresh.num_pages)


def _insert_step(connection: Connection, participant_id: int, page: Page, step: DriveStep, now: datetime) -> Outcome:
    stored = _num_steps(connection, participant_id, page.number)
    if step.number != stored + 1:
        return "already_answered" if step.number <= stored else "too_early"
    row = {name: getattr(step, name) for name in DriveStep.__slots__}
    of_page = {"participant_id": participant_id, "page_number": page.number, "page_kind": page.kind}
    number = _trial_number(connection, participant_id, page)
    connection.execute(insert(drive_steps).values(**of_page, **row, trial_number=number, received_at=now))
    _touch(connection, participant_id, last_seen_at=now)
    return "accept"


def _num_steps(connection: Connection, participant_id: int, page_number: int) -> int:
    query = select(func.count()).where(
        drive_steps.c.participant_id == participant_id, drive_steps.c.page_number == page_number
    )
    return connection.execute(query).scalar_one()


def _insert_page(
    connection: Connection, participant: Participant, page: Page, nonce: str, content: PageContent, now: datetime
) -> None:
    number = _trial_number(connection, participant.id, page)
    row = {"participant_id": participant.id, "number": page.number, "kind": page.kind, "trial_number": number}
    connection.execute(insert(pages).values(**row, nonce=nonce, submitted_at=now))
    key = {"participant_id": participant.id, "page_number": page.number}
    for table, rows in (
        (ratings, _rating_rows(content.ratings)),
        (predictions, _rows(content.predictions, Prediction)),
        (drives, _drive_rows(content.drive)),
        (events, _event_rows(content.events, page)),
    ):
        if rows:
            connection.execute(insert(table), [key | values for values in rows])
    is_last = page.number == participant.num_pages and not content.screens_out
    _touch(
        connection,
        participant.id,
        last_seen_at=now,
        completed_at=now if is_last else None,
        screened_out_at=now if content.screens_out else None,
    )


def _trial_number(connection: Connection, participant_id: int, page: Page) -> int | None:
    if page.trial is None:
        return None
    query = select(trials.c.number).where(
        trials.c.participant_id == participant_id,
        trials.c.experiment == page.trial.experiment,
        trials.c.position == page.trial.position,
    )
    return int(connection.execute(query).scalar_one())


def _insert_answers(
    connection: Connection, participant_id: int, page: Page, content: PageContent, now: datetime
) -> None:
    if not content.answers:
        return
    purpose = {"background": "background", "quiz": "quiz"}.get(page.kind, "attention")
    key = {"participant_id": participant_id, "page_number": page.number, "attempt": content.attempt}
    rows = [key | row | {"purpose": purpose, "submitted_at": now} for row in _rows(content.answers, Answer)]
    connection.execute(insert(answers), rows)


def _num_attempts(connection: Connection, participant_id: int, page_number: int) -> int:
    query = select(func.max(answers.c.attempt)).where(
        answers.c.participant_id == participant_id, answers.c.page_number == page_number
    )
    return connection.execute(query).scalar_one() or 0


def _touch(connection: Connection, participant_id: int, **changes: datetime | None) -> None:
    connection.execute(update(participants).where(participants.c.id == participant_id).values(changes))


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
