"""What was felt beside what was measured, trial by trial: the data of the section on calibration, and its figure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from webapp.analysis.shares import Share, share_of
from webapp.explainer.pictures.figure_style import BLUE, GREY, INK, VERMILION
from webapp.reports.blocks import Figure
from webapp.reports.kind_outcomes import Outcomes, drives_of, experiments, probes_of
from webapp.reports.study_data import StudyData

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

FELT = ("foresee", "likeliness")
"""The items that say how well somebody feels they understand; the first one that a trial has counts."""

CONFIDENCE_POINTS = 5


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What was felt beside what was measured, in one experiment.

    Attributes:
        outcomes: The outcomes, with `rating` as a column.
        item: What was felt: an item, or `confidence`.
        measure: What was measured: `drives` or `predictions`.
        points: Of the item's scale.
    """

    outcomes: Outcomes
    item: str
    measure: str
    points: int

    @property
    def frame(self) -> pd.DataFrame:
        """One row per outcome."""
        return self.outcomes.frame

    @property
    def name(self) -> str:
        """What is compared, and where."""
        return f"{self.item} against {self.measure} in experiment {self.outcomes.experiment}"


def judged_of(data: StudyData) -> Iterator[Judged]:
    """Yield what can be compared: an item with drives and with predictions, and confidence with predictions."""
    for experiment in experiments(data):
        drives, probes = drives_of(data, experiment, "after"), probes_of(data, experiment)
        for measure, outcomes in (("drives", drives), ("predictions", probes)):
            item = _item(data, experiment)
            if outcomes is None or item is None:
                continue
            joined = outcomes.frame.merge(_ratings(data, experiment, item), on=["participant", "trial"])
            if len(joined):
                points = data.points.get((experiment, item), 5)
                yield Judged(Outcomes(experiment, _kinds(outcomes, joined), joined), item, measure, points)
        if probes is not None and probes.frame["confidence"].notna().any():
            known = probes.frame[probes.frame["confidence"].notna()].reset_index(drop=True)
            frame = known.assign(rating=known["confidence"])
            yield Judged(
                Outcomes(experiment, _kinds(probes, frame), frame), "confidence", "predictions", CONFIDENCE_POINTS
            )


def _kinds(outcomes: Outcomes, frame: pd.DataFrame) -> tuple[str, ...]:
    there = set(frame["kind"])
    return tuple(kind for kind in outcomes.kinds if kind in there)


def _item(data: StudyData, experiment: str) -> str | None:
    asked = set(data.ratings.loc[data.ratings["experiment"] == experiment, "item"])
    return next((item for item in FELT if item in asked), None)


def _ratings(data: StudyData, experiment: str, item: str) -> pd.DataFrame:
    rows = data.ratings[(data.ratings["experiment"] == experiment) & (data.ratings["item"] == item)]
    found = rows[["participant", "trial", "rating"]]
    return found.assign(trial=found["trial"].astype("int64"), rating=found["rating"].astype("float64"))


def by_rating(judged: Judged) -> list[tuple[float, Share]]:
    """Return the share that is right for each rating that occurs, ascending."""
    return [
        (float(rating), share_of(rows["participant"].tolist(), rows["right"]))
        for rating, rows in judged.frame.groupby("rating", sort=True)
    ]


def calibration_figure(judged: Sequence[Judged]) -> Figure:
    """Return the share that is right by rating, one panel each."""
    curves = [(each, by_rating(each)) for each in judged]
    told = "; ".join(
        f"{each.name}: from {100 * shares[0][1].value:.0f} % at {shares[0][0]:.0f} to {100 * shares[-1][1].value:.0f} "
        f"% at {shares[-1][0]:.0f}"
        for each, shares in curves
    )

    def fill(canvas: "Canvas") -> None:
        num_columns = min(3, len(curves))
        num_rows = -(-len(curves) // num_columns)
        panels = canvas.subplots(num_rows, num_columns, squeeze=False, sharey=True).ravel()
        for panel, (each, shares) in zip(panels, curves, strict=False):
            _fill_panel(panel, each, shares)
        for panel in panels[len(curves) :]:
            panel.set_visible(False)
        panels[0].set_ylabel("Right, in %")

    height = 0.4 + 2.3 * (-(-len(curves) // min(3, len(curves))))
    title = "Share that is right by rating, with 95 % intervals; above, how many; dashed, the ends taken for 0 and 1"
    return Figure("calibration_curves", title, f"Share that is right by rating. {told}.", (7.2, height), fill)


def _fill_panel(panel: "Axes", judged: Judged, shares: Sequence[tuple[float, Share]]) -> None:
    panel.plot([1, judged.points], [0, 100], color=GREY, linewidth=0.8, linestyle="--")
    for rating, share in shares:
        low, high = share.cluster or share.wilson
        panel.plot([rating, rating], [100 * low, 100 * high], color=BLUE, linewidth=1.4)
        panel.annotate(
            str(share.total), (rating, 104), horizontalalignment="center", fontsize=6.5, annotation_clip=False
        )
    panel.plot(
        [r for r, _ in shares], [100 * s.value for _, s in shares], "-o", color=VERMILION, markersize=4, clip_on=False
    )
    panel.set_title(f"{judged.item}, {judged.measure} ({judged.outcomes.experiment})", pad=16, color=INK)
    panel.set_xticks(range(1, judged.points + 1))
    panel.set_xlim(0.6, judged.points + 0.4)
    panel.set_ylim(0, 100)
    panel.set_xlabel("Rating")
