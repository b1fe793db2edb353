"""The rows of each exported file."""

from collections.abc import Iterator, Mapping
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Executable,
    FromClause,
    String,
    and_,
    case,
    cast,
    func,
    literal,
    select,
    union_all,
)

from webapp.storage.export_columns import DRIVES_COLUMNS, PARTICIPANTS_COLUMNS, PROBES_COLUMNS, WHAT, WHO
from webapp.storage.tables import (
    answers,
    drive_steps,
    drives,
    events,
    pages,
    participants,
    predictions,
    ratings,
    recruits,
    trials,
)

Row = tuple[object, ...]


def ratings_rows(connection: Connection) -> Iterator[Row]:
    """Yield a row for each rating."""
    yield from _rows_of_pages(connection, ratings, ("item", "rating", "response_time_ms"), order="item")


def probes_rows(connection: Connection) -> Iterator[Row]:
    """Yield a row for each prediction."""
    columns = PROBES_COLUMNS[len(WHO) + len(WHAT) : -1]
    yield from _rows_of_pages(connection, predictions, columns, order="question")


def drives_rows(connection: Connection) -> Iterator[Row]:
    """Yield a row for each finished drive, the practice included."""
    actions = _actions(connection)
    result = ("phase", "end", "num_steps", "optimum", "step_limit", "subgoals_passed", "key_points")
    columns = (*result, "layout", "participant_id", "page_number")
    place = DRIVES_COLUMNS.index("layout")
    for *row, layout, participant_id, page, submitted_at in _rows_of_pages(connection, drives, columns, None):
        taken, started_at = actions.get((participant_id, page), ("", None))
        yield (*row[:place], layout, *row[place + 1 :], taken, started_at, submitted_at)


def events_rows(connection: Connection) -> Iterator[Row]:
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
    ).join(pages, _on_page(events))
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
        select(*_who(), *_trial_columns(), *(happened.c[name] for name in what))
        .select_from(happened)
        .join(participants, participants.c.id == happened.c.participant_id)
        .outerjoin(trials, _on_trial(happened))
        .order_by(happened.c.participant_id, happened.c.page_number, happened.c.source, happened.c.number)
    )
    yield from _stream(connection, query)


def answers_rows(connection: Connection) -> Iterator[Row]:
    """Yield a row for each answer to a background question, a quiz or an attention check."""
    query = (
        select(
            *_who(),
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
        .outerjoin(pages, _on_page(answers))
        .outerjoin(trials, _on_trial(pages))
        .order_by(answers.c.participant_id, answers.c.page_number, answers.c.attempt, answers.c.question)
    )
    yield from _stream(connection, query)


def participants_rows(connection: Connection) -> Iterator[Row]:
    """Yield a row for each participant."""
    num_sent = (
        select(func.count()).select_from(pages).where(pages.c.participant_id == participants.c.id).scalar_subquery()
    )
    query = select(
        *_who(),
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
        participants.c.id,
    ).order_by(participants.c.id)
    assignments = _assignments(connection)
    place = PARTICIPANTS_COLUMNS.index("assignment")
    for *values, participant_id in connection.execute(query):
        yield (*values[:place], " ".join(assignments.get(participant_id, [])), *values[place:])


def recruits_rows(connection: Connection) -> Iterator[Row]:
    """Yield a row for each participant whom a recruiter sent."""
    state = case(
        (participants.c.withdrawn_at.is_not(None), "withdrawn"),
        (participants.c.screened_out_at.is_not(None), "screened_out"),
        (participants.c.completed_at.is_not(None), "completed"),
        else_="in_progress",
    )
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
        .order_by(participants.c.id)
    )
    yield from _stream(connection, query)


def _rows_of_pages(
    connection: Connection, table: FromClause, columns: tuple[str, ...], order: str | None
) -> Iterator[tuple[Any, ...]]:
    """Yield rows of a table that belongs to pages: who, what, the table's columns, when the page was sent."""
    query = (
        select(*_who(), *_trial_columns(), *(table.c[name] for name in columns), pages.c.submitted_at)
        .select_from(table)
        .join(pages, _on_page(table))
        .join(participants, participants.c.id == table.c.participant_id)
        .outerjoin(trials, _on_trial(pages))
        .order_by(table.c.participant_id, table.c.page_number, *([] if order is None else [table.c[order]]))
    )
    yield from _stream(connection, query)


def _stream(connection: Connection, query: Executable) -> Iterator[tuple[Any, ...]]:
    for row in connection.execution_options(yield_per=1000).execute(query):
        yield tuple(row)


def _who() -> tuple[ColumnElement[Any], ...]:
    return participants.c.study, participants.c.study_version, participants.c.mode, participants.c.code


def _trial_columns() -> tuple[ColumnElement[Any], ...]:
    return trials.c.experiment, trials.c.position, trials.c.layout, trials.c.kind, trials.c.draw


def _on_page(table: FromClause) -> ColumnElement[bool]:
    return and_(pages.c.participant_id == table.c.participant_id, pages.c.number == table.c.page_number)


def _on_trial(table: FromClause) -> ColumnElement[bool]:
    return and_(trials.c.participant_id == table.c.participant_id, trials.c.number == table.c.trial_number)


def _actions(connection: Connection) -> Mapping[tuple[int, int], tuple[str, object]]:
    """Return by participant and page a drive's actions, separated by blanks, and when the first one came."""
    found: dict[tuple[int, int], tuple[str, object]] = {}
    order = (drive_steps.c.participant_id, drive_steps.c.page_number, drive_steps.c.number)
    for step in connection.execute(select(drive_steps).order_by(*order)):
        key = (step.participant_id, step.page_number)
        known = found.get(key)
        found[key] = (step.action, step.received_at) if known is None else (f"{known[0]} {step.action}", known[1])
    return found


def _assignments(connection: Connection) -> dict[int, list[str]]:
    """Return each participant's trials, by the row's number, such as `1/experiment1-a/random/7`."""
    found: dict[int, list[str]] = {}
    for trial in connection.execute(select(trials).order_by(trials.c.participant_id, trials.c.number)):
        parts = [trial.experiment, trial.layout, trial.kind, *([] if trial.draw is None else [str(trial.draw)])]
        found.setdefault(trial.participant_id, []).append("/".join(parts))
    return found
