"""A consent: the participant, where they come from, and everything that is drawn for them, in one transaction."""

import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, Table, insert, select

from webapp.storage.contents import Stored, as_stored, consent_rows
from webapp.storage.database import Database
from webapp.storage.ledger import allocate, release_abandoned, taken_places
from webapp.storage.participants import Participant, read_participant
from webapp.storage.records import PARTICIPANT, SYSTEM, Entry, append
from webapp.storage.scope import Mode, Scope
from webapp.storage.tables import arrangements, participants, recruits, trials
from webapp.study.draws import Draws
from webapp.study.protocol import Study
from webapp.study.recruitment import Recruit
from webapp.study.session import Assignment, Trial
from webapp.study.session import pages as all_pages

_CODE_ALPHABET = "23456789abcdefghjkmnpqrstvwxyz"
_CODE_LENGTH = 10

# Every consent needs these; putting them together takes longer than asking.
_INSERTS = {table: insert(table) for table in (participants, recruits, arrangements, trials)}
_STORED = [name for name in Participant.__slots__ if name not in {"id", "num_stored", "has_restarts"}]


class AlreadyTookPartError(RuntimeError):
    """Somebody whom the recruiter sent takes part already, or has taken part."""


class StudyFullError(RuntimeError):
    """As many take part as the study file's quota allows."""


@dataclass(frozen=True, slots=True)
class Enrolment:
    """What a consent needs.

    Attributes:
        study: The study agreed to.
        study_version: The hash of its bundle.
        mode: Who takes part.
        token_hash: SHA-256 of the cookie's token, in hexadecimal.
        language: The code of the language in which the consent was read.
        guardian_agreed: Whether a guardian's consent was declared; None where the study asks nobody for one.
        recruit: Whom a recruiter sent; None for everybody else.
    """

    study: Study
    study_version: str
    mode: Mode
    token_hash: str
    language: str
    guardian_agreed: bool | None = None
    recruit: Recruit | None = None

    @property
    def scope(self) -> Scope:
        """To which data the participant will belong."""
        return Scope(self.study.name, self.study_version, self.mode)


def enrol(database: Database, enrolment: Enrolment, now: datetime) -> Participant:
    """Store a consent together with the participant's arrangements and trials.

    The arrangements are chosen among the least used of the same study version and mode, in the transaction that
    stores them, so that no number of simultaneous arrivals can unbalance them. Places of those who left, were screened
    out or gave no sign of life for longer than the study's lease count no more. The same token enrols once.

    Args:
        database: Where to store.
        enrolment: What was agreed to.
        now: The time of the consent.

    Raises:
        AlreadyTookPartError: Whom the recruiter sent is enrolled already, under another token.
        StudyFullError: No place is left.
    """
    with database.write() as connection:
        known = read_participant(connection, enrolment.token_hash)
        if known is not None:
            return known
        _refuse_a_second_time(connection, enrolment)
        release_abandoned(connection, enrolment.scope, enrolment.study.lease_minutes, now)
        _refuse_beyond_quota(connection, enrolment, now)
        allocation = allocate(connection, enrolment.study, enrolment.scope, Draws(secrets.token_hex(32)))
        stored, person = _insert_participant(
            connection, enrolment, len(all_pages(enrolment.study, allocation.trials)), now
        )
        written: dict[Table, Sequence[Mapping[str, object]]] = {participants: [person]}
        for table, rows in (
            (recruits, _recruit_rows(enrolment)),
            (arrangements, _arrangement_rows(allocation.chosen)),
            (trials, _trial_rows(allocation.trials)),
        ):
            if rows:
                connection.execute(_INSERTS[table], [{**row, "participant_id": stored.id} for row in rows])
            written[table] = as_stored(table, rows)
        drawn = Entry(now, SYSTEM, "allocated", enrolment.scope, stored.subject, content=allocation.content)
        told = consent_rows(Stored(connection, written), stored.id)
        agreed = Entry(now, PARTICIPANT, "consented", enrolment.scope, stored.subject, rows=told)
        append(connection, drawn)
        append(connection, agreed)
    return stored


def find_recruit(database: Database, participant: Participant) -> Recruit | None:
    """Return what a recruiter said of a participant, or None for those who came by themselves."""
    query = select(
        recruits.c.service, recruits.c.external_id, recruits.c.external_study, recruits.c.external_session
    ).where(recruits.c.participant_id == participant.id)
    with database.look() as connection:
        row = connection.execute(query).one_or_none()
    return None if row is None else Recruit(*row)


def _refuse_a_second_time(connection: Connection, enrolment: Enrolment) -> None:
    if enrolment.recruit is None:
        return
    query = select(recruits.c.participant_id).where(
        recruits.c.study == enrolment.study.name,
        recruits.c.mode == enrolment.mode,
        recruits.c.service == enrolment.recruit.service,
        recruits.c.external_id == enrolment.recruit.external_id,
    )
    if connection.execute(query).one_or_none() is not None:
        raise AlreadyTookPartError("whom the recruiter sent takes part already")


def _refuse_beyond_quota(connection: Connection, enrolment: Enrolment, now: datetime) -> None:
    quota = enrolment.study.quota
    if enrolment.mode == "live" and quota is not None and taken_places(connection, enrolment.study, now) >= quota:
        raise StudyFullError(f"{quota} places are taken, as many as there are")


def _insert_participant(
    connection: Connection, enrolment: Enrolment, num_pages: int, now: datetime
) -> tuple[Participant, Mapping[str, Any]]:
    """Return the participant, and the row but for its number."""
    row: dict[str, Any] = {
        "code": "".join(secrets.choice(_CODE_ALPHABET) for _ in range(_CODE_LENGTH)),
        "token_hash": enrolment.token_hash,
        "mode": enrolment.mode,
        "study": enrolment.study.name,
        "study_version": enrolment.study_version,
        "consent_version": enrolment.study.consent_version,
        "language": enrolment.language,
        "translation": enrolment.study.validation(enrolment.language),
        "guardian_agreed": enrolment.guardian_agreed,
        "num_pages": num_pages,
        "consented_at": now,
        "last_seen_at": now,
        "salt": secrets.token_hex(16),
    }
    result = connection.execute(_INSERTS[participants], row)
    assert result.inserted_primary_key is not None  # noqa: S101 - for the type checker: an insert of one row
    known: dict[str, Any] = {name: row.get(name) for name in _STORED}
    return Participant(id=result.inserted_primary_key[0], num_stored=0, **known), row


def _recruit_rows(enrolment: Enrolment) -> Sequence[Mapping[str, object]]:
    if enrolment.recruit is None:
        return ()
    row = {name: getattr(enrolment.recruit, name) for name in Recruit.__slots__}
    return [row | {"study": enrolment.study.name, "mode": enrolment.mode}]


def _arrangement_rows(chosen: Mapping[str, Assignment]) -> Sequence[Mapping[str, object]]:
    return [
        {"experiment": experiment, "arrangement": assignment.arrangement, "layout_order": assignment.layout_order}
        for experiment, assignment in chosen.items()
    ]


def _trial_rows(planned: Sequence[Trial]) -> Sequence[Mapping[str, object]]:
    return [
        {"number": number} | {name: getattr(trial, name) for name in Trial.__slots__}
        for number, trial in enumerate(planned, start=1)
    ]
