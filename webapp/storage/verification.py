"""The proof that nothing was changed: the chain of records, and the rows that it vouches for."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, select

from webapp.storage.contents import Remembered, Source, attempt_rows, consent_rows, page_rows, step_rows
from webapp.storage.database import Database
from webapp.storage.records import FIRST_HASH, LEDGER, Head, Subject, chained, content_digest
from webapp.storage.snapshot import snapshot
from webapp.storage.tables import page_restarts, participants, record_contents, records
from webapp.storage.vouched import Vouched, account_problems, stored_problems

_MOST_TOLD = 100

_Row = Mapping[str, Any]


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
    with snapshot(database) as connection:
        check = _Check(connection)
        problems = [*check.chain(known), *check.erasures(), *stored_problems(connection, check.people)]
        problems += account_problems(connection, check.accounts)
    num_unvouched = sum(not person.has_consented for person in check.people.values())
    return Verification(check.head, check.num_erased, num_unvouched, tuple(problems[:_MOST_TOLD]))


class _Check:
    """A log as far as it has been read."""

    def __init__(self, connection: Connection) -> None:
        self.head = Head(0, FIRST_HASH)
        self.num_erased = 0
        self._connection = connection
        self._source: Source = Remembered(connection)
        query = select(participants.c.id, participants.c.code, participants.c.salt)
        self._subjects = {row.id: Subject(*row) for row in connection.execute(query)}
        self.people = {subject.digest: Vouched(subject) for subject in self._subjects.values()}
        # Of subjects who are not there: the record of their place, None until it came.
        self._missing: dict[str, int | None] = {}
        self._erased_slots: set[int] = set()
        self._slots: dict[int, str] = {}
        self.accounts: dict[str, str] = {}

    def chain(self, known: tuple[int, str] | None) -> Iterator[str]:
        """Yield what is wrong with the records, and with what they tell."""
        is_there = known is None
        for row in self._records():
            yield from self._link(row)
            is_there |= known == (self.head.number, self.head.hash)
            yield from self._about(row)
        if known is not None and not is_there:
            yield f"the log does not contain record {known[0]} with the hash {known[1]}"

    def erasures(self) -> Iterator[str]:
        """Yield who is gone without an erasure, and who is there in spite of one."""
        for subject, slot in self._missing.items():
            if slot is None or slot not in self._erased_slots:
                place = f"the place of record {slot}" if slot else f"digest {subject[:12]}"
                yield f"a participant ({place}) is gone, and no erasure was recorded"
        for slot in self._erased_slots:
            if self._slots.get(slot) in self.people:
                yield f"a participant (the place of record {slot}) is there, and was erased by the log"

    def _records(self) -> Iterator[_Row]:
        told = record_contents.c
        query = (
            select(records, told.participant_id, told.page_number, told.part, told.content, told.number.label("told"))
            .outerjoin(record_contents, told.number == records.c.number)
            .order_by(records.c.number)
        )
        for row in self._connection.execute(query, execution_options={"yield_per": 1000}).mappings():
            yield dict(row)

    def _link(self, row: _Row) -> Iterator[str]:
        number, last = row["number"], self.head
        if number != last.number + 1:
            yield f"record {number} comes after record {last.number}: records between them are missing"
        if row["previous_hash"] != last.hash:
            yield f"record {number} does not continue the chain of record {last.number}"
        if chained(row, row["previous_hash"])["hash"] != row["hash"]:
            yield f"record {number} ({row['action']}) is not what its hash says"
        self.head = Head(number, row["hash"])

    def _about(self, row: _Row) -> Iterator[str]:
        subject = row["subject"]
        if row["action"] == "allocated" and subject is not None:
            self._slots[row["number"]] = subject
        if subject is None or subject in self.people:
            yield from self._content(row)
            return
        self.num_erased += 1
        known = self._missing.setdefault(subject, None)
        self._missing[subject] = row["number"] if row["action"] == "allocated" else known
        if row["action"] in LEDGER:
            yield from self._content(row)
        elif row["told"] is not None:
            yield f"{_name(row)} is about somebody who is gone, and still tells something"

    def _content(self, row: _Row) -> Iterator[str]:
        if row["told"] is None:
            yield f"{_name(row)} has lost what it tells"
            return
        person = None if row["subject"] is None else self.people.get(row["subject"])
        if (None if person is None else person.subject.id) != row["participant_id"]:
            yield f"{_name(row)} is said to be about somebody else than it is"
            return
        told = self._told(row)
        salt = "" if person is None or row["action"] in LEDGER else person.subject.salt
        if content_digest(salt, told) != row["content_digest"]:
            yield f"{_name(row)}: what it tells was changed"
        elif row["action"] not in _DERIVED:
            yield from self._place(row, told or {})
        if row["action"] == "erased" and told is not None:
            self._erased_slots.add(told["slot"])
        if person is not None:
            person.take(row, told or {})
        if row["action"] in {"created", "role_changed"} and told is not None:
            self.accounts[told["account"]] = told["role"]

    def _told(self, row: _Row) -> _Row | None:
        """Return what a record tells: rows as they are now where rows are told, whatever else stands beside it."""
        derive = _DERIVED.get(row["action"])
        if derive is None or row["participant_id"] is None:
            return None if row["content"] is None else json.loads(row["content"])
        told = derive(self._source, row["participant_id"], row["page_number"], row["part"])
        return told if row["content"] is None else {"instead": row["content"]}

    def _place(self, row: _Row, told: _Row) -> Iterator[str]:
        """Yield it if the page beside a record is not the one that it tells of."""
        if (row["page_number"], row["part"]) != (told.get("page"), told.get("number")):
            yield f"{_name(row)} is said to be about another page than it is"
        if row["action"] == "page_restarted":
            key = {"page_number": row["page_number"], "number": row["part"]}
            stored = self._source.rows(page_restarts, row["participant_id"], **key)
            steps = [(one["after_step"], one["after_attempt"], one["at"]) for one in stored]
            if steps != [(told["after_step"], told["after_attempt"], row["at"])]:
                yield f"{_name(row)}: where the page was begun anew was changed"


_DERIVED = {
    "consented": lambda source, who, _page, _part: consent_rows(source, who),
    "attempted": attempt_rows,
    "acted": step_rows,
    "sent": page_rows,
}
"""How to read again what was told, where that is rows of the answers' tables."""


def _name(row: _Row) -> str:
    place = "" if row["page_number"] is None else f", page {row['page_number']}"
    return f"record {row['number']} ({row['action']}{place})"
