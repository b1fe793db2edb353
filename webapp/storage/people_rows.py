"""The rows of the files that tell of whole participants, and of what was decided about them."""

import json
from collections.abc import Iterator
from typing import Any

from sqlalchemy import Connection, case, func, select

from webapp.storage.export_columns import ALLOCATION_COLUMNS, PARTICIPANTS_COLUMNS
from webapp.storage.export_rows import who
from webapp.storage.people import exclusion_states
from webapp.storage.records import Action
from webapp.storage.replay import allocation_rows as ledger_rows
from webapp.storage.streams import Alongside, Row, stream
from webapp.storage.tables import pages, participants, record_contents, records, recruits, trials
from webapp.storage.wanted import Wanted

_DECISIONS: tuple[Action, ...] = ("excluded", "included", "corrected", "page_released", "page_restarted")

state = case(
    (participants.c.withdrawn_at.is_not(None), "withdrawn"),
    (participants.c.screened_out_at.is_not(None), "screened_out"),
    (participants.c.completed_at.is_not(None), "completed"),
    else_="in_progress",
)
"""Where a participant is."""


def participants_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each participant."""
    num_sent = (
        select(func.count()).select_from(pages).where(pages.c.participant_id == participants.c.id).scalar_subquery()
    )
    query = (
        select(
            *who(),
            participants.c.consent_version,
            participants.c.consented_at,
            participants.c.last_seen_at,
            participants.c.completed_at,
            participants.c.withdrawn_at,
            num_sent,
            participants.c.num_pages,
            participants.c.language,
            participants.c.translation,
            participants.c.guardian_agreed,
            participants.c.screened_out_at,
            participants.c.slot_released_at,
            participants.c.returned_late_at,
            participants.c.id,
        )
        .where(wanted.of(participants))
        .order_by(participants.c.id)
    )
    drawn = Alongside(trials_in_order(connection, wanted), key=lambda trial: trial[0])
    excluded = exclusion_states(connection)
    place = PARTICIPANTS_COLUMNS.index("assignment")
    for *values, released_at, returned_at, participant_id in stream(connection, query):
        assignment = " ".join(_trial(*trial[3:]) for trial in drawn.of(participant_id))
        exclusion = excluded.get(participant_id)
        since, reason = (None, None) if exclusion is None else (exclusion.at, exclusion.reason)
        yield (*values[:place], assignment, *values[place:], since, reason, released_at, returned_at)


def recruits_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each participant whom a recruiter sent."""
    query = (
        select(
            participants.c.study,
            participants.c.mode,
            participants.c.code,
            recruits.c.service,
            recruits.c.external_id,
            recruits.c.external_study,
            recruits.c.external_session,
            state,
        )
        .join(participants, participants.c.id == recruits.c.participant_id)
        .where(wanted.of(participants))
        .order_by(participants.c.id)
    )
    return stream(connection, query)


def allocation_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each experiment of each draw."""
    uses, draws = ALLOCATION_COLUMNS.index("uses"), ALLOCATION_COLUMNS.index("draws")
    for row in ledger_rows(connection):
        if wanted.has(*row[:3]):
            told: list[Any] = list(row)
            told[uses] = json.dumps(told[uses], sort_keys=True)
            told[draws] = " ".join(map(str, told[draws]))
            yield tuple(told)


def decisions_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each exclusion, correction and help that researchers decided on, oldest first."""
    log = records.c
    query = (
        select(
            *who(), log.number, log.at, log.actor, log.action, record_contents.c.page_number, record_contents.c.content
        )
        .select_from(records)
        .join(record_contents, record_contents.c.number == log.number)
        .join(participants, participants.c.id == record_contents.c.participant_id)
        .where(log.action.in_(_DECISIONS), wanted.of(participants))
        .order_by(log.number)
    )
    for *decided, page, content in stream(connection, query):
        told = json.loads(content or "{}")
        values = [told.get("from"), told.get("to")]
        if told.get("file") == "answers":
            hides = [wanted.withholds(decided[1], str(told.get("question")), str(value)) for value in values]
            values = [None if hidden else value for value, hidden in zip(values, hides, strict=True)]
        yield (*decided, told.get("reason"), told.get("page", page), told.get("file"), told.get("question"), *values)


def trials_in_order(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield all trials: participant, number, position, experiment, layout, kind, draw; by participant and number."""
    columns = ("participant_id", "number", "position", "experiment", "layout", "kind", "draw")
    query = (
        select(*(trials.c[name] for name in columns))
        .join(participants, participants.c.id == trials.c.participant_id)
        .where(wanted.of(participants))
        .order_by(trials.c.participant_id, trials.c.number)
    )
    return stream(connection, query)


def _trial(experiment: str, layout: str, kind: str, draw: int | None) -> str:
    return "/".join([experiment, layout, kind, *([] if draw is None else [str(draw)])])
