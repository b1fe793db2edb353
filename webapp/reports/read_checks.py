"""What the rows of a table say together: nothing twice, one kind in each trial, ratings within their scales."""

from collections.abc import Callable, Sequence

import pandas as pd

from webapp.reports.read_columns import Form
from webapp.reports.read_faults import Faults
from webapp.reports.read_problems import shown
from webapp.reports.read_scope import SCOPE

_ENDINGS = ("completed_at", "withdrawn_at", "screened_out_at")

ScaleOf = Callable[[str, str, str, str, int], tuple[int | None, bool]]
"""Tells the points of a scale by study, version, experiment, item and the item's largest rating, and whether they are
known and not taken from that rating; None if the study does not ask the item there."""


def check_rows(name: str, form: Form, table: pd.DataFrame, faults: Faults) -> None:
    """Note what is wrong with a table by itself."""
    key = [*SCOPE, *form.key]
    if form.key:
        _note_repeated(table, key, form.key, faults)
    if name in {"ratings", "probes"}:
        for column in ("kind", "layout"):
            _note_changing(table, column, faults)
    if name == "participants":
        _note_impossible_times(table, faults)


def check_ratings(table: pd.DataFrame, scale_of: ScaleOf, faults: Faults) -> None:
    """Note ratings beyond the points of their scale, and items that the study file does not have."""
    columns = ["study", "study_version", "experiment", "item"]
    largest = largest_ratings(table, ["study", "study_version", "item"])
    for key, rows in table.groupby(columns, sort=True)["rating"]:
        study, version, experiment, item = key
        limit, is_known = scale_of(study, version, experiment, item, largest[study, version, item])
        if limit is None:
            wish = f"the study file does not ask it in experiment {shown(key[2])}"
            faults.of_cells(rows.index[:1].to_list(), "item", wish)
        else:
            outside = rows.index[rows > limit].to_list()
            why = "" if is_known else f"; no study file is beside it, and no scale has more than {limit} points"
            faults.of_cells(outside, "rating", f"use a whole number from 1 to {limit}{why}")


def largest_ratings(table: pd.DataFrame, columns: Sequence[str]) -> dict[object, int]:
    """Return the largest rating by the values of some columns."""
    return {key: int(most) for key, most in table.groupby(list(columns))["rating"].max().items()}


def check_kinds(table: pd.DataFrame, declared: Callable[[str, str, str], Sequence[str] | None], faults: Faults) -> None:
    """Note kinds that the study file does not have, once for each.

    Args:
        table: The ratings.
        declared: Tells the kinds by study, version and experiment; None where nothing is declared.
        faults: What is noted.
    """
    columns = ["study", "study_version", "experiment", "kind"]
    for row, (study, version, experiment, kind) in table[columns].drop_duplicates().iterrows():
        kinds = declared(study, version, experiment)
        if kinds is not None and kind not in kinds:
            wish = f"the kinds of experiment {shown(experiment)} in the study file are {', '.join(kinds)}"
            faults.of_cells([int(str(row))], "kind", wish)


def check_known(table: pd.DataFrame, known: pd.DataFrame, faults: Faults, file: str) -> None:
    """Note rows of participants who are not in `participants.csv`, once for each of them."""
    columns = [*SCOPE, "participant"]
    there = pd.MultiIndex.from_frame(known[columns])
    strange = table[~pd.MultiIndex.from_frame(table[columns]).isin(there) & table["participant"].notna()]
    rows = strange.drop_duplicates(columns).index.to_list()
    faults.of_cells(rows, "participant", f"{file} has nobody of that name, study, version and mode; add the row there")


def _note_repeated(table: pd.DataFrame, key: Sequence[str], told: Sequence[str], faults: Faults) -> None:
    repeated = table.index[table.duplicated(list(key))]
    if repeated.empty:
        return
    first = _first_rows(table, key)
    for row in faults.first(list(repeated)):
        what = ", ".join(
            f"{name} {shown(_plain(table[name].iat[row]))}" for name in told if pd.notna(table[name].iat[row])
        )
        faults.of_row(row, f"repeats {{line}}: {what}; keep one", int(first.iat[row]))


def _note_changing(table: pd.DataFrame, column: str, faults: Faults) -> None:
    """Note trials of one participant with two kinds or two layouts."""
    trial = [*SCOPE, "participant", "experiment", "trial"]
    first = _first_rows(table, trial)
    before = table[column].take(first.to_numpy()).reset_index(drop=True)
    differing = table[table[column] != before].drop_duplicates([*trial, column])
    for row in faults.first(list(differing.index)):
        who, experiment, number = (shown(_plain(table[name].iat[row])) for name in trial[-3:])
        told = f"trial {number} of experiment {experiment} of participant {who} has the {column}"
        here, there = shown(table[column].iat[row]), shown(before.iat[row])
        faults.of_row(row, f"{told} {here}, and {there} on {{line}}; a trial has one {column}", int(first.iat[row]))


def _first_rows(table: pd.DataFrame, key: Sequence[str]) -> pd.Series:
    """Return for each row the first row that is like it in some columns."""
    rows = pd.Series(range(len(table)), index=table.index)
    return rows.groupby([table[name] for name in key], dropna=False, sort=False).transform("min")


def _note_impossible_times(table: pd.DataFrame, faults: Faults) -> None:
    for column in _ENDINGS:
        early = table.index[(table[column] < table["consented_at"]).fillna(value=False)].to_list()
        faults.of_cells(early, column, "use a time after consented_at, or none")
    for row in faults.first(list(table.index[table[list(_ENDINGS)].notna().sum(axis=1) > 1])):
        ends = [name for name in _ENDINGS if pd.notna(table[name].iat[row])]
        faults.of_row(row, f"has both {' and '.join(ends[:2])}; nobody leaves a study twice, so keep one")


def _plain(value: object) -> object:
    """Return a value of a data frame without NumPy's type, so that it is told as people write it."""
    return value if isinstance(value, str) else int(str(value))
