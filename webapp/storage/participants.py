"""What participants do: agree, send pages, withdraw. Each is one transaction."""

import hashlib
import random
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Literal, cast

from sqlalchemy import Connection, RowMapping, func, insert, select, update

from webapp.storage.database import Database
from webapp.storage.tables import arrangements, pages, participants, ratings, trials
from webapp.study.counterbalancing import arrangements as all_arrangements
from webapp.study.counterbalancing import choose_least_used
from webapp.study.protocol import Experiment, Kind, Study
from webapp.study.questionnaire import Ratings
from webapp.study.session import Decision, Page, Trial, decide, plan_trials
from webapp.study.session import pages as all_pages

Mode = Literal["live", "test", "bot"]
"""Who takes part: people whose answers are data, somebody trying the study out, or a program."""

Outcome = Decision | Literal["withdrawn"]
"""What became of a page that was sent."""

_CODE_ALPHABET = "23456789abcdefghjkmnpqrstvwxyz"
_CODE_LENGTH = 10


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
        num_pages: How many pages there are to send.
        num_stored: How many of them are stored; always the first ones.
        completed_at: When the last page was stored; None before.
        withdrawn_at: When the participant left for good; None for everyone else.
    """

    id: int
    code: str
    token_hash: str
    mode: Mode
    study: str
    study_version: str
    num_pages: int
    num_stored: int
    completed_at: datetime | None
    withdrawn_at: datetime | None


@dataclass(frozen=True, slots=True)
class Enrolment:
    """What a consent needs.

    Attributes:
        study: The study agreed to.
        study_version: The hash of its bundle.
        mode: Who takes part.
        token_hash: SHA-256 of the cookie's token, in hexadecimal.
    """

    study: Study
    study_version: str
    mode: Mode
    token_hash: str


def hash_token(token: str) -> str:
    """Return what is stored of a secret token: its SHA-256 in hexadecimal."""
    return hashlib.sha256(token.encode()).hexdigest()


def enrol(database: Database, enrolment: Enrolment, now: datetime) -> Participant:
    """Store a consent together with the participant's arrangements and trials.

    The arrangements are chosen among the least used of the same study version and mode, in the transaction that
    stores them, so that no number of simultaneous arrivals can unbalance them. The same token enrols once.

    Args:
        database: Where to store.
        enrolment: What was agreed to.
        now: The time of the consent.
    """
    chooser = secrets.SystemRandom()
    with database.write() as connection:
        known = _find(connection, enrolment.token_hash)
        if known is not None:
            return known
        chosen = {
            experiment.id: choose_least_used(_uses(connection, enrolment, experiment), chooser)
            for experiment in enrolment.study.experiments
        }
        planned = _plan(enrolment.study, chosen, chooser)
        participant_id = _insert_participant(connection, enrolment, len(all_pages(planned)), now)
        connection.execute(
            insert(arrangements),
            [
                {"participant_id": participant_id, "experiment": experiment, "arrangement": arrangement}
                for experiment, arrangement in chosen.items()
            ],
        )
        connection.execute(insert(trials), _trial_rows(participant_id, planned))
        stored = _find(connection, enrolment.token_hash)
    assert stored is not None  # noqa: S101 - for the type checker: it was inserted just now
    return stored


def find_participant(database: Database, token_hash: str) -> Participant | None:
    """Return the participant whose cookie holds the token of this hash, or None."""
    with database.read() as connection:
        return _find(connection, token_hash)


def find_trials(database: Database, participant: Participant) -> tuple[Trial, ...]:
    """Return a participant's trials in order."""
    query = select(trials).where(trials.c.participant_id == participant.id).order_by(trials.c.number)
    with database.read() as connection:
        return tuple(_trial(row) for row in connection.execute(query).mappings())


def store_page(
    database: Database,
    participant: Participant,
    page: Page,
    nonce: str,
    answers: Ratings | None,
    now: datetime,
) -> Outcome:
    """Store a page with all its ratings, if it is this page's turn. What was stored first stands.

    Args:
        database: Where to store.
        participant: Whose page it is; how far the participant is, is read anew.
        page: The page.
        nonce: The nonce that came with it.
        answers: The ratings of a rating page, None on other pages.
        now: The time of the answer.

    Returns:
        `accept` if the page was stored; else why nothing was.

    Raises:
        ValueError: A rating page came without ratings, or another page with some.
        webapp.study.session.NoSuchPageError: There is no page of this number.
    """
    if (answers is not None) != (page.kind == "rating"):
        raise ValueError(f"ratings belong to rating pages and to no others, and this is {page.kind!r}")
    with database.write() as connection:
        fresh = _find(connection, participant.token_hash)
        if fresh is None or fresh.withdrawn_at is not None:
            return "withdrawn"
        decision = decide(page.number, fresh.num_stored, fresh.num_pages)
        if decision == "accept":
            _insert_page(connection, fresh, page, nonce, now)
            if answers is not None:
                connection.execute(insert(ratings), _rating_rows(fresh.id, page.number, answers))
            completed = now if page.number == fresh.num_pages else None
            seen = {"last_seen_at": now, "completed_at": completed}
            connection.execute(update(participants).where(participants.c.id == fresh.id).values(seen))
    return decision


def withdraw(database: Database, participant: Participant, now: datetime) -> None:
    """Note that a participant left for good; whoever has finished or left already stays as they are."""
    changes = {"withdrawn_at": now, "last_seen_at": now}
    with database.write() as connection:
        connection.execute(
            update(participants)
            .where(
                participants.c.id == participant.id,
                participants.c.completed_at.is_(None),
                participants.c.withdrawn_at.is_(None),
            )
            .values(changes)
        )


def _find(connection: Connection, token_hash: str) -> Participant | None:
    num_stored = (
        select(func.count()).select_from(pages).where(pages.c.participant_id == participants.c.id).scalar_subquery()
    )
    query = select(participants, num_stored.label("num_stored")).where(participants.c.token_hash == token_hash)
    row = connection.execute(query).mappings().one_or_none()
    return None if row is None else Participant(**{name: row[name] for name in Participant.__slots__})


def _uses(connection: Connection, enrolment: Enrolment, experiment: Experiment) -> list[int]:
    """Count how often each arrangement of an experiment was given out."""
    query = (
        select(arrangements.c.arrangement, func.count().label("num_uses"))
        .join(participants)
        .where(
            participants.c.study == enrolment.study.name,
            participants.c.study_version == enrolment.study_version,
            participants.c.mode == enrolment.mode,
            arrangements.c.experiment == experiment.id,
        )
        .group_by(arrangements.c.arrangement)
    )
    used = {row.arrangement: row.num_uses for row in connection.execute(query)}
    return [used.get(arrangement, 0) for arrangement in range(len(all_arrangements(experiment)))]


def _plan(study: Study, chosen: Mapping[str, int], chooser: random.Random) -> tuple[Trial, ...]:
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
            num_pages=num_pages,
            consented_at=now,
            last_seen_at=now,
        )
    )
    assert result.inserted_primary_key is not None  # noqa: S101 - for the type checker: an insert of one row
    return cast("int", result.inserted_primary_key[0])


def _trial_rows(participant_id: int, planned: Sequence[Trial]) -> list[dict[str, object]]:
    return [
        {"participant_id": participant_id, "number": number} | {name: getattr(trial, name) for name in Trial.__slots__}
        for number, trial in enumerate(planned, start=1)
    ]


def _trial(row: RowMapping) -> Trial:
    return Trial(
        experiment=row["experiment"],
        position=row["position"],
        num_trials=row["num_trials"],
        layout=row["layout"],
        kind=cast("Kind", row["kind"]),
        draw=row["draw"],
    )


def _insert_page(connection: Connection, participant: Participant, page: Page, nonce: str, now: datetime) -> None:
    number = None
    if page.trial is not None:
        number = connection.execute(
            select(trials.c.number).where(
                trials.c.participant_id == participant.id,
                trials.c.experiment == page.trial.experiment,
                trials.c.position == page.trial.position,
            )
        ).scalar_one()
    row = {"participant_id": participant.id, "number": page.number, "kind": page.kind, "trial_number": number}
    connection.execute(insert(pages).values(**row, nonce=nonce, submitted_at=now))


def _rating_rows(participant_id: int, page_number: int, answers: Ratings) -> list[dict[str, object]]:
    return [
        {
            "participant_id": participant_id,
            "page_number": page_number,
            "item": item,
            "rating": rating,
            "response_time_ms": answers.response_times[item],
        }
        for item, rating in answers.values.items()
    ]
