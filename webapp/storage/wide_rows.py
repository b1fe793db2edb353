"""`wide.csv`: one row per participant, with everything about each trial in columns of its own.

A trial's columns begin with its experiment and its place there, such as `1.2.`. Which columns there are follows from
the study's declaration, so that every export of a version has the same ones; where a version's bundle is gone they
follow from what is stored.
"""

from collections.abc import Iterator, Sequence

from sqlalchemy import Connection, case, func, select

from webapp.storage.export_columns import WIDE_WHO
from webapp.storage.export_rows import on_page, on_trial, who
from webapp.storage.people import exclusion_states
from webapp.storage.people_rows import trials_in_order
from webapp.storage.streams import Alongside, Row, stream
from webapp.storage.tables import answers, drives, pages, participants, predictions, ratings, trials
from webapp.storage.variables import KINDS, Variable, response_time, time
from webapp.storage.wanted import Wanted
from webapp.study.experiments import SATISFACTION_ITEMS, TAILORED_KINDS, Experiment
from webapp.study.protocol import Study

_Cells = dict[str, object]


def wide_columns(connection: Connection, wanted: Wanted) -> tuple[Variable, ...]:
    """Return the columns, first those that every study has."""
    found: dict[str, Variable] = {variable.name: variable for variable in WIDE_WHO}
    query = select(participants.c.study_version).where(wanted.of(participants)).group_by(participants.c.study_version)
    for version in connection.execute(query.order_by(func.min(participants.c.id))).scalars().all():
        bundle = wanted.find_bundle(version)
        variables = _stored(connection, version) if bundle is None else _declared(bundle.study, wanted)
        found |= {variable.name: variable for variable in variables}
    return tuple(found.values())


def wide_rows(connection: Connection, wanted: Wanted, columns: Sequence[Variable]) -> Iterator[Row]:
    """Yield a row for each participant, with a value for each of the columns."""
    people = participants.c
    times = (people.consented_at, people.completed_at, people.withdrawn_at, people.language, people.screened_out_at)
    query = select(people.id, *who(), *times).where(wanted.of(participants)).order_by(people.id)
    drawn = Alongside(trials_in_order(connection, wanted), key=lambda row: row[0])
    told = [
        Alongside(rows, key=lambda row: row[0])
        for rows in (
            _ratings(connection, wanted),
            _drives(connection, wanted),
            _predictions(connection, wanted),
            _background(connection, wanted),
        )
    ]
    excluded = {one: exclusion.at for one, exclusion in exclusion_states(connection).items()}
    names = [variable.name for variable in columns]
    first = [variable.name for variable in WIDE_WHO if variable.name != "excluded_at"]
    for participant_id, *values in stream(connection, query):
        cells: _Cells = dict(zip(first, values, strict=True))
        cells["excluded_at"] = excluded.get(participant_id)
        cells |= _trial_cells(drawn.of(participant_id))
        for rows in told:
            cells |= {name: value for _, name, value in rows.of(participant_id)}
        yield tuple(cells.get(name) for name in names)


def trial_columns(trial: str, items: Sequence[str]) -> Iterator[Variable]:
    """Yield every column that a trial may have.

    Args:
        trial: Its experiment and place, such as `1.2`.
        items: The items that are rated.
    """
    yield from _trial(trial, items)
    yield from (*_predicted(trial), *_driven(f"{trial}.before"), *_driven(f"{trial}.after"))


def _trial_cells(rows: Sequence[Row]) -> _Cells:
    return {
        f"{experiment}.{position}.{name}": value
        for _, _, position, experiment, layout, kind, draw in rows
        for name, value in (("layout", layout), ("kind", kind), ("draw", draw))
    }


def _ratings(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield cells of ratings: participant, column, value."""
    of_page = (pages.c.submitted_at, trials.c.experiment, trials.c.position)
    query = (
        select(ratings.c.participant_id, *of_page, ratings.c.item, ratings.c.rating, ratings.c.response_time_ms)
        .join(pages, on_page(ratings))
        .join(participants, participants.c.id == ratings.c.participant_id)
        .join(trials, on_trial(pages))
        .where(wanted.of(participants))
        .order_by(ratings.c.participant_id, ratings.c.page_number)
    )
    for participant_id, at, experiment, position, item, rating, response_time_ms in stream(connection, query):
        trial = f"{experiment}.{position}"
        yield participant_id, f"{trial}.rating.{item}", rating
        yield participant_id, f"{trial}.response_time_ms.{item}", response_time_ms
        if item not in SATISFACTION_ITEMS:
            yield participant_id, f"{trial}.submitted_at", at


def _drives(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield cells of drives that belong to trials: participant, column, value."""
    of_drive = (drives.c.phase, drives.c.end, drives.c.num_steps, drives.c.optimum)
    query = (
        select(drives.c.participant_id, trials.c.experiment, trials.c.position, *of_drive)
        .join(pages, on_page(drives))
        .join(participants, participants.c.id == drives.c.participant_id)
        .join(trials, on_trial(pages))
        .where(wanted.of(participants))
        .order_by(drives.c.participant_id, drives.c.page_number)
    )
    for participant_id, experiment, position, phase, end, num_steps, optimum in stream(connection, query):
        for name, value in (("end", end), ("num_steps", num_steps), ("optimum", optimum)):
            yield participant_id, f"{experiment}.{position}.{phase}.{name}", value


def _predictions(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield cells of predictions, counted by trial: participant, column, value."""
    num_right = func.sum(case((predictions.c.is_correct, 1), else_=0))
    key = (predictions.c.participant_id, predictions.c.page_number)
    query = (
        select(predictions.c.participant_id, trials.c.experiment, trials.c.position, func.count(), num_right)
        .join(pages, on_page(predictions))
        .join(participants, participants.c.id == predictions.c.participant_id)
        .join(trials, on_trial(pages))
        .where(wanted.of(participants))
        .group_by(*key, trials.c.experiment, trials.c.position)
        .order_by(*key)
    )
    for participant_id, experiment, position, num, right in stream(connection, query):
        for name, value in (("num", num), ("num_correct", right), ("share_correct", right / num)):
            yield participant_id, f"{experiment}.{position}.predictions.{name}", value


def _background(connection: Connection, wanted: Wanted) -> Iterator[Row]:
    """Yield cells of answers to background questions: participant, column, value."""
    query = (
        select(answers.c.participant_id, participants.c.study_version, answers.c.question, answers.c.answer)
        .join(participants, participants.c.id == answers.c.participant_id)
        .where(wanted.of(participants), answers.c.purpose == "background")
        .order_by(answers.c.participant_id, answers.c.page_number, answers.c.attempt)
    )
    for participant_id, version, question, answer in stream(connection, query):
        if not wanted.withholds(version, question, answer):
            yield participant_id, f"background.{question}", answer


def _declared(study: Study, wanted: Wanted) -> Iterator[Variable]:
    questions = () if study.background is None else study.background.questions
    yield from (_question(asked.id) for asked in questions if wanted.with_free_text or asked.type != "text")
    for experiment in study.experiments:
        for position in range(1, len(experiment.layouts) + 1):
            yield from _trial(f"{experiment.id}.{position}", [item.id for item in experiment.items])
            if experiment.satisfaction:
                yield from _items(f"{experiment.id}.{position}", SATISFACTION_ITEMS)
            yield from _measured(experiment, f"{experiment.id}.{position}")


def _measured(experiment: Experiment, trial: str) -> Iterator[Variable]:
    if experiment.probe is not None:
        yield from _predicted(trial)
    is_tailored = not TAILORED_KINDS.isdisjoint(experiment.kinds)
    if is_tailored or (experiment.drive is not None and experiment.drive.baseline):
        yield from _driven(f"{trial}.before")
    if experiment.drive is not None:
        yield from _driven(f"{trial}.after")


def _stored(connection: Connection, version: str) -> Iterator[Variable]:
    of_version = participants.c.study_version == version
    asked = (
        select(answers.c.question).distinct().join(participants).where(of_version, answers.c.purpose == "background")
    )
    yield from map(_question, connection.execute(asked.order_by(answers.c.question)).scalars().all())
    placed = select(trials.c.experiment, trials.c.position).distinct().join(participants).where(of_version)
    items = select(ratings.c.item).distinct().join(participants, participants.c.id == ratings.c.participant_id)
    found = connection.execute(items.where(of_version).order_by(ratings.c.item)).scalars().all()
    for experiment, position in connection.execute(placed.order_by(*placed.selected_columns)).all():
        trial = f"{experiment}.{position}"
        yield from trial_columns(trial, found)


def _question(question: str) -> Variable:
    return Variable(f"background.{question}", "text", f"The answer to the background question {question}.")


def _trial(trial: str, items: Sequence[str]) -> Iterator[Variable]:
    yield Variable(f"{trial}.layout", "text", "The world of this trial.")
    yield Variable(f"{trial}.kind", "text", "The kind of explanation that was drawn for this trial.", levels=KINDS)
    yield Variable(f"{trial}.draw", "integer", "Which of the random explanations; empty for other kinds.", minimum=0)
    yield from _items(trial, items)
    yield time(f"{trial}.submitted_at", "When the ratings of this trial were stored.")


def _items(trial: str, items: Sequence[str]) -> Iterator[Variable]:
    for item in items:
        yield Variable(f"{trial}.rating.{item}", "integer", f"The rating of {item}.", unit="points", minimum=1)
        yield response_time(f"{trial}.response_time_ms.{item}")


def _driven(drive: str) -> Iterator[Variable]:
    yield Variable(f"{drive}.end", "text", "How this drive ended: `reached`, `gave_up`, `step_limit` or `failed`.")
    yield Variable(f"{drive}.num_steps", "integer", "How many actions were taken.", unit="actions", minimum=0)
    yield Variable(f"{drive}.optimum", "integer", "The fewest that lead to the goal.", unit="actions", minimum=1)


def _predicted(trial: str) -> Iterator[Variable]:
    yield Variable(f"{trial}.predictions.num", "integer", "The number of predictions.", unit="predictions", minimum=1)
    yield Variable(f"{trial}.predictions.num_correct", "integer", "How many were right.", unit="predictions", minimum=0)
    yield Variable(f"{trial}.predictions.share_correct", "number", "The share that was right.", minimum=0, maximum=1)
