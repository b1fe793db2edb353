"""Help for a participant who is stuck: go on without a page, begin it anew, get a new link."""

import secrets
from datetime import datetime

from sqlalchemy import Column, Connection, func, insert, select, update

from webapp.storage.contents import Stored, page_rows
from webapp.storage.database import Database
from webapp.storage.ledger import resume_slot
from webapp.storage.participants import Participant, hash_token
from webapp.storage.people import PersonError, checked, read_person, record_about
from webapp.storage.records import Entry
from webapp.storage.tables import answers, drive_steps, page_restarts, pages, participant_tokens, participants
from webapp.study.session import Page


def release_page(database: Database, code: str, page: Page, reason: str, actor: str, now: datetime) -> None:
    """Let a participant who is stuck go on without this page: it is stored with nothing on it.

    Raises:
        PersonError: There is no such participant, this is not the page they are at, or the reason is missing.
    """
    told = checked("reason", reason)
    with database.write() as connection:
        person = _at_page(connection, code, page.number)
        row = {"participant_id": person.id, "number": page.number, "kind": page.kind, "submitted_at": now}
        connection.execute(insert(pages).values(**row, trial_number=page.trial_number, nonce=secrets.token_hex(16)))
        if page.number == person.num_pages:
            ended = update(participants).where(participants.c.id == person.id).values(completed_at=now)
            connection.execute(ended)
            if person.slot_released_at is not None:
                resume_slot(connection, person.scope, person.subject, now)
        content = {"page": page.number, "reason": told}
        record_about(connection, person, Entry(now, actor, "page_released", page=page.number, content=content))
        rows = page_rows(Stored(connection), person.id, page.number, None)
        record_about(connection, person, Entry(now, actor, "sent", page=page.number, rows=rows))


def restart_page(database: Database, code: str, page: int, reason: str, actor: str, now: datetime) -> None:
    """Let a participant begin the page they are at anew: a drive from its start, a quiz with all its attempts.

    What was done on it before stays in the data.

    Raises:
        PersonError: There is no such participant, this is not the page they are at, or the reason is missing.
    """
    told = checked("reason", reason)
    with database.write() as connection:
        person = _at_page(connection, code, page)
        number = 1 + _last(connection, person.id, page, page_restarts.c.number)
        row = {
            "after_step": _last(connection, person.id, page, drive_steps.c.number),
            "after_attempt": _last(connection, person.id, page, answers.c.attempt),
        }
        key = {"participant_id": person.id, "page_number": page, "number": number}
        connection.execute(insert(page_restarts).values(**key, **row, at=now))
        content = {"page": page, "number": number, "reason": told, **row}
        record_about(connection, person, Entry(now, actor, "page_restarted", page=page, part=number, content=content))


def make_link(database: Database, code: str, reason: str, actor: str, now: datetime) -> str:
    """Make a personal link for somebody who lost theirs; earlier ones stay good.

    Whoever opens it sees what the participant sees, so it is for a reason.

    Returns:
        The token, which is told nowhere else.

    Raises:
        PersonError: There is no such participant, the study is over for them, or the reason is missing.
    """
    told = checked("reason", reason)
    token = secrets.token_urlsafe(32)
    with database.write() as connection:
        person = read_person(connection, code)
        if not person.is_in_progress:
            raise PersonError(f"the study is over for participant {code!r}; there is nothing to go back to")
        row = {"token_hash": hash_token(token), "participant_id": person.id, "made_at": now}
        connection.execute(insert(participant_tokens).values(row))
        record_about(connection, person, Entry(now, actor, "link_made", content={"reason": told}))
    return token


def _at_page(connection: Connection, code: str, page: int) -> Participant:
    person = read_person(connection, code)
    if not person.is_in_progress:
        raise PersonError(f"the study is over for participant {code!r}")
    if page != person.num_stored + 1:
        raise PersonError(f"participant {code!r} is at page {person.num_stored + 1}, not at page {page}")
    return person


def _last(connection: Connection, participant_id: int, page: int, number: Column[int]) -> int:
    """Return the largest number of a page's rows, 0 if it has none."""
    table = number.table
    query = select(func.max(number)).where(table.c.participant_id == participant_id, table.c.page_number == page)
    return connection.execute(query).scalar_one() or 0
