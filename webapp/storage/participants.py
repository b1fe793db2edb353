"""Who takes part, how far everybody is, and who left."""

import hashlib
from dataclasses import dataclass
from datetime import datetime
from typing import Any, cast

from sqlalchemy import (
    BindParameter,
    ColumnElement,
    Connection,
    RowMapping,
    Select,
    bindparam,
    case,
    exists,
    func,
    or_,
    select,
    update,
)

from webapp.storage.database import Database
from webapp.storage.records import PARTICIPANT, Entry, Subject, append
from webapp.storage.scope import Mode, Scope
from webapp.storage.tables import page_restarts, pages, participant_tokens, participants, trials
from webapp.study.experiments import Kind
from webapp.study.session import Trial

_NOW: BindParameter[datetime] = bindparam("now", type_=participants.c.last_seen_at.type)
LATEST_SIGN = case((participants.c.last_seen_at > _NOW, participants.c.last_seen_at), else_=_NOW)
"""The last sign of life where there is one `now`: a clock that was set back makes nobody silent for longer."""


@dataclass(frozen=True, slots=True)
class Participant:
    """A participant as stored.

    Attributes:
        id: The row's number; it never leaves the server.
        code: The random public code, the column `participant` of the data.
        token_hash: SHA-256 of the cookie's token, in hexadecimal.
        mode: Who takes part.
        study: The study's name.
        study_version: The hash of the bundle that the participant sees.
        language: The code of the language that the participant reads.
        num_pages: How many pages there are to send.
        num_stored: How many of them are stored; always the first ones.
        completed_at: When the last page was stored; None before.
        withdrawn_at: When the participant left for good; None for everyone else.
        screened_out_at: When the quiz ended the study; None for everyone else.
        salt: A random number of this participant's own, for what the log holds of them.
        slot_released_at: When the place in the study was given back; None while it counts.
        has_restarts: Whether a researcher let the participant begin a page anew.
    """

    id: int
    code: str
    token_hash: str
    mode: Mode
    study: str
    study_version: str
    language: str
    num_pages: int
    num_stored: int
    completed_at: datetime | None
    withdrawn_at: datetime | None
    screened_out_at: datetime | None
    salt: str
    slot_released_at: datetime | None
    has_restarts: bool = False

    @property
    def scope(self) -> Scope:
        """To which data the participant belongs."""
        return Scope(self.study, self.study_version, self.mode)

    @property
    def subject(self) -> Subject:
        """What records need to know."""
        return Subject(self.id, self.code, self.salt)

    @property
    def was_ended_early(self) -> bool:
        """Whether the participant left or was screened out."""
        return self.withdrawn_at is not None or self.screened_out_at is not None

    @property
    def is_in_progress(self) -> bool:
        """Whether the participant has neither finished nor left nor been screened out."""
        return self.completed_at is None and not self.was_ended_early


def hash_token(token: str) -> str:
    """Return what is stored of a secret token: its SHA-256 in hexadecimal."""
    return hashlib.sha256(token.encode()).hexdigest()


def find_participant(database: Database, token_hash: str) -> Participant | None:
    """Return the participant whose cookie, or link made by a researcher, holds the token of this hash, or None."""
    with database.look() as connection:
        return read_participant(connection, token_hash)


def read_participant(connection: Connection, token_hash: str) -> Participant | None:
    """Return the same within a transaction."""
    return _read(connection, _BY_TOKEN, token_hash)


def read_by_code(connection: Connection, code: str) -> Participant | None:
    """Return the participant of a public code, or None."""
    return _read(connection, _BY_CODE, code)


def has_participants(database: Database) -> bool:
    """Tell whether anybody has taken part, in whatever study and mode."""
    with database.read() as connection:
        return connection.execute(select(participants.c.id).limit(1)).one_or_none() is not None


def find_trials(database: Database, participant: Participant) -> tuple[Trial, ...]:
    """Return a participant's trials in order."""
    with database.read() as connection:
        return read_trials(connection, participant)


def read_trials(connection: Connection, participant: Participant) -> tuple[Trial, ...]:
    """Return the same within a transaction."""
    return tuple(_trial(row) for row in connection.execute(_TRIALS, {"wanted": participant.id}).mappings())


def withdraw(database: Database, participant: Participant, now: datetime) -> None:
    """Note that a participant left for good; for whom the study is over already, nothing changes."""
    changes = {"withdrawn_at": now, "last_seen_at": LATEST_SIGN}
    with database.write() as connection:
        result = connection.execute(
            update(participants)
            .where(
                participants.c.id == participant.id,
                participants.c.completed_at.is_(None),
                participants.c.withdrawn_at.is_(None),
                participants.c.screened_out_at.is_(None),
            )
            .values(changes),
            {"now": now},
        )
        if result.rowcount:
            append(connection, Entry(now, PARTICIPANT, "withdrew", participant.scope, participant.subject))


def _people(condition: ColumnElement[bool]) -> Select[Any]:
    num_stored = (
        select(func.count()).select_from(pages).where(pages.c.participant_id == participants.c.id).scalar_subquery()
    )
    has_restarts = exists().where(page_restarts.c.participant_id == participants.c.id)
    known = {**participants.c, "num_stored": num_stored, "has_restarts": has_restarts}
    # As the attributes follow one another.
    return select(*(known[name] for name in Participant.__slots__)).where(condition)


def _of_token(token_hash: ColumnElement[str]) -> ColumnElement[bool]:
    linked = select(participant_tokens.c.participant_id).where(participant_tokens.c.token_hash == token_hash)
    return or_(participants.c.token_hash == token_hash, participants.c.id == linked.scalar_subquery())


# Every request asks these; putting them together takes longer than asking.
_BY_TOKEN = _people(_of_token(bindparam("wanted")))
_BY_CODE = _people(participants.c.code == bindparam("wanted"))
_TRIALS = select(trials).where(trials.c.participant_id == bindparam("wanted")).order_by(trials.c.number)


def _read(connection: Connection, query: Select[Any], wanted: str) -> Participant | None:
    if "\0" in wanted:  # Nobody's code has a NUL, and PostgreSQL refuses to look for one.
        return None
    row = connection.execute(query, {"wanted": wanted}).one_or_none()
    return None if row is None else Participant(*row)


def _trial(row: RowMapping) -> Trial:
    return Trial(
        experiment=row["experiment"],
        position=row["position"],
        num_trials=row["num_trials"],
        layout=row["layout"],
        kind=cast("Kind", row["kind"]),
        draw=row["draw"],
    )
