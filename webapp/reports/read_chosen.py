"""Which of the studies, versions and modes of a data set is analysed."""

from collections.abc import Mapping
from typing import cast

import pandas as pd

from webapp.reports.read_problems import DataSetError
from webapp.reports.read_scope import SCOPE
from webapp.storage.scope import Mode, Scope

_SHOWN = 12
_ORDER = {
    "ratings": ["participant", "experiment", "trial", "item"],
    "participants": ["participant"],
    "answers": ["participant", "experiment", "trial", "purpose", "question", "attempt"],
    "probes": ["participant", "experiment", "trial", "question"],
    "drives": ["participant", "experiment", "trial", "phase"],
    "quality": ["participant", "rule"],
    "allocation": ["record", "experiment"],
    "decisions": ["record"],
}


def chosen_tables(
    tables: Mapping[str, pd.DataFrame], study: str | None, version: str | None, mode: str | None
) -> tuple[Scope, dict[str, pd.DataFrame]]:
    """Choose the rows of one version of a study in one mode.

    Args:
        tables: All tables.
        study: The study's name, None if only one is there.
        version: The version, or how its hash begins; None if only one is there.
        mode: The mode; live ones if None.

    Returns:
        Whose rows they are, and the rows, sorted and with a plain index.

    Raises:
        DataSetError: There are none, or those of several.
    """
    people = _people(tables)
    there = "; ".join(_said(scope, count) for scope, count in people.items())
    wanted_mode = "live" if mode is None else mode
    fitting = [
        scope
        for scope in people
        if study in (None, scope.study) and scope.study_version.startswith(version or "") and scope.mode == wanted_mode
    ]
    if not fitting:
        asked, option = _missing(people, study, version, wanted_mode)
        raise DataSetError([f"there are no data of {asked}; there are: {there}; choose another with {option}"])
    if len(fitting) > 1:
        several = "; ".join(_said(scope, people[scope]) for scope in fitting)
        option = "--study" if len({scope.study for scope in fitting}) == len(fitting) else "--version"
        raise DataSetError([f"there are data of several: {several}; choose one with {option}"])
    (scope,) = fitting
    return scope, {name: _of_scope(name, table, scope) for name, table in tables.items()}


def _missing(people: Mapping[Scope, int], study: str | None, version: str | None, mode: str) -> tuple[str, str]:
    """Return what there are no data of, and the option that asked for it."""
    of_study = [scope for scope in people if study in (None, scope.study)]
    if not of_study:
        return f"a study {study!r}", "--study"
    if not any(scope.study_version.startswith(version or "") for scope in of_study):
        return f"a version that begins with {version!r}", "--version"
    return " ".join(filter(None, (study, version, f"mode {mode}"))), "--mode"


def _people(tables: Mapping[str, pd.DataFrame]) -> dict[Scope, int]:
    """Count the participants of each version and mode, live ones first."""
    key = [*SCOPE, "participant"]
    having = [tables[name][key] for name in ("ratings", "participants") if name in tables]
    counts = pd.concat(having).drop_duplicates().groupby(list(SCOPE), sort=True).size()
    scopes = {Scope(str(one), str(other), cast("Mode", mode)): int(n) for (one, other, mode), n in counts.items()}
    order = {mode: place for place, mode in enumerate(("live", "test", "bot"))}
    return dict(sorted(scopes.items(), key=lambda each: (each[0].study, each[0].study_version, order[each[0].mode])))


def _said(scope: Scope, count: int) -> str:
    who = "participant" if count == 1 else "participants"
    named = " ".join(filter(None, (scope.study, scope.study_version[:_SHOWN])))
    return f"{named} mode {scope.mode} ({count} {who})".strip()


def _of_scope(name: str, table: pd.DataFrame, scope: Scope) -> pd.DataFrame:
    kept = table[
        (table["study"] == scope.study)
        & (table["study_version"] == scope.study_version)
        & (table["mode"] == scope.mode)
    ]
    return kept.sort_values(_ORDER[name], kind="stable").reset_index(drop=True)
