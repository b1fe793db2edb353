"""How soon people reach the goal: curves, restricted means and hazard ratios, with those who never arrive."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from webapp.analysis.binary_outcomes import Ratio, columns_of, kind_weights, without_constant_levels
from webapp.analysis.censoring import Undefined
from webapp.analysis.proportional_hazards import Hazards, Journeys, check_proportionality, fit_hazards
from webapp.analysis.shares import mean_of_several
from webapp.analysis.time_to_goal import LEAST_PEOPLE, arrival_curve, median_interval, median_time, restricted
from webapp.explainer.pictures.figure_style import BLACK, BLUE, GREEN, GREY, SKY, VERMILION
from webapp.reports.blocks import Assumption, Block, Column, Figure, Table
from webapp.reports.formatting import counted, number, p_clause
from webapp.reports.kind_outcomes import Outcomes, contrasts_of, ratio_blocks, stream
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Contrast

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_ENOUGH_PEOPLE, _FEWEST_PEOPLE = 40, 20
_COLOURS = (BLUE, VERMILION, GREEN, SKY, BLACK, GREY)
_DASHES = ("-", "--", ":", "-.")
_DOUBTFUL_P = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class ArrivalModel:
    """A proportional hazards model of the drives of one experiment.

    Attributes:
        hazards: The fitted model.
        kinds: The kinds in it, the first one being the reference.
        left_out: Levels of which nobody arrived, in words.
        aliased: Effects that others determine.
    """

    hazards: Hazards
    kinds: tuple[str, ...]
    left_out: tuple[str, ...]
    aliased: tuple[str, ...]

    def ratio(self, first: str, second: str) -> Ratio:
        """Return the hazard ratio of two kinds.

        Raises:
            Undefined: A kind is not in the model, or the ratio is without bound.
        """
        try:
            weights = kind_weights(self.hazards.names, self.kinds, first, second)
            return Ratio.of(*self.hazards.estimate(weights), self.hazards.df)
        except Undefined as undefined:
            because = f" ({'; '.join(self.left_out)})" if self.left_out else ""
            raise Undefined(f"{undefined}{because}") from None


Fitted = Mapping[str, ArrivalModel | str]
"""By experiment, the model, or why there is none."""


def arrival_models(after: Sequence[Outcomes]) -> Fitted:
    """Fit the model of each experiment."""
    found: dict[str, ArrivalModel | str] = {}
    for outcomes in after:
        try:
            found[outcomes.experiment] = _model(outcomes)
        except Undefined as undefined:
            found[outcomes.experiment] = str(undefined)
    return found


def arrival_blocks(data: StudyData, after: Sequence[Outcomes], fitted: Fitted) -> list[Block]:
    """Return what is said on the time to the goal, nothing without drives."""
    if not after:
        return []
    introduction = (
        "Time to the goal is counted in actions, over the fewest that there could be: 1 is a shortest path. Whoever "
        "gave up or ran out of actions never arrives, and stays among those who might up to the limit, as if they "
        "had gone on in vain: to leave them out when they give up would pretend that they were as likely to arrive "
        "as the others. As nobody is lost otherwise, the curve is the share that has arrived, and the hazard that of "
        "the subdistribution (Fine and Gray 1999)."
    )
    note = (
        "Above 1: the first kind arrives sooner. Proportional hazards of kind and position, layouts as strata, Efron's "
        "ties, errors robust within persons and corrected for few people, Student's t with people less one. Holm's "
        "correction is over this table's planned comparisons."
    )
    ratios = [
        (contrast, _ratio(fitted[outcomes.experiment], contrast))
        for outcomes in after
        for contrast in contrasts_of(data, outcomes.experiment)
    ]
    return [
        introduction,
        _times(after),
        *(_figure(outcomes) for outcomes in after),
        *ratio_blocks("drives_hazards", "Hazard ratios of arriving", "Hazard ratio", ratios, note),
    ]


def arrival_assumptions(after: Sequence[Outcomes], fitted: Fitted) -> list[Assumption]:
    """Say what the hazard model takes for granted."""
    found = []
    for outcomes in after:
        model = fitted[outcomes.experiment]
        if isinstance(model, str):
            continue
        test, people = f"Proportional hazards of drives, experiment {outcomes.experiment}", model.hazards.num_people
        ends = ", ".join(
            f"{count} {end.replace('_', ' ')}" for end, count in sorted(outcomes.frame["end"].value_counts().items())
        )
        found += [
            _proportional(test, model),
            Assumption(
                test,
                "There are enough people for errors that are robust within persons.",
                f"{counted(people, 'person', 'people')} ({_ENOUGH_PEOPLE} are enough, below {_FEWEST_PEOPLE} too few).",
                "holds" if people >= _ENOUGH_PEOPLE else "doubtful" if people >= _FEWEST_PEOPLE else "violated",
            ),
            Assumption(
                test,
                "Whoever gives up never arrives, and nobody is lost in another way.",
                f"{ends}; a drive in the middle of which somebody left is not in the data.",
                "by design",
            ),
        ]
    return found


def _model(outcomes: Outcomes) -> ArrivalModel:
    kept, left_out = without_constant_levels(outcomes.frame, ("kind", "trial", "layout"), only_none=True)
    kinds = tuple(sorted(kept["kind"].unique()))
    if len(kinds) < 2:  # noqa: PLR2004 - one kind has no other
        num = int(outcomes.frame["right"].sum())
        raise Undefined(
            f"hazards are compared between kinds after which somebody arrived, and there are {len(kinds)} ({num} of "
            f"{counted(len(outcomes.frame), 'drive')} arrived)"
        )
    # Layouts are strata: they determine effects, and have none themselves.
    columns = columns_of(kept, ("layout", "kind", "trial"), ())
    places = [place for place, name in enumerate(columns.names) if not name.startswith("layout=")]
    arrived = kept["right"].to_numpy(dtype=np.bool_)
    journeys = Journeys(
        times=np.where(arrived, kept["steps"], kept["limit"]).astype(np.float64),
        arrived=arrived,
        people=np.unique(kept["participant"], return_inverse=True)[1].astype(np.int64),
        strata=np.unique(kept["layout"], return_inverse=True)[1].astype(np.int64),
    )
    hazards = fit_hazards(journeys, columns.x[:, places], [columns.names[place] for place in places])
    return ArrivalModel(hazards, kinds, left_out, columns.aliased)


def _ratio(model: ArrivalModel | str, contrast: Contrast) -> Ratio | str:
    if isinstance(model, str):
        return model
    try:
        return model.ratio(contrast.first, contrast.second)
    except Undefined as undefined:
        return str(undefined)


def _times(after: Sequence[Outcomes]) -> Table:
    columns = (
        Column("kind", "Kind"),
        Column("experiment", "Experiment"),
        Column("drives", "Drives", "count"),
        Column("reached", "Reached", "count"),
        Column("gave_up", "Gave up", "count"),
        Column("step_limit", "Out of actions", "count"),
        Column("failed", "Failed", "count"),
        Column("median", "Median", "number"),
        Column("median_low", "95 % low", "number"),
        Column("median_high", "high", "number"),
        Column("restricted_mean", "Restricted mean", "number"),
        Column("low", "95 % low", "number"),
        Column("high", "high", "number"),
        Column("horizon", "Up to", "number"),
    )
    rows = tuple(_time_row(outcomes, kind) for outcomes in after for kind in outcomes.kinds)
    note = (
        "Actions over the fewest possible. Median: by when half of all drives had arrived; none if fewer did. Its "
        "interval is a percentile bootstrap over people, without an end where half do not arrive in that many "
        f"resamples, and there is none of fewer than {LEAST_PEOPLE} people. Restricted mean: whoever never arrives "
        "counts with the smallest limit of any drive of the experiment; interval robust within persons."
    )
    return Table("drives_times", "Time to the goal by kind", columns, rows, note)


def _time_row(outcomes: Outcomes, kind: str) -> tuple[str | int | float | None, ...]:
    rows, horizon = outcomes.of(kind), float(outcomes.frame["limit"].min())
    ends = [int((rows["end"] == end).sum()) for end in ("reached", "gave_up", "step_limit", "failed")]
    people, rng = rows["participant"].tolist(), stream(f"median/{outcomes.experiment}/{kind}")
    median = median_time(rows["steps"], rows["right"])
    ends_of_median = median_interval(people, rows["steps"], rows["right"], rng) or (None, None)
    mean = mean_of_several(people, restricted(rows["steps"], rows["right"], horizon))
    return (
        *(kind, outcomes.experiment, len(rows), *ends, median, *ends_of_median, mean.value),
        *(mean.interval or (None, None)),
        horizon,
    )


def _proportional(test: str, model: ArrivalModel) -> Assumption:
    assumes = "Ratios of hazards between kinds stay the same over time."
    tested = [place for place, name in enumerate(model.hazards.names) if name.startswith("kind=")]
    try:
        found = check_proportionality(model.hazards, tested)
    except Undefined as undefined:
        return Assumption(test, assumes, f"Not checked: {undefined}.", "not checkable")
    check = (
        f"Schoenfeld residuals of kinds against the rank of time: chi-square {number(found.statistic)}, "
        f"df {found.df}, {p_clause(found.p_value)} (Grambsch and Therneau 1994).{_left_out(model)}"
    )
    return Assumption(test, assumes, check, "holds" if found.p_value >= _DOUBTFUL_P else "doubtful")


def _left_out(model: ArrivalModel) -> str:
    told = f" Left out since nobody arrived: {'; '.join(model.left_out)}." if model.left_out else ""
    aliased = [name for name in model.aliased if not name.startswith("layout=")]
    return f"{told} Left out since others determine them: {', '.join(aliased)}." if aliased else told


def _figure(outcomes: Outcomes) -> Figure:
    horizon = float(outcomes.frame["limit"].min())
    curves = {kind: arrival_curve(outcomes.of(kind)["steps"], outcomes.of(kind)["right"]) for kind in outcomes.kinds}
    ends = ", ".join(f"{kind} {100 * shares[-1]:.0f} %" for kind, (_, shares) in curves.items())

    def fill(canvas: "Canvas") -> None:
        axes = canvas.subplots()
        for place, (kind, (times, shares)) in enumerate(curves.items()):
            axes.step(
                np.append(times, horizon),
                100 * np.append(shares, shares[-1]),
                where="post",
                color=_COLOURS[place % len(_COLOURS)],
                linestyle=_DASHES[(place + place // len(_COLOURS)) % len(_DASHES)],
                linewidth=1.4,
                label=f"{kind} ({100 * shares[-1]:.0f} %)",
            )
        axes.set_xlim(0.9, horizon)
        axes.set_ylim(0, 102)
        axes.set_xlabel("Actions over the fewest possible")
        axes.set_ylabel("Drives that have arrived, in %")
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)

    name = f"drives_curves_{''.join(c if c.isalnum() else '_' for c in outcomes.experiment)}"
    title = f"Share of drives that have arrived, over time, in experiment {outcomes.experiment}"
    return Figure(name, title, f"Rising steps, one line per kind; in the end {ends} have arrived.", (7.2, 3.0), fill)
