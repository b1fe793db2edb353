"""What was planted beside the planned tests, next to what the data show: predictions, drives, equivalences.

For orientation, without a verdict: the report has the tests.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import pandas as pd

from webapp.analysis.censoring import Undefined
from webapp.analysis.equivalence_paired import paired_tost
from webapp.bots.behaviours import BEHAVIOURS
from webapp.bots.effects import Effects
from webapp.bots.opinions import expected_rating
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Contrast
from webapp.study.intervals import cluster_interval

_ATTENTIVE = BEHAVIOURS["attentive"]


@dataclass(frozen=True, slots=True)
class Shown:
    """A number that was planted, and what was found of it.

    Attributes:
        experiment: The experiment.
        what: Of what it is.
        name: Of which kind, or which kinds on which item.
        planted: The number that attentive bots were made for.
        found: The one in the data; None where they do not determine it.
        low: The lower end of its interval, 95 %, or 90 % for an equivalence; None likewise.
        high: Its upper end.
        note: What else there is to say.
    """

    experiment: str
    what: Literal["right predictions", "drives that arrive", "difference in points"]
    name: str
    planted: float
    found: float | None
    low: float | None
    high: float | None
    note: str


def beside(data: StudyData, effects: Effects) -> tuple[Shown, ...]:
    """Return everything that is shown beside the planned tests."""
    return (*_predictions(data, effects), *_drives(data, effects), *_equivalences(data, effects))


def _predictions(data: StudyData, effects: Effects) -> Iterator[Shown]:
    if data.probes is not None and _ATTENTIVE.predicts is not None:
        right = data.probes.assign(hit=data.probes["is_correct"].astype(float))
        for experiment, kind, rows in _by_kind(right):
            planted = _chance(_ATTENTIVE.predicts + effects.on_prediction(kind))
            yield _share(experiment, "right predictions", kind, planted, rows)


def _drives(data: StudyData, effects: Effects) -> Iterator[Shown]:
    if data.drives is not None:
        after = data.drives[data.drives["phase"] == "after"]
        arrived = after.assign(hit=(after["end"] == "reached").astype(float))
        for experiment, kind, rows in _by_kind(arrived):
            planted = _chance(_ATTENTIVE.arrives + effects.on_drive(kind))
            yield _share(experiment, "drives that arrive", kind, planted, rows)


def _by_kind(rows: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    for key, of_kind in rows.groupby(["experiment", "kind"]):
        experiment, kind = key
        yield str(experiment), str(kind), of_kind


def _share(
    experiment: str,
    what: Literal["right predictions", "drives that arrive"],
    kind: str,
    planted: float,
    rows: pd.DataFrame,
) -> Shown:
    people = rows.groupby("participant")["hit"].agg(["sum", "count"])
    interval = cluster_interval((float(hits), int(num), 1) for hits, num in people.itertuples(index=False))
    low, high = (None, None) if interval is None else interval
    return Shown(experiment, what, kind, planted, float(rows["hit"].mean()), low, high, f"{len(rows)} in all")


def _chance(probability: float) -> float:
    return min(1.0, max(0.0, probability))


def _equivalences(data: StudyData, effects: Effects) -> Iterator[Shown]:
    for pair in data.plan.equivalences:
        for item in data.plan.items_of(pair):
            yield _equivalence(data, effects, pair, item)


def _equivalence(data: StudyData, effects: Effects, pair: Contrast, item: str) -> Shown:
    points = data.points.get((pair.experiment, item), 5)
    first, second = (expected_rating(points, effects.on_rating(kind, item)) for kind in (pair.first, pair.second))
    margin = data.plan.margin
    truth = "inside" if abs(first - second) < margin else "outside"
    name = f"{pair} on {item}"
    try:
        found = paired_tost(_differences(data.ratings, pair, item), margin, data.plan.alpha)
    except Undefined as undefined:
        return Shown(pair.experiment, "difference in points", name, first - second, None, None, None, str(undefined))
    is_within = -margin < found.low and found.high < margin
    note = f"margin {margin:g} points: planted {truth}, found {'inside' if is_within else 'not shown to be inside'}"
    return Shown(pair.experiment, "difference in points", name, first - second, found.mean, found.low, found.high, note)


def _differences(ratings: pd.DataFrame, pair: Contrast, item: str) -> pd.Series:
    """Return first minus second of each person who rated both, of the mean where a kind was rated several times."""
    rows = ratings[(ratings["experiment"] == pair.experiment) & (ratings["item"] == item)]
    means = rows.pivot_table(index="participant", columns="kind", values="rating", aggfunc="mean")
    both = means.reindex(columns=[pair.first, pair.second]).dropna()
    return both[pair.first] - both[pair.second]
