"""The rows of the files that tell of pages: ratings, predictions, drives, events, answers."""

from collections.abc import Iterator

from sqlalchemy import ColumnElement, Connection, FromClause, String, and_, cast, func, literal, select, union_all

from webapp.storage.export_columns import ANSWERS_COLUMNS, DRIVES_COLUMNS, PROBES_COLUMNS
from webapp.storage.streams import Alongside, Row, stream
from webapp.storage.tables import (
    answers,
    drive_steps,
    drives,
    events,
    page_restarts,
    pages,
    participants,
    predictions,
    ratings,
    trials,
)
from webapp.storage.variables import WHAT, WHO
from webapp.storage.wanted import Wanted


def ratings_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each rating."""
    return _rows_of_pages(connection, wanted, ratings, ("item", "rating", "response_time_ms"), order="item")


def probes_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each prediction."""
    columns = PROBES_COLUMNS[len(WHO) + len(WHAT) : -1]
    return _rows_of_pages(connection, wanted, predictions, columns, order="question")


def drives_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each finished drive, the practice included."""
    steps = Alongside(_steps(connection, wanted), key=lambda step: (step[0], step[1]))
    result = ("phase", "end", "num_steps", "optimum", "step_limit", "subgoals_passed", "key_points")
    columns = (*result, "layout", "participant_id", "page_number")
    place = DRIVES_COLUMNS.index("layout")
    for *row, layout, participant_id, page, submitted_at in _rows_of_pages(connection, wanted, drives, columns, None):
        taken = steps.of((participant_id, page))
        started_at = taken[0][3] if taken else None
        actions = " ".join(step[2] for step in taken)
        yield (*row[:place], layout, *row[place + 1 :], actions, started_at, submitted_at)


def events_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each action of a drive and each event of a page's log, page by page, the actions first.

    Actions are there from the moment they came, so also those of a drive that was never finished; a log comes with its
    page.
    """
    logged = select(
        events.c.participant_id,
        events.c.page_number,
        pages.c.kind.label("page_kind"),
        pages.c.trial_number,
        literal(1).label("source"),
        events.c.number,
        events.c.event,
        events.c.target,
        events.c.value,
        events.c.at_ms,
        pages.c.submitted_at.label("received_at"),
    ).join(pages, on_page(events))
    driven = select(
        drive_steps.c.participant_id,
        drive_steps.c.page_number,
        drive_steps.c.page_kind,
        drive_steps.c.trial_number,
        literal(0),
        drive_steps.c.number,
        literal("drive_action"),
        cast(drive_steps.c.number, String),
        drive_steps.c.action,
        drive_steps.c.elapsed_ms,
        drive_steps.c.received_at,
    )
    happened = union_all(logged, driven).subquery()
    what = ("page_number", "page_kind", "event", "target", "value", "at_ms", "received_at")
    query = (
        select(*who(), *_trial_columns(), *(happened.c[name] for name in what))
        .select_from(happened)
        .join(participants, participants.c.id == happened.c.participant_id)
        .outerjoin(trials, on_trial(happened))
        .where(wanted.of(participants))
        .order_by(happened.c.participant_id, happened.c.page_number, happened.c.source, happened.c.number)
    )
    return stream(connection, query)


def answers_rows(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield a row for each answer to a background question, a quiz or an attention check."""
    query = (
        select(
            *who(),
            trials.c.experiment,
            trials.c.position,
            answers.c.purpose,
            answers.c.question,
            answers.c.attempt,
            answers.c.answer,
            answers.c.is_correct,
            answers.c.submitted_at,
        )
        .select_from(answers)
        .join(participants, participants.c.id == answers.c.participant_id)
        .outerjoin(pages, on_page(answers))
        .outerjoin(trials, on_trial(pages))
        .where(wanted.of(participants))
        .order_by(answers.c.participant_id, answers.c.page_number, answers.c.attempt, answers.c.question)
    )
    version, purpose, question, answer = map(ANSWERS_COLUMNS.index, ("study_version", "purpose", "question", "answer"))
    for row in stream(connection, query):
        hides = row[purpose] == "background" and wanted.withholds(row[version], row[question], row[answer])
        yield (*row[:answer], None if hides else row[answer], *row[answer + 1 :], hides)


def who() -> tuple[ColumnElement[str], ...]:
    """Return the columns that say whose row it is."""
    return participants.c.study, participants.c.study_version, participants.c.mode, participants.c.code


def on_page(table: FromClause) -> ColumnElement[bool]:
    """Join a table that belongs to pages to them."""
    return and_(pages.c.participant_id == table.c.participant_id, pages.c.number == table.c.page_number)


def on_trial(table: FromClause) -> ColumnElement[bool]:
    """Join a table whose rows may belong to trials to these."""
    return and_(trials.c.participant_id == table.c.participant_id, trials.c.number == table.c.trial_number)


def _rows_of_pages(
    connection: Connection, wanted: Wanted, table: FromClause, columns: tuple[str, ...], order: str | None
) -> Iterator[Row]:
    """Yield rows of a table that belongs to pages: who, what, the table's columns, when the page was sent."""
    query = (
        select(*who(), *_trial_columns(), *(table.c[name] for name in columns), pages.c.submitted_at)
        .select_from(table)
        .join(pages, on_page(table))
        .join(participants, participants.c.id == table.c.participant_id)
        .outerjoin(trials, on_trial(pages))
        .where(wanted.of(participants))
        .order_by(table.c.participant_id, table.c.page_number, *([] if order is None else [table.c[order]]))
    )
    return stream(connection, query)


def _trial_columns() -> tuple[ColumnElement[object], ...]:
    return trials.c.experiment, trials.c.position, trials.c.layout, trials.c.kind, trials.c.draw


def _steps(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield the actions of all drives since they were last begun anew: participant, page, action, when it came."""
    steps, restarts = drive_steps.c, page_restarts.c
    begun_after = (
        select(func.coalesce(func.max(restarts.after_step), 0))
        .where(restarts.participant_id == steps.participant_id, restarts.page_number == steps.page_number)
        .scalar_subquery()
    )
    query = (
        select(steps.participant_id, steps.page_number, steps.action, steps.received_at)
        .join(participants, participants.c.id == steps.participant_id)
        .where(wanted.of(participants), steps.number > begun_after)
        .order_by(steps.participant_id, steps.page_number, steps.number)
    )
    return stream(connection, query)
