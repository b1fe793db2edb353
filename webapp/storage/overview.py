"""The numbers on the dashboard: who is where, how often each kind met each layout, and how explanations did."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

from sqlalchemy import ColumnElement, Connection, Row, and_, func, select

from webapp.storage.database import Database
from webapp.storage.outcomes import (
    DriveSummary,
    MeanRating,
    PredictionSummary,
    drive_summaries,
    mean_ratings,
    prediction_summaries,
)
from webapp.storage.participants import Mode
from webapp.storage.tables import pages, participants, trials
from webapp.study.experiments import Experiment, Kind
from webapp.study.protocol import Study
from webapp.study.session import PageKind, Trial
from webapp.study.session import pages as all_pages

State = Literal["consented", "in_progress", "completed", "withdrawn", "screened_out"]


@dataclass(frozen=True, slots=True)
class Counts:
    """How many participants are where.

    Attributes:
        arrived: Gave their consent, whatever happened later.
        in_progress: Have neither finished nor left nor been screened out.
        completed: Sent the last page.
        withdrawn: Left before the end.
        screened_out: Failed the quiz, which ended the study for them.
    """

    arrived: int
    in_progress: int
    completed: int
    withdrawn: int
    screened_out: int


@dataclass(frozen=True, slots=True)
class Cell:
    """One kind of explanation on one layout.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        layout: The layout's name.
        assigned: How many participants are to see it, or have seen it.
        done: How many have sent the last page of its trial, whichever that is: a rating, or a drive.
    """

    experiment: str
    kind: str
    layout: str
    assigned: int
    done: int


@dataclass(frozen=True, slots=True)
class Progress:
    """How far one participant is.

    Attributes:
        code: The participant's public code.
        state: `consented` until the first page was sent.
        progress: The number of pages sent.
        num_pages: The number of pages there are.
        consented_at: The time of the consent.
        last_seen: The time of the latest thing the participant sent.
    """

    code: str
    state: State
    progress: int
    num_pages: int
    consented_at: datetime
    last_seen: datetime


@dataclass(frozen=True, slots=True)
class UnvalidatedLanguage:
    """A language in which the rating items are a translation that nobody has shown to ask the same.

    Attributes:
        language: The language's code.
        num_participants: How many participants read it.
    """

    language: str
    num_participants: int


@dataclass(frozen=True, slots=True)
class Overview:
    """The dashboard's numbers at one moment, for one version of a study in one mode.

    Attributes:
        mode: The mode of the participants counted.
        study: The study's name.
        version: The study version of the participants counted.
        counts: How many are where.
        cells: In the order of the study file, those without participants included.
        participants: Latest consent first.
        unvalidated: In the order of the study file, those that nobody reads included.
        ratings: None while they are hidden; else in the order of the study file, those without ratings left out.
        predictions: The same of the predictions.
        drives: The same of the drives.
        num_elsewhere: How many participants of other studies, versions and modes the database holds; they are in the
            downloads and not in these numbers.
    """

    mode: Mode
    study: str
    version: str
    counts: Counts
    cells: tuple[Cell, ...]
    participants: tuple[Progress, ...]
    unvalidated: tuple[UnvalidatedLanguage, ...]
    ratings: tuple[MeanRating, ...] | None
    predictions: tuple[PredictionSummary, ...] | None
    drives: tuple[DriveSummary, ...] | None
    num_elsewhere: int


def read_overview(database: Database, study: Study, version: str, mode: Mode, *, revealed: bool) -> Overview:
    """Read the dashboard's numbers, all from one state of the database.

    Args:
        database: Where to read.
        study: The study as declared, for the order of things.
        version: The study version to count.
        mode: The mode to count.
        revealed: Whether ratings, predictions and drives may be seen; if not they are not even read.
    """
    counted = and_(
        participants.c.study == study.name, participants.c.study_version == version, participants.c.mode == mode
    )
    with database.read() as connection:
        lines = _progress(connection, counted)
        num_all = connection.execute(select(func.count()).select_from(participants)).scalar_one()
        return Overview(
            mode=mode,
            study=study.name,
            version=version,
            counts=_counts(lines),
            cells=_cells(connection, study, counted),
            participants=lines,
            unvalidated=_unvalidated(connection, study, counted),
            ratings=mean_ratings(connection, study, counted) if revealed else None,
            predictions=prediction_summaries(connection, study, counted) if revealed else None,
            drives=drive_summaries(connection, study, counted) if revealed else None,
            num_elsewhere=num_all - len(lines),
        )


def _progress(connection: Connection, counted: ColumnElement[bool]) -> tuple[Progress, ...]:
    num_stored = func.count(pages.c.number).label("num_stored")
    query = (
        select(participants, num_stored)
        .outerjoin(pages, pages.c.participant_id == participants.c.id)
        .where(counted)
        .group_by(participants.c.id)
        .order_by(participants.c.id.desc())
    )
    return tuple(
        Progress(
            code=row.code,
            state=_state(row),
            progress=row.num_stored,
            num_pages=row.num_pages,
            consented_at=row.consented_at,
            last_seen=row.last_seen_at,
        )
        for row in connection.execute(query)
    )


def _state(row: Row[Any]) -> State:
    if row.completed_at is not None:
        return "completed"
    if row.withdrawn_at is not None:
        return "withdrawn"
    if row.screened_out_at is not None:
        return "screened_out"
    return "in_progress" if row.num_stored else "consented"


def _counts(lines: Sequence[Progress]) -> Counts:
    states = [line.state for line in lines]
    return Counts(
        arrived=len(states),
        in_progress=states.count("consented") + states.count("in_progress"),
        completed=states.count("completed"),
        withdrawn=states.count("withdrawn"),
        screened_out=states.count("screened_out"),
    )


def _cells(connection: Connection, study: Study, counted: ColumnElement[bool]) -> tuple[Cell, ...]:
    key = (trials.c.experiment, trials.c.kind, trials.c.layout)
    assigned = (
        select(*key, func.count())
        .join(participants, participants.c.id == trials.c.participant_id)
        .where(counted)
        .group_by(*key)
    )
    sent = (
        select(*key, pages.c.kind, func.count())
        .select_from(pages)
        .join(trials, and_(trials.c.participant_id == pages.c.participant_id, trials.c.number == pages.c.trial_number))
        .join(participants, participants.c.id == trials.c.participant_id)
        .where(counted)
        .group_by(*key, pages.c.kind)
    )
    num_assigned = {tuple(cell): count for *cell, count in connection.execute(assigned)}
    num_sent = {tuple(page): count for *page, count in connection.execute(sent)}
    return tuple(
        Cell(
            experiment=experiment.id,
            kind=kind,
            layout=layout,
            assigned=num_assigned.get((experiment.id, kind, layout), 0),
            done=num_sent.get((experiment.id, kind, layout, _last_page(study, experiment, kind)), 0),
        )
        for experiment in study.experiments
        for kind in experiment.kinds
        for layout in experiment.layouts
    )


def _last_page(study: Study, experiment: Experiment, kind: Kind) -> PageKind:
    """Return what stands on the last page of a trial."""
    draw = 0 if kind == "random" else None
    trial = Trial(experiment.id, 1, len(experiment.layouts), experiment.layouts[0], kind, draw)
    return all_pages(study, [trial])[-1].kind


def _unvalidated(connection: Connection, study: Study, counted: ColumnElement[bool]) -> tuple[UnvalidatedLanguage, ...]:
    query = select(participants.c.language, func.count()).where(counted).group_by(participants.c.language)
    readers = dict(tuple(row) for row in connection.execute(query))
    return tuple(
        UnvalidatedLanguage(language, readers.get(language, 0))
        for language in study.languages
        if study.validation(language) == "unvalidated"
    )
