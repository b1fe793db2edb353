"""Whose data each row is of, also in tables that do not say it themselves."""

from collections.abc import Mapping

import pandas as pd

from webapp.reports.read_faults import Faults

SCOPE = ("study", "study_version", "mode")
"""The columns that say it."""

_DEFAULTS = {"study": "", "study_version": "", "mode": "live"}


def fill_scope(tables: Mapping[str, pd.DataFrame], faults: Mapping[str, Faults], notes: list[str]) -> None:
    """Fill in study, version and mode where a table has no such column, from the other tables if they agree.

    Args:
        tables: The tables by name; changed in place.
        faults: Their faults; added to where the others do not agree.
        notes: What is said of columns that no table has.
    """
    for column in SCOPE:
        having = [name for name in tables if column in faults[name].table.cells.columns]
        found = sorted({value for name in having for value in tables[name][column].dropna().unique()})
        for name, table in tables.items():
            if name in having:
                table[column] = table[column].fillna("")
            elif len(found) > 1:
                faults[name].of_table(f"has no column {column!r}, and the others hold {', '.join(found)}; add it")
            else:
                table[column] = pd.Series(found[0] if found else _DEFAULTS[column], index=table.index, dtype="str")
        if not having and column == "mode":
            notes.append("No table has a column 'mode'; all rows are taken for those of participants.")
