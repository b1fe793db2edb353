"""The proof that nothing was changed: the chain of records, and the rows that it vouches for."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, func, select

from webapp.storage.contents import Remembered, Source, attempt_rows, consent_rows, page_rows, step_rows
from webapp.storage.database import Database
from webapp.storage.records import FIRST_HASH, LEDGER, Head, Subject, chained, content_digest
from webapp.storage.snapshot import snapshot
from webapp.storage.tables import answers, drive_steps, page_restarts, pages, participants, record_contents, records

_MOST_TOLD = 100


@dataclass(frozen=True, slots=True)
class Verification:
    """What came of checking a log.

    Attributes:
        head: The end of the chain.
        num_erased: How many records are about participants who were erased: the chain holds, their contents are gone.
        num_unvouched: How many participants began before there was a log, so that their answers are not vouched for.
        problems: A line for each thing that is not as it was recorded, the first hundred; none if all is well.
    """

    head: Head
    num_erased: int
    num_unvouched: int
    problems: tuple[str, ...]


def verify_log(database: Database, known: tuple[int, str] | None = None) -> Verification:
    """Check the whole chain, and every row of participants that it vouches for.

    Args:
        database: Whose log.
        known: Number and hash of a head that was noted down before. Only with one can it be seen that the end of a log
            was cut off, or that all of it was written anew.
    """
    problems: list[str] = []
    is_there = known is None
    with snapshot(database) as connection:
        head, num_erased = Head(0, FIRST_HASH), 0
        subjects = _subjects(connection)
        source = Remembered(connection)
        present = {subject.digest for subject in subjects.values()}
        for told in _records(connection):
            problems += _chain_problems(told, head)
            head = Head(told["number"], told["hash"])
            is_there |= known == (head.number, head.hash)
            is_erased = told["subject"] is not None and told["subject"] not in present
            num_erased += is_erased
            if not is_erased or told["action"] in LEDGER:
                problems += _content_problems(source, told, subjects)
        if known is not None and not is_there:
            problems.append(f"the log does not contain record {known[0]} with the hash {known[1]}")
        problems += _unrecorded(connection)
        num_unvouched = len(set(subjects) - _vouched(connection))
    return Verification(head, num_erased, num_unvouched, tuple(problems[:_MOST_TOLD]))


def _records(connection: Connection) -> Iterator[Mapping[str, Any]]:
    told = record_contents.c
    query = (
        select(records, told.participant_id, told.page_number, told.part, told.content, told.number.label("told"))
        .outerjoin(record_contents, told.number == records.c.number)
        .order_by(records.c.number)
    )
    for row in connection.execution_options(yield_per=1000).execute(query).mappings():
        yield dict(row)


def _chain_problems(row: Mapping[str, Any], last: Head) -> Iterator[str]:
    number = row["number"]
    if number != last.number + 1:
        yield f"record {number} comes after record {last.number}: records between them are missing"
    if row["previous_hash"] != last.hash:
        yield f"record {number} does not continue the chain of record {last.number}"
    if chained(row, row["previous_hash"])["hash"] != row["hash"]:
        yield f"record {number} ({row['action']}) is not what its hash says"


def _content_problems(source: Source, row: Mapping[str, Any], subjects: Mapping[int, Subject]) -> Iterator[str]:
    number, participant_id, action = row["number"], row["participant_id"], row["action"]
    if row["told"] is None:
        yield f"record {number} ({action}) has lost what it tells"
        return
    subject = subjects.get(participant_id) if participant_id is not None else None
    if subject is not None and subject.digest != row["subject"]:
        yield f"record {number} ({action}) is about somebody else than participant {subject.code}"
    salt = "" if subject is None or action in LEDGER else subject.salt
    told = _told(source, row) if row["content"] is None else json.loads(row["content"])
    if content_digest(salt, told) != row["content_digest"]:
        place = "" if row["page_number"] is None else f", page {row['page_number']}"
        yield f"record {number} ({action}{place}): what it tells was changed"


def _told(source: Source, row: Mapping[str, Any]) -> Mapping[str, Any] | None:
    who, page, part = row["participant_id"], row["page_number"], row["part"]
    if who is None:
        return None
    match row["action"]:
        case "consented":
            return consent_rows(source, who)
        case "attempted":
            return attempt_rows(source, who, page, part)
        case "acted":
            return step_rows(source, who, page, part)
        case "sent":
            return page_rows(source, who, page, part)
        case _:
            return None


def _subjects(connection: Connection) -> dict[int, Subject]:
    query = select(participants.c.id, participants.c.code, participants.c.salt)
    return {row.id: Subject(*row) for row in connection.execute(query)}


def _vouched(connection: Connection) -> set[int]:
    query = (
        select(record_contents.c.participant_id)
        .join(records, records.c.number == record_contents.c.number)
        .where(records.c.action == "consented", record_contents.c.participant_id.is_not(None))
    )
    return set(connection.execute(query).scalars())


def _unrecorded(connection: Connection) -> Iterator[str]:
    """Yield what is stored of participants whom the log vouches for, and was never recorded."""
    vouched = _vouched(connection)
    codes = dict(tuple(row) for row in connection.execute(select(participants.c.id, participants.c.code)))
    stored = {
        "page": select(pages.c.participant_id, pages.c.number),
        "action of page": select(drive_steps.c.participant_id, drive_steps.c.page_number, drive_steps.c.number),
        "attempt at page": select(answers.c.participant_id, answers.c.page_number, answers.c.attempt).distinct(),
        "restart of page": select(page_restarts.c.participant_id, page_restarts.c.page_number, page_restarts.c.number),
    }
    recorded = {
        "page": _recorded(connection, "sent", with_part=False),
        "action of page": _recorded(connection, "acted"),
        "attempt at page": _recorded(connection, "attempted") | _recorded(connection, "sent"),
        "restart of page": _recorded(connection, "page_restarted"),
    }
    for what, query in stored.items():
        for participant_id, *place in connection.execute(query):
            if participant_id in vouched and (participant_id, *place) not in recorded[what]:
                yield f"participant {codes[participant_id]}: {what} {place[0]} was stored and never recorded"
    yield from _endings(connection, vouched)


def _recorded(connection: Connection, action: str, *, with_part: bool = True) -> set[tuple[int, ...]]:
    told = record_contents.c
    columns = (told.participant_id, told.page_number, *((told.part,) if with_part else ()))
    query = select(*columns).join(records, records.c.number == told.number).where(records.c.action == action)
    return {tuple(row) for row in connection.execute(query.where(told.participant_id.is_not(None)))}


def _endings(connection: Connection, vouched: set[int]) -> Iterator[str]:
    """Yield who is said to have finished or left and did not, or the other way round."""
    sent = select(func.count()).select_from(pages).where(pages.c.participant_id == participants.c.id).scalar_subquery()
    query = select(participants, sent.label("num_sent"))
    left = {participant_id for participant_id, *_ in _recorded(connection, "withdrew", with_part=False)}
    for row in connection.execute(query).mappings():
        if row["id"] not in vouched:
            continue
        is_complete = row["num_sent"] == row["num_pages"] and row["screened_out_at"] is None
        if (row["completed_at"] is not None) != is_complete:
            yield f"participant {row['code']}: completed_at does not go with the {row['num_sent']} pages that were sent"
        if (row["withdrawn_at"] is not None) != (row["id"] in left):
            yield f"participant {row['code']}: withdrawn_at does not go with what was recorded"
