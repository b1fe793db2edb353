"""A consent: the participant, where they come from, and everything that is drawn for them, in one transaction."""

import random
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import cast

from sqlalchemy import Connection, func, insert, select

from webapp.storage.database import Database
from webapp.storage.participants import Mode, Participant, read_participant
from webapp.storage.tables import arrangements, participants, recruits, trials
from webapp.study.counterbalancing import arrangements as all_arrangements
from webapp.study.counterbalancing import choose_cell, layout_orders
from webapp.study.protocol import Experiment, Study
from webapp.study.recruitment import Recruit
from webapp.study.session import Assignment, Trial, plan_trials
from webapp.study.session import pages as all_pages

_CODE_ALPHABET = "23456789abcdefghjkmnpqrstvwxyz"
_CODE_LENGTH = 10


class AlreadyTookPartError(RuntimeError):
    """Somebody whom the recruiter sent takes part already, or has taken part."""


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


def enrol(database: Database, enrolment: Enrolment, now: datetime) -> Participant:
    """Store a consent together with the participant's arrangements and trials.

    The arrangements are chosen among the least used of the same study version and mode, in the transaction that
    stores them, so that no number of simultaneous arrivals can unbalance them. The same token enrols once.

    Args:
        database: Where to store.
        enrolment: What was agreed to.
        now: The time of the consent.

    Raises:
        AlreadyTookPartError: Whom the recruiter sent is enrolled already, under another token.
    """
    chooser = secrets.SystemRandom()
    with database.write() as connection:
        known = read_participant(connection, enrolment.token_hash)
        if known is not None:
            return known
        _refuse_a_second_time(connection, enrolment)
        chosen = {
            experiment.id: _choose(connection, enrolment, experiment, chooser)
            for experiment in enrolment.study.experiments
        }
        planned = _plan(enrolment.study, chosen, chooser)
        num_pages = len(all_pages(enrolment.study, planned))
        participant_id = _insert_participant(connection, enrolment, num_pages, now)
        _insert_recruit(connection, enrolment, participant_id)
        connection.execute(insert(arrangements), _arrangement_rows(participant_id, chosen))
        connection.execute(insert(trials), _trial_rows(participant_id, planned))
        stored = read_participant(connection, enrolment.token_hash)
    assert stored is not None  # noqa: S101 - for the type checker: it was inserted just now
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


def _choose(connection: Connection, enrolment: Enrolment, experiment: Experiment, chooser: random.Random) -> Assignment:
    """Choose among the least used; how often each was given out is counted within the transaction."""
    query = (
        select(arrangements.c.arrangement, arrangements.c.layout_order, func.count())
        .join(participants)
        .where(
            participants.c.study == enrolment.study.name,
            participants.c.study_version == enrolment.study_version,
            participants.c.mode == enrolment.mode,
            arrangements.c.experiment == experiment.id,
        )
        .group_by(arrangements.c.arrangement, arrangements.c.layout_order)
    )
    uses = {(arrangement, order): count for arrangement, order, count in connection.execute(query)}
    sizes = len(all_arrangements(experiment)), len(layout_orders(experiment))
    return Assignment(*choose_cell(uses, *sizes, chooser))


def _plan(study: Study, chosen: Mapping[str, Assignment], chooser: random.Random) -> tuple[Trial, ...]:
    return plan_trials(study, chosen, draw=lambda: chooser.randrange(study.explanation.num_draws))


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
