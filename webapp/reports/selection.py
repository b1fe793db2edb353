"""What of a data set is analysed: one version of a study in one mode, without whom the rules leave out, corrected.

Exclusions are decided first, by what cannot tell anybody's kinds of explanation; only then are kinds looked at.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd

from webapp.reports.read_checks import largest_ratings
from webapp.reports.read_chosen import chosen_tables
from webapp.reports.read_corrections import Correction, apply_corrections
from webapp.reports.read_declared import Declaration
from webapp.reports.read_exclusions import Decided, decide
from webapp.reports.read_folder import DataFiles
from webapp.reports.read_notes import differences_of, notes_of
from webapp.reports.reading import DataSet
from webapp.reports.study_data import StudyData
from webapp.storage.scope import Scope
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
_ANSWERED = ("ratings", "probes", "drives")


RULES_ON_TIMES = frozenset({"min_total_minutes", "min_seconds_per_rating_page"})
"""Rules that every bot breaks, because bots do not wait; they are not applied to them."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What is asked for otherwise than planned.

    Attributes:
        include_incomplete: Whether those are analysed too who did not complete the study, if they rated anything.
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
        files: What the files of the data set are called, and how they differ from the export.
        differences: In which ways files and choice of people differ from the export and the declared rules.
    """

    data: StudyData
    wishes: Wishes
    decided: Decided
    rules: tuple[str, ...]
    corrections: tuple[Correction, ...]
    allocation: pd.DataFrame | None
    notes: tuple[str, ...]
    files: DataFiles
    differences: tuple[str, ...] = ()


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
    points, guess = _points(data_set, scope, tables["ratings"])
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
        tables, corrections = apply_corrections(tables, declared, points, data_set.files.name_of)
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
        *guess,
        *([told] if timed else []),
        *notes_of(
            _without(tables, timed),
            declared,
            decided,
            rules,
            corrections,
            data_set.files,
            include_incomplete=wishes.include_incomplete,
        ),
    )
    differences = tuple(differences_of(tables, declared, decided, corrections, data_set.files))
    return Selection(
        data, wishes, decided, rules, corrections, tables.get("allocation"), notes, data_set.files, differences
    )


def _without(tables: Mapping[str, pd.DataFrame], rules: Collection[str]) -> Mapping[str, pd.DataFrame]:
    """Return the tables without the verdicts of some rules, of which the notes say something else."""
    if not rules:
        return tables
    quality = tables["quality"]
    return {**tables, "quality": quality[~quality["rule"].isin(list(rules))]}


def _people(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return everybody, with whether they completed the study, were excluded by a researcher, and answered anything."""
    people = tables.get("participants")
    if people is None:
        trials = tables["ratings"].drop_duplicates(["participant", "experiment", "trial"])
        counts = trials.groupby("participant", sort=True).size()
        complete = (counts == counts.max()).to_numpy()
        found = {"participant": counts.index, "is_complete": complete, "is_excluded": False}
        return pd.DataFrame(found | {"has_rated": True, "has_answered": True})
    has_ended = people[list(_ENDED)].notna().any(axis=1)
    return pd.DataFrame(
        {
            "participant": people["participant"],
            "is_complete": people["completed_at"].notna() & ~has_ended,
            "is_excluded": people["excluded_at"].notna(),
            "has_rated": _is_in(people, [tables["ratings"]]),
            "has_answered": _is_in(people, [tables[name] for name in _ANSWERED if name in tables]),
        }
    )


def _is_in(people: pd.DataFrame, tables: Sequence[pd.DataFrame]) -> pd.Series:
    """Tell of each person whether any of the tables has a row of theirs."""
    return people["participant"].isin(pd.concat([table["participant"] for table in tables]))


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


def _points(
    data_set: DataSet, scope: Scope, ratings: pd.DataFrame
) -> tuple[Mapping[tuple[str, str], int], tuple[str, ...]]:
    """Return the points of each item's scale, and what is to be said if they are taken from the ratings."""
    asked = {
        (str(experiment), str(item))
        for experiment, item in ratings[["experiment", "item"]].drop_duplicates().to_numpy()
    }
    declaration = data_set.declaration(scope.study, scope.study_version)
    for declared in () if declaration is None else declaration.study.experiments:
        own = SATISFACTION_ITEMS if declared.satisfaction else ()
        asked |= {(declared.id, item) for item in (*(item.id for item in declared.items), *own)}
    largest = largest_ratings(ratings, ["item"])
    found: dict[tuple[str, str], int] = {}
    taken: dict[int, set[str]] = {}
    for experiment, item in sorted(asked):
        points, is_known = data_set.scale(scope.study, scope.study_version, experiment, item, largest.get(item, 0))
        if points is not None:
            found[experiment, item] = points
            if not is_known:
                taken.setdefault(points, set()).add(item)
    return found, _told_points(taken)


def _told_points(taken: Mapping[int, Collection[str]]) -> tuple[str, ...]:
    if not taken:
        return ()
    told = "; ".join(f"{points} points for {', '.join(sorted(items))}" for points, items in sorted(taken.items()))
    return (f"There is no study file, so scales have the points of the largest rating, at least 5: {told}.",)


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
