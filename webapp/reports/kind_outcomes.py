"""Outcomes that are right or wrong, and how kinds compare on them: what sections on drives and probes share."""

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from webapp.analysis.binary_outcomes import BinaryFit, Ratio, fit_binary
from webapp.analysis.censoring import Undefined
from webapp.analysis.multiplicity import holm
from webapp.analysis.shares import Share
from webapp.reports.blocks import Assumption, Block, Column, Statement, Table, Verdict
from webapp.reports.formatting import counted
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Contrast

INTERVAL = (Column("low", "95 % low", "number"), Column("high", "high", "number"))
_FEWEST_EVENTS, _ENOUGH_EVENTS = 5, 10
_FEWEST_PEOPLE, _ENOUGH_PEOPLE = 8, 20


@dataclass(frozen=True, slots=True, eq=False)
class Outcomes:
    """Outcomes of one measure in one experiment.

    Attributes:
        experiment: Its id.
        kinds: In the order of the study.
        frame: One row per outcome: `participant, kind, layout, trial, right` and more.
    """

    experiment: str
    kinds: tuple[str, ...]
    frame: pd.DataFrame

    def of(self, kind: str) -> pd.DataFrame:
        """Return the rows of a kind."""
        return self.frame[self.frame["kind"] == kind]


def stream(name: str) -> np.random.Generator:
    """Return the random numbers of one thing in the report, the same in every run."""
    return np.random.default_rng([2021, zlib.crc32(name.encode())])


def experiments(data: StudyData) -> tuple[str, ...]:
    """Return the ids of the experiments there are data of, in the order of the study."""
    tables = [table for table in (data.ratings, data.drives, data.probes) if table is not None]
    seen = {str(each) for table in tables for each in table["experiment"].dropna().unique()}
    declared = [experiment.id for experiment in data.declared.experiments] if data.declared is not None else []
    return (*(each for each in declared if each in seen), *sorted(seen - set(declared)))


def kinds_of(data: StudyData, experiment: str, seen: Iterable[str]) -> tuple[str, ...]:
    """Return the kinds that occur, in the order in which the study declares them, or else sorted."""
    there = set(seen)
    declared: Sequence[str] = ()
    if data.declared is not None:
        declared = next((each.kinds for each in data.declared.experiments if each.id == experiment), ())
    return (*(kind for kind in declared if kind in there), *sorted(there - set(declared)))


def drives_of(data: StudyData, experiment: str, phase: str) -> Outcomes | None:
    """Return the drives of a phase with `right` if the goal was reached, `steps` and `limit` over the optimum.

    None where there are none.
    """
    table = data.drives
    if table is None:
        return None
    rows = table[(table["experiment"] == experiment) & (table["phase"] == phase)].reset_index(drop=True)
    if rows.empty:
        return None
    optimum = rows["optimum"].astype("float64")
    frame = _basic(rows).assign(
        right=(rows["end"] == "reached").astype(bool),
        end=rows["end"],
        steps=rows["num_steps"].astype("float64") / optimum,
        limit=rows["step_limit"].astype("float64") / optimum,
    )
    return Outcomes(experiment, kinds_of(data, experiment, frame["kind"]), frame)


def probes_of(data: StudyData, experiment: str) -> Outcomes | None:
    """Return the predictions with `right` if it is the agent's action, and `as_good` and `confidence`."""
    table = data.probes
    if table is None:
        return None
    rows = table[table["experiment"] == experiment].reset_index(drop=True)
    if rows.empty:
        return None
    frame = _basic(rows).assign(
        right=rows["is_correct"].astype(bool),
        as_good=rows["is_as_good"].fillna(value=False).astype(bool),
        confidence=rows["confidence"].astype("float64"),
    )
    return Outcomes(experiment, kinds_of(data, experiment, frame["kind"]), frame)


def holm_over(p_values: Sequence[float | None]) -> list[float | None]:
    """Adjust for all tests of a family, also those that could not be made, which count as 1 and stay None."""
    adjusted = holm([1.0 if p_value is None else p_value for p_value in p_values])
    return [None if given is None else float(p) for given, p in zip(p_values, adjusted, strict=True)]


def models(measured: Sequence[Outcomes]) -> dict[str, BinaryFit | str]:
    """Fit the mixed logistic model of each experiment; a reason in words where there is none."""
    found: dict[str, BinaryFit | str] = {}
    for outcomes in measured:
        try:
            found[outcomes.experiment] = fit_binary(outcomes.frame)
        except Undefined as undefined:
            found[outcomes.experiment] = str(undefined)
    return found


def share_cells(share: Share) -> tuple[float | int | None, ...]:
    """Return count, total, people, share, Wilson's interval and the cluster interval."""
    cluster = share.cluster or (None, None)
    return (share.num, share.total, share.num_people, share.value, *share.wilson, *cluster)


SHARE_COLUMNS = (
    Column("people", "People", "count"),
    Column("share", "Share", "percent", 0),
    Column("wilson_low", "Wilson low", "percent", 0),
    Column("wilson_high", "high", "percent", 0),
    Column("cluster_low", "Cluster low", "percent", 0),
    Column("cluster_high", "high", "percent", 0),
)
"""What follows the two counts of `share_cells`."""

MARGINAL_COLUMNS = (
    Column("model_share", "Model", "percent", 0),
    Column("model_low", "low", "percent", 0),
    Column("model_high", "high", "percent", 0),
)


def marginal_cells(model: BinaryFit | str, kind: str) -> tuple[float | None, float | None, float | None]:
    """Return the average probability of a kind and its interval, where the model has it."""
    if isinstance(model, str):
        return None, None, None
    try:
        return model.probability(kind)
    except Undefined:
        return None, None, None


def ratio_blocks(
    name: str, title: str, heading: str, found: Sequence[tuple[Contrast, Ratio | str]], note: str
) -> list[Block]:
    """Return a table of ratios, adjusted as one family, and statements for those that could not be computed.

    Args:
        name: Of the table.
        title: Of the table.
        heading: What the ratio is.
        found: By contrast, the ratio or why there is none.
        note: Below the table.
    """
    adjusted = holm_over([ratio.p_value if isinstance(ratio, Ratio) else None for _, ratio in found])
    columns = (
        Column("contrast", "First \N{MINUS SIGN} second"),
        Column("experiment", "Experiment"),
        Column("ratio", heading, "number"),
        *INTERVAL,
        Column("t", "t", "number"),
        Column("df", "df", "count"),
        Column("p", "p", "p"),
        Column("p_holm", "p (Holm)", "p"),
    )
    rows = tuple(
        (
            str(contrast),
            contrast.experiment,
            ratio.value,
            ratio.low,
            ratio.high,
            ratio.t,
            ratio.df,
            ratio.p_value,
            p_holm,
        )
        for (contrast, ratio), p_holm in zip(found, adjusted, strict=True)
        if isinstance(ratio, Ratio)
    )
    blocks: list[Block] = [Table(name, title, columns, rows, note)] if rows else []
    subject = f"{heading} of"
    blocks += [
        Statement(f"{subject} {contrast} in experiment {contrast.experiment}", reason)
        for contrast, reason in found
        if isinstance(reason, str)
    ]
    return blocks


def odds_of(data: StudyData, fitted: dict[str, BinaryFit | str]) -> list[tuple[Contrast, Ratio | str]]:
    """Return the odds ratio of every planned contrast of the experiments that were measured."""
    found: list[tuple[Contrast, Ratio | str]] = []
    for contrast in data.plan.contrasts:
        model = fitted.get(contrast.experiment)
        if model is None:
            continue
        if isinstance(model, str):
            found.append((contrast, model))
            continue
        try:
            found.append((contrast, model.odds_ratio(contrast.first, contrast.second)))
        except Undefined as undefined:
            because = f" ({'; '.join(model.left_out)})" if model.left_out else ""
            found.append((contrast, f"{undefined}{because}"))
    return found


def logistic_assumptions(test: str, model: BinaryFit | str) -> list[Assumption]:
    """Say what the mixed logistic model takes for granted; nothing where there is none."""
    if isinstance(model, str):
        return []
    fit, num_effects = model.fit, max(1, len(model.columns.names))
    events = min(model.num_right, fit.num_ratings - model.num_right)
    per_effect = events / num_effects
    return [
        Assumption(
            test,
            "There are enough outcomes of the rarer sort for each effect, so that Wald's intervals hold.",
            f"{counted(events, 'outcome')} of the rarer sort for {counted(num_effects, 'effect')}: {per_effect:.1f} "
            f"each ({_ENOUGH_EVENTS} are enough, below {_FEWEST_EVENTS} are too few).",
            _verdict(per_effect),
        ),
        Assumption(
            test,
            "Persons differ by normal intercepts, and effects add up on the logit.",
            f"The intercepts' standard deviation is {fit.sd:.2f} on the logit; {fit.num_ratings / fit.num_people:.1f} "
            f"outcomes per person cannot show their shape.{_left_out(model)}",
            "not checkable",
        ),
        Assumption(test, "People do not influence each other.", "Each takes part alone, once.", "by design"),
    ]


def enough_people(test: str, num_people: Iterable[int]) -> list[Assumption]:
    """Say whether there are enough people for intervals that are robust within persons; nothing without any interval.

    Args:
        test: What has the intervals.
        num_people: Of each interval.
    """
    counts = sorted(num_people)
    if not counts:
        return []
    fewest = counts[0]
    return [
        Assumption(
            test,
            "There are enough people for intervals that are robust within persons.",
            f"From {counts[0]} to {counted(counts[-1], 'person', 'people')} per interval, by Student's t with people "
            f"less one ({_ENOUGH_PEOPLE} are enough, below {_FEWEST_PEOPLE} too few).",
            "holds" if fewest >= _ENOUGH_PEOPLE else "doubtful" if fewest >= _FEWEST_PEOPLE else "violated",
        )
    ]


def contrasts_of(data: StudyData, experiment: str) -> list[Contrast]:
    """Return the planned contrasts of an experiment."""
    return [contrast for contrast in data.plan.contrasts if contrast.experiment == experiment]


def _left_out(model: BinaryFit) -> str:
    told = ""
    if model.columns.aliased:
        told += f" Left out since others determine them: {', '.join(model.columns.aliased)}."
    if model.left_out:
        told += f" Left out since all outcomes are alike: {'; '.join(model.left_out)}."
    return told


def _verdict(per_effect: float) -> Verdict:
    return "holds" if per_effect >= _ENOUGH_EVENTS else "doubtful" if per_effect >= _FEWEST_EVENTS else "violated"


def _basic(rows: pd.DataFrame) -> pd.DataFrame:
    found = rows[["participant", "kind", "layout", "trial"]].copy()
    return found.assign(trial=found["trial"].astype("int64"))
