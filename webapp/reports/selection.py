"""What of a data set is analysed: one version of a study in one mode, without whom the rules leave out, corrected.

Exclusions are decided first, by what cannot tell anybody's kinds of explanation; only then are kinds looked at.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import pandas as pd

from webapp.reports.read_chosen import chosen_tables
from webapp.reports.read_corrections import Correction, apply_corrections
from webapp.reports.read_declared import Declaration, points_of
from webapp.reports.read_exclusions import Decided, decide
from webapp.reports.read_notes import notes_of
from webapp.reports.reading import DataSet
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Plan, plan_of, plan_without
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.quality import RULES

_RATINGS = ("participant", "experiment", "trial", "layout", "kind", "draw", "item", "rating", "response_time_ms")
_EVERYBODY = (
    "participant",
    "consented_at",
    "completed_at",
    "withdrawn_at",
    "screened_out_at",
    "num_pages_sent",
    "assignment",
)
_ENDED = ("withdrawn_at", "screened_out_at")


RULES_ON_TIMES = frozenset({"min_total_minutes", "min_seconds_per_rating_page"})
"""Rules that every bot breaks, because bots do not wait; they are not applied to them."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What is asked for otherwise than planned.

    Attributes:
        include_incomplete: Whether those are analysed too who did not complete the study.
        apply_rules: Whether whoever a declared rule flags is left out.
        apply_exclusions: Whether whoever a researcher excluded is left out.
        apply_corrections: Whether researchers' corrections are made.
        skip_rules: Rules that are not applied.
    """

    include_incomplete: bool = False
    apply_rules: bool = True
    apply_exclusions: bool = True
    apply_corrections: bool = True
    skip_rules: Collection[str] = field(default_factory=frozenset)


@dataclass(frozen=True, slots=True)
class Selection:
    """What was chosen, and how.

    Attributes:
        data: What is analysed.
        wishes: What was asked for otherwise than planned.
        decided: Why the others are not analysed.
        rules: The rules that were applied, in their order.
        corrections: Those that were made, and those that could not be; empty if none were to be made.
        allocation: Of `allocation.csv`, None without the file.
        notes: What whoever reads the report should know, as sentences.
    """

    data: StudyData
    wishes: Wishes
    decided: Decided
    rules: tuple[str, ...]
    corrections: tuple[Correction, ...]
    allocation: pd.DataFrame | None
    notes: tuple[str, ...]


def choose(  # noqa: PLR0913 - one argument for each wish, by name.
    data_set: DataSet,
    study: str | None = None,
    version: str | None = None,
    mode: str | None = None,
    *,
    include_incomplete: bool = False,
    apply_rules: bool = True,
    apply_exclusions: bool = True,
    apply_corrections: bool = True,
    skip_rules: Collection[str] = (),
) -> StudyData:
    """Choose what is analysed; see `select`, which also tells how, and `Wishes`.

    Raises:
        DataSetError: There are no such data, or those of several studies or versions.
    """
    wishes = Wishes(include_incomplete, apply_rules, apply_exclusions, apply_corrections, skip_rules)
    return select(data_set, study, version, mode, wishes).data


def select(
    data_set: DataSet,
    study: str | None = None,
    version: str | None = None,
    mode: str | None = None,
    wishes: Wishes | None = None,
) -> Selection:
    """Choose what is analysed.

    Args:
        data_set: Where from.
        study: The study's name; may be left out where there is only one.
        version: The version, or how its hash begins; likewise.
        mode: `live`, `test` or `bot`; live ones if left out.
        wishes: What is asked for otherwise than planned.

    Raises:
        DataSetError: There are no such data, or those of several studies or versions.
    """
    wishes = wishes or Wishes()
    scope, tables = chosen_tables(data_set.tables, study, version, mode)
    declaration = data_set.declaration(scope.study, scope.study_version)
    points = _points(data_set, declaration, tables["ratings"])
    rules = _rules(tables.get("quality"), wishes)
    timed = RULES_ON_TIMES.intersection(rules) if scope.mode == "bot" else frozenset()
    rules = tuple(rule for rule in rules if rule not in timed)
    decided = decide(
        _people(tables),
        _flags(tables.get("quality")),
        rules,
        apply_exclusions=wishes.apply_exclusions,
        include_incomplete=wishes.include_incomplete,
    )
    corrections: tuple[Correction, ...] = ()
    declared = None if declaration is None else declaration.study
    if wishes.apply_corrections:
        tables, corrections = apply_corrections(tables, declared, points)
    kept = {name: _of(table, decided.analysed) for name, table in tables.items()}
    everybody = tables.get("participants")
    data = StudyData(
        study=scope.study,
        study_version=scope.study_version,
        mode=scope.mode,
        ratings=kept["ratings"][list(_RATINGS)],
        participants=kept.get("participants", pd.DataFrame({"participant": sorted(decided.analysed)}, dtype="str")),
        everybody=None if everybody is None else _everybody(everybody, decided),
        answers=kept.get("answers"),
        probes=kept.get("probes"),
        drives=kept.get("drives"),
        declared=declared,
        wordings=data_set.described.wordings,
        points=points,
        plan=_plan(declaration, tables["ratings"]),
    )
    told = f"Bots do not wait, so these rules are not applied to them: {', '.join(sorted(timed))}."
    notes = (
        *data_set.notes,
        *([told] if timed else []),
        *notes_of(tables, declared, decided, rules, corrections, include_incomplete=wishes.include_incomplete),
    )
    return Selection(data, wishes, decided, rules, corrections, tables.get("allocation"), notes)


def _people(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return everybody, with whether they completed the study and whether a researcher excluded them."""
    people = tables.get("participants")
    if people is None:
        trials = tables["ratings"].drop_duplicates(["participant", "experiment", "trial"])
        counts = trials.groupby("participant", sort=True).size()
        complete = (counts == counts.max()).to_numpy()
        return pd.DataFrame({"participant": counts.index, "is_complete": complete, "is_excluded": False})
    has_ended = people[list(_ENDED)].notna().any(axis=1)
    return pd.DataFrame(
        {
            "participant": people["participant"],
            "is_complete": people["completed_at"].notna() & ~has_ended,
            "is_excluded": people["excluded_at"].notna(),
        }
    )


def _flags(quality: pd.DataFrame | None) -> pd.DataFrame:
    if quality is None:
        return pd.DataFrame({"participant": [], "rule": []}, dtype="str")
    return quality.loc[quality["flagged"], ["participant", "rule"]]


def _rules(quality: pd.DataFrame | None, wishes: Wishes) -> tuple[str, ...]:
    """Return the rules to apply: those by which somebody was judged, in the order of the study file's section."""
    if quality is None or not wishes.apply_rules:
        return ()
    judged = set(quality["rule"])
    ordered = [*(rule for rule in RULES if rule in judged), *sorted(judged - set(RULES))]
    return tuple(rule for rule in ordered if rule not in wishes.skip_rules)


def _of(table: pd.DataFrame, people: pd.Index) -> pd.DataFrame:
    return table[table["participant"].isin(people)].reset_index(drop=True)


def _everybody(people: pd.DataFrame, decided: Decided) -> pd.DataFrame:
    reasons = decided.reasons.loc[people["participant"]].to_numpy()
    return people[list(_EVERYBODY)].assign(reason=pd.Series(reasons, dtype="str"))


def _points(data_set: DataSet, declaration: Declaration | None, ratings: pd.DataFrame) -> Mapping[tuple[str, str], int]:
    asked = {
        (str(experiment), str(item))
        for experiment, item in ratings[["experiment", "item"]].drop_duplicates().to_numpy()
    }
    for experiment in () if declaration is None else declaration.study.experiments:
        own = SATISFACTION_ITEMS if experiment.satisfaction else ()
        asked |= {(experiment.id, item) for item in (*(item.id for item in experiment.items), *own)}
    found = {key: points_of(declaration, *key, data_set.described) for key in sorted(asked)}
    return {key: points for key, points in found.items() if points is not None}


def _plan(declaration: Declaration | None, ratings: pd.DataFrame) -> Plan:
    if declaration is not None:
        return plan_of(declaration.study, declaration.plan)
    of_experiment = ratings.groupby("experiment", sort=True)
    asked = {(str(key[0]), str(key[1])): set(items) for key, items in ratings.groupby(["experiment", "kind"])["item"]}
    return plan_without(
        {str(name): set(rows["kind"]) for name, rows in of_experiment},
        {str(name): set(rows["item"]) for name, rows in of_experiment},
        asked,
    )
