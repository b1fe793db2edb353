"""The numbers on the dashboard: who is where, how often each kind met each layout, and how explanations were rated."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from sqlalchemy import ColumnElement, Connection, and_, func, select

from webapp.storage.database import Database
from webapp.storage.participants import Mode
from webapp.storage.tables import pages, participants, ratings, trials
from webapp.study.protocol import Study

State = Literal["consented", "in_progress", "completed", "withdrawn"]


@dataclass(frozen=True, slots=True)
class Counts:
    """How many participants are where.

    Attributes:
        arrived: Gave their consent, whatever happened later.
        in_progress: Have neither finished nor left.
        completed: Sent the last page.
        withdrawn: Left before the end.
    """

    arrived: int
    in_progress: int
    completed: int
    withdrawn: int


@dataclass(frozen=True, slots=True)
class Cell:
    """One kind of explanation on one layout.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        layout: The layout's name.
        assigned: How many participants are to see it, or have seen it.
        rated: How many have rated it.
    """

    experiment: str
    kind: str
    layout: str
    assigned: int
    rated: int


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
class MeanRating:
    """How one kind was rated on one item, over all participants so far.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        item: The item's id.
        points: The highest answer of its scale; the lowest is 1.
        mean: The mean rating.
        sd: The standard deviation with n - 1; None for a single rating.
        n: The number of ratings, at least 1.
    """

    experiment: str
    kind: str
    item: str
    points: int
    mean: float
    sd: float | None
    n: int


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
        ratings: None while they are hidden; else in the order of the study file, those without ratings left out.
        num_elsewhere: How many participants of other studies, versions and modes the database holds; they are in the
            downloads and not in these numbers.
    """

    mode: Mode
    study: str
    version: str
    counts: Counts
    cells: tuple[Cell, ...]
    participants: tuple[Progress, ...]
    ratings: tuple[MeanRating, ...] | None
    num_elsewhere: int


def read_overview(database: Database, study: Study, version: str, mode: Mode, *, revealed: bool) -> Overview:
    """Read the dashboard's numbers, all from one state of the database.

    Args:
        database: Where to read.
        study: The study as declared, for the order of things.
        version: The study version to count.
        mode: The mode to count.
        revealed: Whether the ratings may be seen; if not they are not even read.
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
            ratings=_ratings(connection, study, counted) if revealed else None,
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
            state=_state(row.completed_at, row.withdrawn_at, row.num_stored),
            progress=row.num_stored,
            num_pages=row.num_pages,
            consented_at=row.consented_at,
            last_seen=row.last_seen_at,
        )
        for row in connection.execute(query)
    )


def _state(completed_at: datetime | None, withdrawn_at: datetime | None, num_stored: int) -> State:
    if completed_at is not None:
        return "completed"
    if withdrawn_at is not None:
        return "withdrawn"
    return "in_progress" if num_stored else "consented"


def _counts(lines: Sequence[Progress]) -> Counts:
    states = [line.state for line in lines]
    return Counts(
        arrived=len(states),
        in_progress=states.count("consented") + states.count("in_progress"),
        completed=states.count("completed"),
        withdrawn=states.count("withdrawn"),
    )


def _cells(connection: Connection, study: Study, counted: ColumnElement[bool]) -> tuple[Cell, ...]:
    rated = and_(
        pages.c.participant_id == trials.c.participant_id,
        pages.c.trial_number == trials.c.number,
        pages.c.kind == "rating",
    )
    key = (trials.c.experiment, trials.c.kind, trials.c.layout)
    query = (
        select(*key, func.count(), func.count(pages.c.number))
        .join(participants, participants.c.id == trials.c.participant_id)
        .outerjoin(pages, rated)
        .where(counted)
        .group_by(*key)
    )
    found = {(experiment, kind, layout): counts for experiment, kind, layout, *counts in connection.execute(query)}
    return tuple(
        Cell(experiment.id, kind, layout, *found.get((experiment.id, kind, layout), (0, 0)))
        for experiment in study.experiments
        for kind in experiment.kinds
        for layout in experiment.layouts
    )


def _ratings(connection: Connection, study: Study, counted: ColumnElement[bool]) -> tuple[MeanRating, ...]:
    key = (trials.c.experiment, trials.c.kind, ratings.c.item)
    total, squares = func.sum(ratings.c.rating), func.sum(ratings.c.rating * ratings.c.rating)
    query = (
        select(*key, func.count(), total, squares)
        .select_from(ratings)
        .join(pages, and_(pages.c.participant_id == ratings.c.participant_id, pages.c.number == ratings.c.page_number))
        .join(trials, and_(trials.c.participant_id == pages.c.participant_id, trials.c.number == pages.c.trial_number))
        .join(participants, participants.c.id == ratings.c.participant_id)
        .where(counted)
        .group_by(*key)
    )
    found = {(experiment, kind, item): sums for experiment, kind, item, *sums in connection.execute(query)}
    return tuple(
        MeanRating(experiment.id, kind, item.id, item.points, *_mean_and_sd(*found[experiment.id, kind, item.id]))
        for experiment in study.experiments
        for kind in experiment.kinds
        for item in experiment.items
        if (experiment.id, kind, item.id) in found
    )


def _mean_and_sd(n: int, total: int, squares: int) -> tuple[float, float | None, int]:
    sd = None if n == 1 else math.sqrt((n * squares - total * total) / (n * (n - 1)))
    return total / n, sd, n
