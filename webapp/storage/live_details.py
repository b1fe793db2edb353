"""Everything about one participant, read when somebody opens their page."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from sqlalchemy import Connection, FromClause, Row, and_, select

from webapp.storage.live_person_numbers import (
    GivenAnswer,
    GivenDrive,
    GivenPrediction,
    GivenRating,
    PageVisit,
    PersonLine,
    PersonNumbers,
    PersonTrial,
)
from webapp.storage.live_summaries import PersonSummary
from webapp.storage.tables import answers, drives, events, pages, participants, predictions, ratings, trials
from webapp.study.protocol import Study
from webapp.study.quality import Flag

_LEFT, _CAME_BACK = "focus_lost", "focus_regained"
_Away = tuple[int, float]
"""How often the window was left, and for how many seconds altogether."""


def read_details(
    connection: Connection,
    study: Study,
    known: PersonSummary,
    line: PersonLine,
    flags: Sequence[Flag],
    *,
    blind: bool,
) -> PersonNumbers | None:
    """Read everything about one participant.

    Args:
        connection: A transaction.
        study: The study of their version.
        known: Their summary.
        line: Their line in the list.
        flags: The rules that flag them.
        blind: Whether to leave out the kinds of their trials and what would tell them at once.

    Returns:
        What there is; None if they were erased meanwhile.
    """
    row = connection.execute(select(participants).where(participants.c.id == known.id)).one_or_none()
    if row is None or row.code != known.code:
        return None
    visits = tuple(_visits(connection, study, row))
    return PersonNumbers(
        line=line,
        id=known.id,
        language=row.language,
        withdrawn_at=row.withdrawn_at,
        completed_at=row.completed_at,
        screened_out_at=row.screened_out_at,
        flags=tuple(flags),
        pages=visits,
        trials=tuple(_trials(connection, known, len(visits), blind=blind)),
        ratings=tuple(GivenRating(*given) for given in _given(connection, ratings, known.id, _RATING)),
        predictions=tuple(GivenPrediction(*given) for given in _given(connection, predictions, known.id, _PREDICTION)),
        drives=tuple(_drives(connection, known.id, blind=blind)),
        answers=tuple(_answers(connection, known.id)),
        num_left_window=sum(visit.num_left_window for visit in visits),
        away_s=sum(visit.away_s for visit in visits),
    )


_RATING = ("item", "rating", "response_time_ms")
_PREDICTION = ("question", "predicted", "action", "is_correct", "is_as_good", "confidence", "response_time_ms")
_DRIVE = ("phase", "end", "num_steps", "optimum", "step_limit", "subgoals_passed")


def _visits(connection: Connection, study: Study, person: Row[Any]) -> Iterator[PageVisit]:
    query = select(pages).where(pages.c.participant_id == person.id).order_by(pages.c.number)
    sent = connection.execute(query).all()
    away = _away(connection, person.id)
    moments = [person.consented_at, *(page.submitted_at for page in sent)]
    for page, (before, after) in zip(sent, pairwise(moments), strict=True):
        seconds = (after - before).total_seconds()
        num_left_window, away_s = away.get(page.number, (0, 0.0))
        yield PageVisit(
            number=page.number,
            kind=page.kind,
            trial=page.trial_number,
            submitted_at=page.submitted_at,
            seconds=seconds,
            was_away=seconds > study.lease_minutes * 60,
            num_left_window=num_left_window,
            away_s=away_s,
        )


def _away(connection: Connection, participant_id: int) -> Mapping[int, _Away]:
    """Return by page how often the window was left, and for how long, as far as the log saw it come back."""
    query = (
        select(events.c.page_number, events.c.event, events.c.at_ms)
        .where(events.c.participant_id == participant_id, events.c.event.in_((_LEFT, _CAME_BACK)))
        .order_by(events.c.page_number, events.c.number)
    )
    found: dict[int, _Away] = {}
    left_at: tuple[int, int] | None = None
    for page, event, at_ms in connection.execute(query):
        times, away_s = found.get(page, (0, 0.0))
        if event == _LEFT:
            found[page], left_at = (times + 1, away_s), (page, at_ms)
        elif left_at is not None and left_at[0] == page:
            # A page that is loaded anew begins its clock anew; such a time is unknown.
            found[page], left_at = (times, away_s + max(0, at_ms - left_at[1]) / 1000), None
    return found


def _trials(connection: Connection, known: PersonSummary, num_stored: int, *, blind: bool) -> Iterator[PersonTrial]:
    query = select(trials).where(trials.c.participant_id == known.id).order_by(trials.c.number)
    ends = zip(known.plan.first_pages, known.plan.last_pages, strict=True)
    for trial, (first, last) in zip(connection.execute(query), ends, strict=True):
        yield PersonTrial(
            number=trial.number,
            experiment=trial.experiment,
            position=trial.position,
            layout=trial.layout,
            kind=None if blind else trial.kind,
            draw=None if blind else trial.draw,
            first_page=None if blind else first,
            is_done=num_stored >= last,
        )


def _given(
    connection: Connection, table: FromClause, participant_id: int, columns: Sequence[str]
) -> Iterator[tuple[Any, ...]]:
    """Yield page, trial and some columns of a table that belongs to pages, in the order of its key."""
    on_page = and_(pages.c.participant_id == table.c.participant_id, pages.c.number == table.c.page_number)
    query = (
        select(table.c.page_number, pages.c.trial_number, *(table.c[name] for name in columns))
        .join(pages, on_page)
        .where(table.c.participant_id == participant_id)
        .order_by(*table.primary_key)
    )
    for row in connection.execute(query):
        yield tuple(row)


def _drives(connection: Connection, participant_id: int, *, blind: bool) -> Iterator[GivenDrive]:
    for driven in _given(connection, drives, participant_id, _DRIVE):
        passed = () if blind else tuple(int(step) for step in driven[-1].split())
        told = (*driven[:-1], passed)
        yield GivenDrive(*told)


def _answers(connection: Connection, participant_id: int) -> Iterator[GivenAnswer]:
    query = (
        select(answers)
        .where(answers.c.participant_id == participant_id)
        .order_by(answers.c.page_number, answers.c.attempt, answers.c.question)
    )
    for row in connection.execute(query):
        told = (row.page_number, row.purpose, row.attempt, row.question, row.answer, row.is_correct, row.submitted_at)
        yield GivenAnswer(*told)
