"""How reliably a scale measures, where there is one, and how single items go together."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import pandas as pd

from webapp.analysis.censoring import Undefined
from webapp.analysis.correlation import pearson, repeated_measures
from webapp.analysis.reliability import (
    NUM_RESAMPLES,
    Alpha,
    Omega,
    cronbach_alpha,
    mcdonald_omega,
    mean_correlation_interval,
    omega_interval,
)
from webapp.reports.blocks import Assumption, Block, Column, Section, Statement, Table
from webapp.reports.formatting import counted, listed, number
from webapp.reports.kind_outcomes import experiments, kinds_of, stream
from webapp.reports.study_data import StudyData
from webapp.study.experiments import SATISFACTION_ITEMS

SCALE = "Explanation Satisfaction Scale"
_ENOUGH = 30
_LEAST_LOADING = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class _Answers:
    """The scale's items in one experiment after one kind, one row per person."""

    experiment: str
    kind: str
    items: pd.DataFrame


def section(data: StudyData) -> Section:
    """Return the section."""
    answered = list(_answers(data))
    blocks: list[Block] = []
    assumptions: tuple[Assumption, ...] = ()
    if answered:
        scale_blocks, assumptions = _scale(answered)
        blocks += scale_blocks
    else:
        blocks.append(
            Statement(
                "The reliability of a scale",
                f"no scale of several items was asked: {_single_items(data)}. Reliability of a single item cannot be "
                "told from answers given once",
            )
        )
    blocks += _item_blocks(data)
    return Section("reliability", "Reliability of the questionnaire", tuple(blocks), assumptions)


def _single_items(data: StudyData) -> str:
    told = [
        f"experiment {experiment} has {listed([*_items(data, experiment)])}, each an item of its own"
        for experiment in experiments(data)
        if _items(data, experiment)
    ]
    return "; ".join(told) or "there are no ratings"


def _items(data: StudyData, experiment: str) -> tuple[str, ...]:
    """Return the items that are not the scale's, in the order of the plan."""
    asked = set(data.ratings.loc[data.ratings["experiment"] == experiment, "item"]) - set(SATISFACTION_ITEMS)
    planned = [item for item in data.plan.items.get(experiment, ()) if item in asked]
    return (*planned, *sorted(asked - set(planned)))


def _answers(data: StudyData) -> Iterator[_Answers]:
    """Yield the answers by kind, so that a person is in each once, and those of all kinds, averaged per person."""
    rows = data.ratings[data.ratings["item"].isin(SATISFACTION_ITEMS)]
    for experiment in experiments(data):
        of_it = rows[rows["experiment"] == experiment]
        if of_it.empty:
            continue
        for kind in kinds_of(data, experiment, of_it["kind"]):
            yield _Answers(experiment, kind, _wide(of_it[of_it["kind"] == kind]))
        yield _Answers(experiment, "all kinds", _wide(of_it))


def _wide(rows: pd.DataFrame) -> pd.DataFrame:
    means = rows.groupby(["participant", "item"], observed=True)["rating"].mean().astype("float64")
    table = means.unstack("item").sort_index()
    return table[[item for item in SATISFACTION_ITEMS if item in table.columns]].dropna()


def _scale(answered: list[_Answers]) -> tuple[list[Block], tuple[Assumption, ...]]:
    rows = []
    statements: list[Block] = []
    assumptions: list[Assumption] = []
    for each in answered:
        subject = f"of the scale after {each.kind} in experiment {each.experiment}"
        try:
            alpha = cronbach_alpha(each.items.to_numpy())
        except Undefined as undefined:
            statements.append(Statement(f"Alpha {subject}", str(undefined)))
            continue
        omega: Omega | None = None
        try:
            omega = mcdonald_omega(each.items.to_numpy())
        except Undefined as undefined:
            statements.append(Statement(f"Omega {subject}", str(undefined)))
        rows.append((each.kind, each.experiment, *_cells(each, alpha, omega)))
        assumptions += _assumptions(each, alpha, omega)
    columns = (
        Column("kind", "Kind"),
        Column("experiment", "Experiment"),
        Column("people", "People", "count"),
        Column("items", "Items", "count"),
        Column("alpha", "Alpha", "number"),
        Column("low", "95 % low", "number"),
        Column("high", "high", "number"),
        Column("omega", "Omega", "number"),
        Column("omega_low", "95 % low", "number"),
        Column("omega_high", "high", "number"),
        Column("mean_correlation", "Mean r of items", "number"),
        Column("mean_correlation_low", "95 % low", "number"),
        Column("mean_correlation_high", "high", "number"),
    )
    introduction = (
        f"The {SCALE} was asked after each explanation. Reliability is told for each kind, so that every person is in "
        "a row once and people are independent, and for the person's means over all kinds, which hold less error. "
        "Whoever left an item out is not in the row."
    )
    note = (
        "Alpha: Cronbach's with Feldt's interval. Omega: McDonald's, of one factor by maximum likelihood. "
        f"Intervals of omega and of the mean correlation: percentile bootstrap over people ({NUM_RESAMPLES} "
        "resamples). The rows are of the same people."
    )
    table: list[Block] = (
        [Table("reliability", f"Reliability of the {SCALE}", columns, tuple(rows), note)] if rows else []
    )
    return [introduction, *table, *statements], tuple(assumptions)


def _cells(each: _Answers, alpha: Alpha, omega: Omega | None) -> tuple[float | int | None, ...]:
    told = (alpha.num_people, alpha.num_items, alpha.value, alpha.low, alpha.high)
    items, named = each.items.to_numpy(), f"{each.experiment}/{each.kind}"
    of_mean = mean_correlation_interval(items, stream(f"mean correlation/{named}")) or (None, None)
    if omega is None:
        return (*told, None, None, None, alpha.mean_correlation, *of_mean)
    of_omega = omega_interval(items, stream(f"omega/{named}")) or (None, None)
    return (*told, omega.value, *of_omega, alpha.mean_correlation, *of_mean)


def _assumptions(each: _Answers, alpha: Alpha, omega: Omega | None) -> list[Assumption]:
    named = f"after {each.kind} in experiment {each.experiment}"
    found = [
        Assumption(
            f"Cronbach's alpha {named}",
            "Items measure one thing equally well and people are many; answers are normal for Feldt's interval.",
            f"{counted(alpha.num_people, 'person', 'people')}; "
            + ("loadings are unknown." if omega is None else f"loadings from {_range(omega)}, which should be alike."),
            "doubtful"
            if alpha.num_people < _ENOUGH or omega is None or min(omega.loadings) < _LEAST_LOADING
            else "holds",
        )
    ]
    if omega is not None:
        proper = (
            "no item's uniqueness is at its bound" if not omega.is_improper else "an item's uniqueness is at its bound"
        )
        is_sound = not omega.is_improper and min(omega.loadings) >= _LEAST_LOADING
        found.append(
            Assumption(
                f"McDonald's omega {named}",
                "One factor is behind all items.",
                f"Loadings from {_range(omega)} ({number(_LEAST_LOADING)} is the least that is common); {proper}.",
                "holds" if is_sound else "doubtful",
            )
        )
    return found


def _range(omega: Omega) -> str:
    return f"{number(min(omega.loadings))} to {number(max(omega.loadings))}"


def _item_blocks(data: StudyData) -> list[Block]:
    columns = (
        Column("items", "Items"),
        Column("experiment", "Experiment"),
        Column("people", "People", "count"),
        *(
            Column(*each, "number")
            for each in (("between", "r between"), ("between_low", "low"), ("between_high", "high"))
        ),
        *(Column(*each, "number") for each in (("within", "r within"), ("within_low", "low"), ("within_high", "high"))),
    )
    rows = []
    statements: list[Block] = []
    for experiment in experiments(data):
        for first, second in combinations(_items(data, experiment), 2):
            cells, reasons = _pair(data, experiment, first, second)
            if any(cell is not None for cell in cells[1:]):
                rows.append((f"{first}, {second}", experiment, *cells))
            subject = f"of {first} and {second} in experiment {experiment}"
            statements += [Statement(f"The correlation {part} {subject}", reason) for part, reason in reasons]
    note = (
        "Between: of people's means over their trials. Within: of deviations from these means (Bakdash and Marusich "
        "2017). For information: the items ask different things, and their sum is no scale."
    )
    title = "How single items go together"
    return [*([Table("reliability_items", title, columns, tuple(rows), note)] if rows else []), *statements]


def _pair(
    data: StudyData, experiment: str, first: str, second: str
) -> tuple[tuple[int | float | None, ...], list[tuple[str, str]]]:
    rows = data.ratings[(data.ratings["experiment"] == experiment) & data.ratings["item"].isin((first, second))]
    ratings = rows.groupby(["participant", "trial", "item"], observed=True)["rating"].mean().astype("float64")
    both = ratings.unstack("item").reindex(columns=[first, second]).dropna().reset_index()
    means = both.groupby("participant")[[first, second]].mean()
    reasons: list[tuple[str, str]] = []
    cells: list[int | float | None] = [len(means)]
    for part, people in (("between persons", None), ("within persons", both["participant"].tolist())):
        try:
            if people is None:
                found = pearson(means[first], means[second]).value
            else:
                found = repeated_measures(both[first], both[second], people).value
        except Undefined as undefined:
            reasons.append((part, str(undefined)))
            cells += [None, None, None]
            continue
        cells += [found.value, found.low, found.high]
    return tuple(cells), reasons
