"""What the log vouches for of a participant beyond single records: that nothing is there besides, and what follows."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, FromClause, func, select, tuple_

from webapp.storage.records import PARTICIPANT, Subject
from webapp.storage.tables import (
    answers,
    drive_steps,
    page_restarts,
    pages,
    participant_tokens,
    participants,
    researchers,
)

_Row = Mapping[str, Any]


@dataclass(slots=True)
class Vouched:
    """What was recorded of a participant who is there.

    Attributes:
        subject: Who it is.
        has_consented: Whether the consent was recorded; not so for people from before the log.
    """

    subject: Subject
    has_consented: bool = False
    _has_place: bool = False
    _is_from_before: bool = False
    _counts: dict[str, int] = field(default_factory=dict)
    _last_sign: datetime | None = None
    _left_at: datetime | None = None
    _released_at: datetime | None = None
    _late_at: datetime | None = None

    def take(self, row: _Row, told: _Row) -> None:
        """Take the next record about the participant."""
        if row["actor"] == PARTICIPANT:
            # Not the last one's: the clock may have been set back in between.
            self._last_sign = row["at"] if self._last_sign is None else max(self._last_sign, row["at"])
        match row["action"]:
            case "consented":
                self.has_consented = True
            case "allocated":
                self._has_place, self._is_from_before = True, told.get("word") is None
            case "slot_released":
                self._released_at = row["at"]
            case "slot_resumed":
                self._released_at, self._late_at = None, row["at"]
            case "withdrew":
                self._left_at = row["at"]
        kind = _KINDS.get(row["action"])
        if kind is not None:
            self._counts[kind] = self._counts.get(kind, 0) + 1
        if row["action"] == "sent" and row["part"] is not None:
            self._counts["attempts"] = self._counts.get("attempts", 0) + 1

    def problems(self, person: _Row, stored: Mapping[str, int], last_page_at: datetime | None) -> Iterator[str]:
        """Yield what is not as the records say.

        Args:
            person: The participant's row.
            stored: How many rows there are of each kind.
            last_page_at: When the last page was stored; None before the first.
        """
        if not self._has_place:
            yield "is there, and was never recorded"
            return
        if (person["slot_released_at"], person["returned_late_at"]) != (self._released_at, self._late_at):
            yield "slot_released_at or returned_late_at does not go with what was recorded"
        if not self.has_consented:
            if not self._is_from_before:
                yield "has no recorded consent"
            return
        for kind in _TABLES:
            if stored.get(kind, 0) != self._counts.get(kind, 0):
                yield f"{stored.get(kind, 0)} {kind} are stored, and {self._counts.get(kind, 0)} were recorded"
        yield from self._endings(person, stored, last_page_at)

    def _endings(self, person: _Row, stored: Mapping[str, int], last_page_at: datetime | None) -> Iterator[str]:
        is_complete = stored.get("pages", 0) == person["num_pages"] and person["screened_out_at"] is None
        if person["completed_at"] != (last_page_at if is_complete else None):
            yield f"completed_at does not go with the {stored.get('pages', 0)} pages that were sent"
        if person["screened_out_at"] not in {None, last_page_at}:
            yield "screened_out_at does not go with the page that was sent last"
        if person["withdrawn_at"] != self._left_at:
            yield "withdrawn_at does not go with what was recorded"
        if person["last_seen_at"] != self._last_sign:
            yield "last_seen_at does not go with what was recorded"
        if is_complete and self._released_at is not None:
            yield "has finished, and the place does not count"


_KINDS = {
    "sent": "pages",
    "acted": "actions of drives",
    "attempted": "attempts",
    "page_restarted": "restarts of pages",
    "link_made": "links",
}
"""What each action stores one of."""

_TABLES: Mapping[str, FromClause] = {
    "pages": pages,
    "actions of drives": drive_steps,
    "attempts": select(answers.c.participant_id, answers.c.page_number, answers.c.attempt).distinct().subquery(),
    "restarts of pages": page_restarts,
    "links": participant_tokens,
}


def stored_problems(connection: Connection, people: Mapping[str, Vouched]) -> Iterator[str]:
    """Yield what is stored of participants and does not go with what was recorded."""
    counts = {kind: _counts(connection, table) for kind, table in _TABLES.items()}
    # The last by number: by time it may be another, where the clock was set back.
    last = select(pages.c.participant_id, func.max(pages.c.number)).group_by(pages.c.participant_id)
    key = tuple_(pages.c.participant_id, pages.c.number)
    query = select(pages.c.participant_id, pages.c.submitted_at).where(key.in_(last))
    last_pages = dict(tuple(row) for row in connection.execute(query))
    rows = {row["id"]: dict(row) for row in connection.execute(select(participants)).mappings()}
    for vouched in people.values():
        who = vouched.subject.id
        stored = {kind: count.get(who, 0) for kind, count in counts.items()}
        for problem in vouched.problems(rows[who], stored, last_pages.get(who)):
            yield f"participant {vouched.subject.code}: {problem}"


def account_problems(connection: Connection, recorded: Mapping[str, str]) -> Iterator[str]:
    """Yield which accounts are not as they were made and changed by command or on the dashboard."""
    stored = dict(tuple(row) for row in connection.execute(select(researchers.c.name, researchers.c.role)))
    for name in sorted(stored.keys() | recorded.keys()):
        now, then = stored.get(name, "not there"), recorded.get(name, "none")
        if stored.get(name) != recorded.get(name):
            yield f"account {name!r} is {now}, and was recorded as {then}"


def _counts(connection: Connection, table: FromClause) -> dict[int, int]:
    query = select(table.c.participant_id, func.count()).group_by(table.c.participant_id)
    return dict(tuple(row) for row in connection.execute(query))
