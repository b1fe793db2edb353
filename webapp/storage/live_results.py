"""Ratings, predictions and drives from the tally, with intervals over people."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence

from webapp.storage.live_outcomes import (
    Calibration,
    Driven,
    DriveSummary,
    MeanEstimate,
    PredictionSummary,
    RatingSummary,
    Share,
)
from webapp.storage.live_plans import Plans
from webapp.storage.live_tally import Histogram, Tally
from webapp.study.intervals import cluster_interval, mean_interval, wilson_interval
from webapp.study.question_forms import CONFIDENCE_POINTS

_NO_SPREAD = 1e-9
"""An interval narrower than this is one of people who all gave the same share, but for rounding."""


def rating_summaries(plans: Plans, tally: Tally) -> tuple[RatingSummary, ...]:
    """Return how kinds were rated, in the order of the study file."""
    return tuple(
        _rating_summary(*key, plans.points[key], tally.ratings[place])
        for place, key in enumerate(plans.rating_keys)
        if tally.ratings.get(place)
    )


def prediction_summaries(plans: Plans, tally: Tally) -> tuple[PredictionSummary, ...]:
    """Return how the agent was predicted, in the order of the study file."""
    return tuple(
        _prediction_summary(*arm, tally.predictions[place], tally.confidences[place])
        for place, arm in enumerate(plans.arms)
        if tally.predictions.get(place)
    )


def drive_summaries(plans: Plans, tally: Tally) -> tuple[DriveSummary, ...]:
    """Return how people drove in trials, in the order of the study file."""
    return tuple(
        _drive_summary(*arm, tally.drives[place]) for place, arm in enumerate(plans.arms) if tally.drives.get(place)
    )


def share_of(counted: Iterable[tuple[int, int, int]]) -> Share | None:
    """Estimate a share from how many answers of people count, how many they gave, and how many people gave just that.

    Returns:
        The share; None without answers.
    """
    people = [entry for entry in counted if entry[1]]
    if not people:
        return None
    n_people = sum(times for *_, times in people)
    n = sum(answers * times for _, answers, times in people)
    num = sum(counting * times for counting, _, times in people)
    interval = None if n == n_people else cluster_interval(people)
    if interval is None or interval[1] - interval[0] < _NO_SPREAD:
        return Share(n, num, n_people, num / n, *wilson_interval(n_people * num / n, n_people), method="wilson")
    return Share(n, num, n_people, num / n, max(0.0, interval[0]), min(1.0, interval[1]), method="cluster")


def mean_of(given: Iterable[tuple[int, int, int]]) -> MeanEstimate | None:
    """Estimate a mean over values from people's sums, how many values they gave, and how many people gave just that."""
    people = [entry for entry in given if entry[1]]
    if not people:
        return None
    n = sum(values * times for _, values, times in people)
    mean = sum(total * times for total, _, times in people) / n
    lower, upper = cluster_interval(people) or (None, None)
    return MeanEstimate(n, sum(times for *_, times in people), mean, lower, upper)


def _rating_summary(experiment: str, kind: str, item: str, points: int, given: Histogram) -> RatingSummary:
    means = [(total / n, times) for (total, n), times in given.items()]
    n_people = sum(times for _, times in means)
    mean = math.fsum(value * times for value, times in means) / n_people
    sd = None
    if n_people > 1:
        sd = math.sqrt(math.fsum((value - mean) ** 2 * times for value, times in means) / (n_people - 1))
    lower, upper = (None, None) if sd is None else mean_interval(mean, sd, n_people)
    n = sum(n * times for (_, n), times in given.items())
    return RatingSummary(experiment, kind, item, points, n_people, n, mean, sd, lower, upper)


def _prediction_summary(experiment: str, kind: str, made: Histogram, confidences: Histogram) -> PredictionSummary:
    right = share_of((num_right, n, times) for (n, num_right, _), times in made.items())
    as_good = share_of((num_as_good, n, times) for (n, _, num_as_good), times in made.items())
    assert right is not None  # noqa: S101 - for the type checker: somebody predicted
    assert as_good is not None  # noqa: S101 - likewise
    total = sum(confidence * times for (confidence, _), times in confidences.items())
    return PredictionSummary(
        experiment=experiment,
        kind=kind,
        right=right,
        as_good=as_good,
        mean_confidence=total / right.n,
        calibration=tuple(_calibration(confidence, confidences) for confidence in range(1, CONFIDENCE_POINTS + 1)),
    )


def _calibration(confidence: int, confidences: Histogram) -> Calibration:
    num_right, num_wrong = (confidences.get((confidence, right), 0) for right in (1, 0))
    return Calibration(confidence, num_right + num_wrong, num_right)


def _drive_summary(experiment: str, kind: str, driven: Histogram) -> DriveSummary:
    return DriveSummary(
        experiment=experiment,
        kind=kind,
        before=_driven(driven, start=0),
        after=_driven(driven, start=3),
        gain=mean_of(_columns(driven, 7, 6)),
    )


def _driven(driven: Histogram, start: int) -> Driven:
    return Driven(
        reached=share_of(_columns(driven, start + 1, start)),
        extra_steps=mean_of(_columns(driven, start + 2, start + 1)),
    )


def _columns(driven: Histogram, total: int, n: int) -> Sequence[tuple[int, int, int]]:
    """Return sums, numbers of values and of people, by two of the places in `DRIVE_NUMBERS`, from 0 after the arm's."""
    found: Counter[tuple[int, int]] = Counter()
    for gave, times in driven.items():
        found[gave[total], gave[n]] += times
    return [(*gave, times) for gave, times in found.items()]
