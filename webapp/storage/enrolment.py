"""A consent: the participant, where they come from, and everything that is drawn for them, in one transaction."""

import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import cast

from sqlalchemy import Connection, insert, select

from webapp.storage.contents import Stored, consent_rows
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
        num_pages = len(all_pages(enrolment.study, allocation.trials))
        participant_id = _insert_participant(connection, enrolment, num_pages, now)
        _insert_recruit(connection, enrolment, participant_id)
        connection.execute(insert(arrangements), _arrangement_rows(participant_id, allocation.chosen))
        connection.execute(insert(trials), _trial_rows(participant_id, allocation.trials))
        stored = read_participant(connection, enrolment.token_hash)
        assert stored is not None  # noqa: S101 - for the type checker: it was inserted just now
        drawn = Entry(now, SYSTEM, "allocated", enrolment.scope, stored.subject, content=allocation.content)
        agreed = Entry(
            now,
            PARTICIPANT,
            "consented",
            enrolment.scope,
            stored.subject,
            rows=consent_rows(Stored(connection), stored.id),
        )
        append(connection, drawn)
        append(connection, agreed)
    return stored


def find_recruit(database: Database, participant: Participant) -> Recruit | None:
    """Return what a recruiter said of a participant, or None for those who came by themselves."""
    query = select(
        recruits.c.service, recruits.c.external_id, recruits.c.external_study, recruits.c.external_session
    ).where(recruits.c.participant_id == participant.id)
    with database.read() as connection:
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


def _insert_participant(connection: Connection, enrolment: Enrolment, num_pages: int, now: datetime) -> int:
    result = connection.execute(
        insert(participants).values(
            code="".join(secrets.choice(_CODE_ALPHABET) for _ in range(_CODE_LENGTH)),
            token_hash=enrolment.token_hash,
            mode=enrolment.mode,
            study=enrolment.study.name,
            study_version=enrolment.study_version,
            consent_version=enrolment.study.consent_version,
            language=enrolment.language,
            translation=enrolment.study.validation(enrolment.language),
            guardian_agreed=enrolment.guardian_agreed,
            num_pages=num_pages,
            consented_at=now,
            last_seen_at=now,
            salt=secrets.token_hex(16),
        )
    )
    assert result.inserted_primary_key is not None  # noqa: S101 - for the type checker: an insert of one row
    return cast("int", result.inserted_primary_key[0])


def _insert_recruit(connection: Connection, enrolment: Enrolment, participant_id: int) -> None:
    if enrolment.recruit is not None:
        row = {name: getattr(enrolment.recruit, name) for name in Recruit.__slots__}
        key = {"participant_id": participant_id, "study": enrolment.study.name, "mode": enrolment.mode}
        connection.execute(insert(recruits).values(key | row))


def _arrangement_rows(participant_id: int, chosen: Mapping[str, Assignment]) -> list[dict[str, object]]:
    return [
        {
            "participant_id": participant_id,
            "experiment": experiment,
            "arrangement": assignment.arrangement,
            "layout_order": assignment.layout_order,
        }
        for experiment, assignment in chosen.items()
    ]


def _trial_rows(participant_id: int, planned: Sequence[Trial]) -> list[dict[str, object]]:
    return [
        {"participant_id": participant_id, "number": number} | {name: getattr(trial, name) for name in Trial.__slots__}
        for number, trial in enumerate(planned, start=1)
    ]
