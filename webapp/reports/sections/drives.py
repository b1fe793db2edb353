"""Whether people reach the goal after an explanation, and foresee the agent: measured understanding, not felt."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import pandas as pd

from webapp.analysis.binary_outcomes import BinaryFit
from webapp.analysis.shares import mean_of_several, share_of
from webapp.explainer.pictures.figure_style import BLUE, GREY, VERMILION
from webapp.reports.blocks import Assumption, Block, Cell, Column, Figure, Section, Statement, Table
from webapp.reports.formatting import counted
from webapp.reports.kind_outcomes import (
    MARGINAL_COLUMNS,
    SHARE_COLUMNS,
    Outcomes,
    drives_of,
    enough_people,
    experiments,
    logistic_assumptions,
    marginal_cells,
    models,
    odds_of,
    probes_of,
    ratio_blocks,
    share_cells,
)
from webapp.reports.read_exclusions import BEFORE_RATING
from webapp.reports.sections.arrivals import arrival_assumptions, arrival_blocks, arrival_models
from webapp.reports.study_data import StudyData
from webapp.reports.whereabouts import Unknown, whereabouts

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_ODDS_NOTE = (
    "Odds of the first kind over those of the second, of the same person, by the mixed logistic model with kind, "
    "layout and position as effects and an intercept per person; Wald's intervals by Student's t. Holm's correction is "
    "over this table's planned comparisons, a family of its own."
)
_WITHOUT_FAULT = (None, "incomplete", BEFORE_RATING)
"""Reasons for not being analysed that say nothing against whoever left."""


def section(data: StudyData) -> Section:
    """Return the section."""
    of = experiments(data)
    after = [found for each in of if (found := drives_of(data, each, "after")) is not None]
    probes = [found for each in of if (found := probes_of(data, each)) is not None]
    drive_models, probe_models, arrivals = models(after), models(probes), arrival_models(after)
    blocks = [*_drive_blocks(data, after, drive_models), *_gain_blocks(data, of)]
    blocks += arrival_blocks(data, after, arrivals)
    blocks += _probe_blocks(data, probes, probe_models)
    assumptions = [
        *_model_assumptions("drives", drive_models),
        *arrival_assumptions(after, arrivals),
        *_model_assumptions("predictions", probe_models),
        *enough_people(
            "Cluster intervals of shares, gains and restricted means",
            [outcomes.of(kind)["participant"].nunique() for outcomes in (*after, *probes) for kind in outcomes.kinds],
        ),
    ]
    return Section("drives", "Measured understanding: drives and predictions", tuple(blocks), tuple(assumptions))


def _model_assumptions(what: str, fitted: dict[str, BinaryFit | str]) -> list[Assumption]:
    return [
        assumption
        for experiment, model in fitted.items()
        for assumption in logistic_assumptions(f"Mixed logistic model of {what}, experiment {experiment}", model)
    ]


def _drive_blocks(data: StudyData, after: Sequence[Outcomes], fitted: dict[str, BinaryFit | str]) -> list[Block]:
    if not after:
        return [Statement("The drives", "there is no drive after an explanation in the data")]
    introduction = (
        "After the explanation people steer the agent themselves. The share that reaches the goal is the paper's "
        "P(reach target | explanation), measured on people. Wilson's interval takes drives for independent, the "
        "cluster interval allows those of a person to depend on each other; the model's share is averaged over "
        "persons, layouts and positions, as if everybody had seen the kind. Whoever left in the middle of a drive "
        "has no drive in the data."
    )
    title = "Share of drives that reached the goal, by kind"
    return [
        introduction,
        _share_table("drives_reached", title, ("Reached", "Drives"), after, fitted),
        _figure("drives_shares", "Drives that reached the goal", "reached the goal", after),
        *_no_model(fitted, "drives"),
        *ratio_blocks("drives_odds", "Odds of reaching the goal", "Odds ratio", odds_of(data, fitted), _ODDS_NOTE),
        *_lower_bounds(data, after),
    ]


def _share_table(
    name: str, title: str, counts: tuple[str, str], measured: Sequence[Outcomes], fitted: dict[str, BinaryFit | str]
) -> Table:
    columns = (
        Column("kind", "Kind"),
        Column("experiment", "Experiment"),
        Column("num", counts[0], "count"),
        Column("total", counts[1], "count"),
        *SHARE_COLUMNS,
        *MARGINAL_COLUMNS,
    )
    rows = tuple(
        (
            kind,
            outcomes.experiment,
            *share_cells(share_of(outcomes.of(kind)["participant"].tolist(), outcomes.of(kind)["right"])),
            *marginal_cells(fitted[outcomes.experiment], kind),
        )
        for outcomes in measured
        for kind in outcomes.kinds
    )
    cluster_low = [column.name for column in columns].index("cluster_low")
    missing = " Without a cluster interval: one person, or people who are all alike."
    note = f"Intervals at 95 %.{missing if any(row[cluster_low] is None for row in rows) else ''}"
    return Table(name, title, columns, rows, note)


def _no_model(fitted: dict[str, BinaryFit | str], what: str) -> list[Block]:
    return [
        Statement(f"The mixed logistic model of {what} in experiment {experiment}", model)
        for experiment, model in fitted.items()
        if isinstance(model, str)
    ]


def _lower_bounds(data: StudyData, after: Sequence[Outcomes]) -> list[Block]:
    """Say what the shares are if whoever left with a drive before them had not reached the goal."""
    try:
        people = whereabouts(data)
    except Unknown as unknown:
        return [Statement("The share with those who left in the middle of a drive", str(unknown))]
    left = Counter(
        person.arm_at_hand
        for person in people
        if (person.has_left or person.is_open) and person.page_kind == "drive" and person.reason in _WITHOUT_FAULT
    )
    if not left:
        return ["Nobody who might be analysed left with a drive before them, so no share is too large for that reason."]
    columns = (
        Column("kind", "Kind"),
        Column("experiment", "Experiment"),
        Column("num", "Reached", "count"),
        Column("total", "Drives", "count"),
        Column("left", "Left", "count"),
        Column("share", "Share", "percent", 0),
        Column("lower_bound", "Lower bound", "percent", 0),
    )
    rows = []
    for outcomes in after:
        for kind in outcomes.kinds:
            num, total = int(outcomes.of(kind)["right"].sum()), len(outcomes.of(kind))
            gone = left[(outcomes.experiment, kind)]
            rows.append((kind, outcomes.experiment, num, total, gone, num / total, num / (total + gone)))
    note = (
        "Left: whose next page was the drive when they left, or when the data were taken if they did not say that they "
        "leave; some of them had not begun it. Lower bound: all of them counted as not reached."
    )
    title = "Share of drives that reached the goal, with those who left"
    return [Table("drives_lower_bounds", title, columns, tuple(rows), note)]


def _pairs_of_drives(data: StudyData, of: Sequence[str]) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yield experiment, kind and its trials with a drive before and one after, where there are some."""
    for experiment in of:
        before, after = drives_of(data, experiment, "before"), drives_of(data, experiment, "after")
        if before is None or after is None:
            continue
        key = ["participant", "trial"]
        joined = after.frame.merge(before.frame[[*key, "right"]], on=key, suffixes=("", "_before"))
        for kind in after.kinds:
            of_kind = joined[joined["kind"] == kind]
            if len(of_kind):
                yield experiment, kind, of_kind


def _gain_blocks(data: StudyData, of: Sequence[str]) -> list[Block]:
    rows = []
    shares = []
    for experiment, kind, trials in _pairs_of_drives(data, of):
        gains = trials["right"].astype(int) - trials["right_before"].astype(int)
        gain = mean_of_several(trials["participant"].tolist(), gains)
        failed = trials[~trials["right_before"]]
        means = (float(trials["right_before"].mean()), float(trials["right"].mean()))
        of_failed = float(failed["right"].mean()) if len(failed) else None
        interval = gain.interval or (None, None)
        rows.append((kind, experiment, len(trials), *means, gain.value, *interval, len(failed), of_failed))
        parts = (("before", trials, "right_before"), ("after", trials, "right"), ("failed, after", failed, "right"))
        shares += [
            (kind, experiment, part, *share_cells(share_of(chosen["participant"].tolist(), chosen[column])))
            for part, chosen, column in parts
            if len(chosen)
        ]
    return [_gain_table(rows), _gain_shares(shares)] if rows else []


def _gain_table(rows: Sequence[tuple[Cell, ...]]) -> Table:
    columns = (
        Column("kind", "Kind"),
        Column("experiment", "Experiment"),
        Column("pairs", "Both drives", "count"),
        Column("before", "Before", "percent", 0),
        Column("after", "After", "percent", 0),
        Column("gain", "Gain", "number"),
        Column("low", "95 % low", "number"),
        Column("high", "high", "number"),
        Column("failed", "Failed before", "count"),
        Column("then_reached", "of these reached after", "percent", 0),
    )
    note = (
        "Gain: the share that reached the goal after the explanation less that before it, over trials with both "
        "drives; interval robust within persons, by Student's t. Whoever reached it before has nothing to gain, and "
        "was told so. Kinds with a drive before give more practice than those without. The next table has the "
        "intervals of the shares."
    )
    return Table("drives_gain", "Gain from before to after the explanation", columns, tuple(rows), note)


def _gain_shares(rows: Sequence[tuple[Cell, ...]]) -> Table:
    columns = (
        Column("kind", "Kind"),
        Column("experiment", "Experiment"),
        Column("part", "Drives"),
        Column("num", "Reached", "count"),
        Column("total", "Drives", "count"),
        *SHARE_COLUMNS,
    )
    note = "Failed, after: those after the explanation of trials in which the drive before failed. Intervals at 95 %."
    return Table("drives_gain_shares", "Shares before and after the explanation", columns, tuple(rows), note)


def _probe_blocks(data: StudyData, probes: Sequence[Outcomes], fitted: dict[str, BinaryFit | str]) -> list[Block]:
    if not probes:
        return [Statement("The predictions", "the data hold no prediction of what the agent does")]
    blocks: list[Block] = [
        _share_table(
            "probes_right",
            "Share of predictions that are what the agent does, by kind",
            ("Right", "Predictions"),
            probes,
            fitted,
        ),
        _figure("probes_shares", "Predictions that are what the agent does", "predicted the agent's action", probes),
        *_no_model(fitted, "predictions"),
        *ratio_blocks("probes_odds", "Odds of a right prediction", "Odds ratio", odds_of(data, fitted), _ODDS_NOTE),
    ]
    good = [
        f"{int(outcomes.frame['as_good'].sum())} of {counted(len(outcomes.frame), 'prediction')} in experiment "
        f"{outcomes.experiment} lead to the goal in as few steps, {int(outcomes.frame['right'].sum())} are the "
        "agent's own"
        for outcomes in probes
    ]
    blocks.append(f"Counting actions that are as good as the agent's: {'; '.join(good)}.")
    return blocks


def _figure(name: str, title: str, words: str, measured: Sequence[Outcomes]) -> Figure:
    shares = [
        (outcomes.experiment, kind, share_of(outcomes.of(kind)["participant"].tolist(), outcomes.of(kind)["right"]))
        for outcomes in measured
        for kind in outcomes.kinds
    ]
    least, most = min(shares, key=lambda each: each[2].value), max(shares, key=lambda each: each[2].value)

    words_of = {GREY: "Wilson (all independent)", BLUE: "Cluster (robust within persons)"}

    def fill(canvas: "Canvas") -> None:
        axes = canvas.subplots()
        for place, (_, _, share) in enumerate(reversed(shares)):
            for interval, offset, colour in ((share.wilson, 0.12, GREY), (share.cluster, -0.12, BLUE)):
                if interval is not None:
                    ends = [100 * end for end in interval]
                    label = words_of[colour] if place == 0 else None
                    axes.plot(ends, [place + offset] * 2, color=colour, linewidth=1.6, label=label)
            axes.plot(100 * share.value, place, "o", color=VERMILION, markersize=4.5)
        several = len(measured) > 1
        axes.set_yticks(
            range(len(shares)),
            [f"{kind} ({experiment})" if several else kind for experiment, kind, _ in reversed(shares)],
        )
        axes.set_xlim(0, 100)
        axes.set_ylim(-0.6, len(shares) - 0.4)
        axes.set_xlabel(f"Share that {words}, in %")
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False, borderaxespad=0.2)

    return Figure(
        name,
        f"{title}, with 95 % intervals",
        f"Shares by kind, from {100 * least[2].value:.0f} % ({least[1]}) to {100 * most[2].value:.0f} % ({most[1]}).",
        (7.2, 1.0 + 0.3 * len(shares)),
        fill,
    )
