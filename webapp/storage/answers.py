"""What participants send: pages with everything on them, and the steps of a drive. Each is one transaction."""

from dataclasses import replace
from datetime import datetime
from typing import Literal

from sqlalchemy import Connection, select

from webapp.storage.answer_rows import go_on, insert_answers, insert_page, insert_step, touch
from webapp.storage.contents import Stored, attempt_rows, page_rows, step_rows
from webapp.storage.database import Database
from webapp.storage.participants import Participant, read_participant
from webapp.storage.records import PARTICIPANT, Entry, append
from webapp.storage.restarts import latest_restart, num_attempts_since, num_steps_since, restart_within
from webapp.storage.tables import answers, drive_steps
from webapp.study.answers import Answer, DriveStep, PageContent
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
        ending = _ending(participant, page, content, now)
        if _is_plain(participant, page, content) and go_on(connection, participant, now, **ending):
            _keep_page(connection, participant, page, nonce, content, None, now)
            return "accept"
        fresh, outcome = _decide(connection, participant, page)
        if fresh is None or outcome != "accept":
            return outcome
        restart = restart_within(connection, fresh, page.number)
        if content.answers and content.attempt != num_attempts_since(connection, restart) + 1:
            return "already_answered"
        if content.drive and content.drive.num_steps != num_steps_since(connection, restart):
            return "already_answered"  # An action that came from another window in between stands.
        attempt = restart.after_attempt + content.attempt if content.answers else None
        if attempt is not None:
            insert_answers(connection, fresh.id, page, content, attempt, now)
        if content.is_final:
            touch(connection, fresh, now, **ending)
            _keep_page(connection, fresh, page, nonce, content, attempt, now)
        elif attempt is not None:
            touch(connection, fresh, now)
            rows = attempt_rows(Stored(connection), fresh.id, page.number, attempt)
            _record(connection, fresh, page, Entry(now, PARTICIPANT, "attempted", part=attempt, rows=rows))
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
    """Return the actions that are stored of a drive since it was begun last, in order."""
    with database.read() as connection:
        restart = latest_restart(connection, participant.id, page_number)
        query = select(drive_steps.c.action).where(
            drive_steps.c.participant_id == participant.id,
            drive_steps.c.page_number == page_number,
            drive_steps.c.number > restart.after_step,
        )
        return tuple(connection.execute(query.order_by(drive_steps.c.number)).scalars())


def num_attempts(database: Database, participant: Participant, page_number: int) -> int:
    """Return how often the questions of a page were answered since it was begun last."""
    with database.read() as connection:
        return num_attempts_since(connection, latest_restart(connection, participant.id, page_number))


def last_answers(database: Database, participant: Participant, page_number: int) -> dict[str, Answer]:
    """Return by question the answers of the latest attempt at a page; none if there was no attempt."""
    with database.read() as connection:
        restart = latest_restart(connection, participant.id, page_number)
        latest = num_attempts_since(connection, restart)
        query = select(answers.c.question, answers.c.answer, answers.c.is_correct).where(
            answers.c.participant_id == participant.id,
            answers.c.page_number == page_number,
            answers.c.attempt == (restart.after_attempt + latest if latest else 0),
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
        restart = restart_within(connection, fresh, page.number)
        stored = num_steps_since(connection, restart)
        if step.number != stored + 1:
            return "already_answered" if step.number <= stored else "too_early"
        number = restart.after_step + step.number
        insert_step(connection, fresh.id, page, step, number, now)
        rows = step_rows(Stored(connection), fresh.id, page.number, number)
        _record(connection, fresh, page, Entry(now, PARTICIPANT, "acted", part=number, rows=rows))
        if ending is None:
            touch(connection, fresh, now)
        else:
            nonce, content = ending
            touch(connection, fresh, now, **_ending(fresh, page, content, now))
            _keep_page(connection, fresh, page, nonce, content, None, now)
        return "accept"


def _keep_page(
    connection: Connection,
    participant: Participant,
    page: Page,
    nonce: str,
    content: PageContent,
    attempt: int | None,
    now: datetime,
) -> None:
    written = insert_page(connection, participant, page, nonce, content, now)
    ending = _ending(participant, page, content, now)
    ended = [ending] if any(ending.values()) else []
    rows = page_rows(Stored(connection, written), participant.id, page.number, attempt, ended)
    _record(connection, participant, page, Entry(now, PARTICIPANT, "sent", part=attempt, rows=rows))


def _record(connection: Connection, participant: Participant, page: Page, entry: Entry) -> None:
    append(connection, replace(entry, scope=participant.scope, subject=participant.subject, page=page.number))


def _check(page: Page, content: PageContent) -> None:
    if (content.ratings is not None) != (page.kind in RATED_PAGES):
        raise ValueError(f"ratings belong to rating pages and to no others, and this is {page.kind!r}")
    if (content.drive is not None) != (page.kind in DRIVEN):
        raise ValueError(f"a drive's result belongs to its page and to no other, and this is {page.kind!r}")
    if bool(content.predictions) != (page.kind == "probe"):
        raise ValueError(f"predictions belong to probe pages and to no others, and this is {page.kind!r}")


def _is_plain(participant: Participant, page: Page, content: PageContent) -> bool:
    """Tell whether all that can keep a page from being stored is that its participant is not at it any more."""
    is_due = decide(page.number, participant.num_stored, participant.num_pages) == "accept"
    return is_due and content.is_final and not content.answers and content.drive is None


def _ending(participant: Participant, page: Page, content: PageContent, now: datetime) -> dict[str, datetime | None]:
    """Return when the study is over for whoever sends a page, and in which way; None for neither."""
    is_last = page.number == participant.num_pages and not content.screens_out
    return {"completed_at": now if is_last else None, "screened_out_at": now if content.screens_out else None}


def _decide(connection: Connection, participant: Participant, page: Page) -> tuple[Participant | None, Outcome]:
    fresh = read_participant(connection, participant.token_hash)
    if fresh is None or fresh.was_ended_early:
        return None, "ended"
    return fresh, decide(page.number, fresh.num_stored, fresh.num_pages)
