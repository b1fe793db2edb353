"""How explanations did, by experiment and kind: mean ratings, predictions and drives, as the dashboard shows them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, FromClause, and_, case, func, select

from webapp.storage.tables import drives, pages, participants, predictions, ratings, trials
from webapp.study.experiments import SATISFACTION_ITEMS, Experiment, Item
from webapp.study.protocol import Study
from webapp.study.question_forms import CONFIDENCE_POINTS

_Drive = tuple[bool, int]
"""Whether the goal was reached, and how many steps more were taken than needed."""


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

    @property
    def is_satisfaction(self) -> bool:
        """Whether the item belongs to the Explanation Satisfaction Scale."""
        return self.item in SATISFACTION_ITEMS


@dataclass(frozen=True, slots=True)
class Calibration:
    """Predictions of one confidence.

    Attributes:
        confidence: From 1 to 5.
        n: How many there are.
        num_right: How many of them are what the agent does.
    """

    confidence: int
    n: int
    num_right: int

    @property
    def share_right(self) -> float | None:
        """The share that is right; None where there are none."""
        return self.num_right / self.n if self.n else None


@dataclass(frozen=True, slots=True)
class PredictionSummary:
    """How participants predicted the agent after one kind.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        n: The number of predictions, at least 1.
        share_right: The share that is what the agent does.
        share_as_good: The share with which the goal can be reached in as few steps; no smaller.
        mean_confidence: From 1 to 5.
        calibration: One entry for each confidence from 1 to 5, those without predictions included.
    """

    experiment: str
    kind: str
    n: int
    share_right: float
    share_as_good: float
    mean_confidence: float
    calibration: tuple[Calibration, ...]


@dataclass(frozen=True, slots=True)
class Driven:
    """How drives before or after an explanation went.

    Attributes:
        n: How many were finished, by giving up and by running out of steps too.
        num_reached: How many reached the goal.
        extra_steps: How many steps more than needed those took, on average; None where none arrived.
    """

    n: int
    num_reached: int
    extra_steps: float | None

    @property
    def share_reached(self) -> float | None:
        """The share that reached the goal; None where nobody drove."""
        return self.num_reached / self.n if self.n else None


@dataclass(frozen=True, slots=True)
class DriveSummary:
    """How participants drove with one kind.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        before: The drives before the explanation.
        after: Those after it.
        num_pairs: In how many trials there are both.
        gain: Of these the share that reached the goal after minus the share that did before; None where there are none.
    """

    experiment: str
    kind: str
    before: Driven
    after: Driven
    num_pairs: int
    gain: float | None


def mean_ratings(connection: Connection, study: Study, counted: ColumnElement[bool]) -> tuple[MeanRating, ...]:
    """Return the mean ratings in the order of the study file, the satisfaction scale last; none without ratings.

    Args:
        connection: Where to read.
        study: For the order of things.
        counted: Which participants count.
    """
    key = (trials.c.experiment, trials.c.kind, ratings.c.item)
    total, squares = func.sum(ratings.c.rating), func.sum(ratings.c.rating * ratings.c.rating)
    query = select(*key, func.count(), total, squares).select_from(_of_trials(ratings)).where(counted).group_by(*key)
    found = {(experiment, kind, item): sums for experiment, kind, item, *sums in connection.execute(query)}
    return tuple(
        MeanRating(experiment.id, kind, item.id, item.points, *_mean_and_sd(*found[experiment.id, kind, item.id]))
        for experiment in study.experiments
        for kind in experiment.kinds
        for item in _items(experiment)
        if (experiment.id, kind, item.id) in found
    )


def prediction_summaries(
    connection: Connection, study: Study, counted: ColumnElement[bool]
) -> tuple[PredictionSummary, ...]:
    """Return how participants predicted, in the order of the study file; no kind without predictions."""
    key = (trials.c.experiment, trials.c.kind)
    right, as_good = (func.sum(case((so, 1), else_=0)) for so in (predictions.c.is_correct, predictions.c.is_as_good))
    query = (
        select(*key, predictions.c.confidence, func.count(), right, as_good)
        .select_from(_of_trials(predictions))
        .where(counted)
        .group_by(*key, predictions.c.confidence)
    )
    found: dict[tuple[str, str], dict[int, tuple[int, int, int]]] = {}
    for experiment, kind, confidence, *counts in connection.execute(query):
        found.setdefault((experiment, kind), {})[confidence] = (counts[0], counts[1], counts[2])
    return tuple(
        _prediction_summary(experiment.id, kind, found[experiment.id, kind])
        for experiment in study.experiments
        for kind in experiment.kinds
        if (experiment.id, kind) in found
    )


def drive_summaries(connection: Connection, study: Study, counted: ColumnElement[bool]) -> tuple[DriveSummary, ...]:
    """Return how participants drove in trials, in the order of the study file; no kind without a finished drive."""
    query = (
        select(
            trials.c.experiment,
            trials.c.kind,
            trials.c.participant_id,
            trials.c.number,
            drives.c.phase,
            drives.c.end == "reached",
            drives.c.num_steps - drives.c.optimum,
        )
        .select_from(_of_trials(drives))
        .where(counted)
    )
    found: dict[tuple[str, str], dict[tuple[int, int], dict[str, _Drive]]] = {}
    for experiment, kind, participant_id, trial, phase, reached, extra in connection.execute(query):
        of_kind = found.setdefault((experiment, kind), {})
        of_kind.setdefault((participant_id, trial), {})[phase] = (reached, extra)
    return tuple(
        _drive_summary(experiment.id, kind, tuple(found[experiment.id, kind].values()))
        for experiment in study.experiments
        for kind in experiment.kinds
        if (experiment.id, kind) in found
    )


def _of_trials(table: FromClause) -> FromClause:
    """Join a table that belongs to pages with its trials and participants; pages before the trials drop out."""
    return (
        table.join(pages, and_(pages.c.participant_id == table.c.participant_id, pages.c.number == table.c.page_number))
        .join(trials, and_(trials.c.participant_id == pages.c.participant_id, trials.c.number == pages.c.trial_number))
        .join(participants, participants.c.id == table.c.participant_id)
    )


def _items(experiment: Experiment) -> tuple[Item, ...]:
    satisfaction = SATISFACTION_ITEMS if experiment.satisfaction else ()
    return (*experiment.items, *(Item(id=item) for item in satisfaction))


def _mean_and_sd(n: int, total: int, squares: int) -> tuple[float, float | None, int]:
    sd = None if n == 1 else math.sqrt((n * squares - total * total) / (n * (n - 1)))
    return total / n, sd, n


def _prediction_summary(
    experiment: str, kind: str, by_confidence: dict[int, tuple[int, int, int]]
) -> PredictionSummary:
    n, num_right, num_as_good = (sum(counts) for counts in zip(*by_confidence.values(), strict=True))
    return PredictionSummary(
        experiment=experiment,
        kind=kind,
        n=n,
        share_right=num_right / n,
        share_as_good=num_as_good / n,
        mean_confidence=sum(confidence * counts[0] for confidence, counts in by_confidence.items()) / n,
        calibration=tuple(
            Calibration(confidence, *by_confidence.get(confidence, (0, 0))[:2])
            for confidence in range(1, CONFIDENCE_POINTS + 1)
        ),
    )


def _drive_summary(experiment: str, kind: str, by_trial: Sequence[dict[str, _Drive]]) -> DriveSummary:
    pairs = [(trial["before"][0], trial["after"][0]) for trial in by_trial if {"before", "after"} <= trial.keys()]
    return DriveSummary(
        experiment=experiment,
        kind=kind,
        before=_driven([trial["before"] for trial in by_trial if "before" in trial]),
        after=_driven([trial["after"] for trial in by_trial if "after" in trial]),
        num_pairs=len(pairs),
        gain=sum(after - before for before, after in pairs) / len(pairs) if pairs else None,
    )


def _driven(found: Sequence[_Drive]) -> Driven:
    extra_steps = [extra for reached, extra in found if reached]
    mean = sum(extra_steps) / len(extra_steps) if extra_steps else None
    return Driven(n=len(found), num_reached=len(extra_steps), extra_steps=mean)
