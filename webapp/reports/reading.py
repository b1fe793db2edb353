"""A data set from its files, checked: every mistake is told with file, line, column, value and what is wanted."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from webapp.reports.read_checks import check_kinds, check_known, check_ratings, check_rows
from webapp.reports.read_columns import FORMS, convert, extra_columns
from webapp.reports.read_declared import (
    Declaration,
    Described,
    kinds_of,
    points_of,
    read_declarations,
    read_description,
)
from webapp.reports.read_faults import Faults
from webapp.reports.read_folder import DataFiles, DataFolder, find_data
from webapp.reports.read_problems import DataSetError
from webapp.reports.read_scope import fill_scope
from webapp.reports.read_text import RawTable, read_table

__all__ = ["DataSet", "DataSetError", "read_dataset"]


@dataclass(frozen=True, slots=True)
class DataSet:
    """A data set as it was read; nothing is left out of it or corrected.

    Attributes:
        tables: The tables that are there, by name: `ratings` always, and of `participants`, `answers`, `probes`,
            `drives`, `allocation`, `decisions` and `quality` those whose file is there. Each has all the columns of
            the data dictionary; study, version and mode are filled in.
        declarations: The study files.
        described: What the data set says of the ratings.
        digests: SHA-256 of every file that was read, by its name within the data set.
        notes: What whoever reads the report should know of the files: columns that were left out, files that were
            changed.
        files: What the files are called, and how they differ from the export.
    """

    tables: Mapping[str, pd.DataFrame]
    declarations: tuple[Declaration, ...]
    described: Described
    digests: Mapping[str, str]
    notes: tuple[str, ...]
    files: DataFiles

    def declaration(self, study: str, version: str) -> Declaration | None:
        """Return the study file of data of a study and version, both empty if the data do not say."""
        return next((each for each in self.declarations if each.is_of(study, version)), None)

    def scale(self, study: str, version: str, experiment: str, item: str, largest: int) -> tuple[int | None, bool]:
        """Return how many points an item's scale has, and whether they are known; see `points_of`.

        Args:
            study: Whose ratings they are.
            version: Of the study.
            experiment: The experiment.
            item: The item.
            largest: The largest rating of the item.
        """
        declaration = self.declaration(study, version)
        is_known = declaration is not None or self.described.points is not None
        return points_of(declaration, experiment, item, self.described, largest), is_known


def read_dataset(path: Path, *, changed_ok: bool = False) -> DataSet:
    """Read a data set.

    Args:
        path: What `xar export` wrote; or a folder with `ratings.csv` and whichever others there are; or one file of
            ratings.
        changed_ok: Whether to read files that were changed after the export, which the notes then say, instead of
            refusing them.

    Raises:
        DataSetError: It cannot be analysed; the message has a line for each problem.
    """
    folder = find_data(path, FORMS, changed_ok=changed_ok)
    problems: list[str] = []
    raw = _raw_tables(folder, problems)
    declarations, described = _declared(folder, problems)
    faults = {name: Faults(table) for name, table in raw.items()}
    tables = {name: convert(FORMS[name], faults[name]) for name in raw}
    fill_scope(tables, faults, folder.notes)
    sound = {name: table for name, table in tables.items() if not faults[name]}
    for name, table in sound.items():
        check_rows(name, FORMS[name], table, faults[name])
    notes = tuple(folder.notes) + _extra(raw)
    data_set = DataSet(tables, declarations, described, folder.digests, notes, folder.files())
    _check_together(data_set, faults)
    problems += [problem for each in faults.values() for problem in each.told()]
    if problems:
        raise DataSetError(problems)
    return data_set


def _raw_tables(folder: DataFolder, problems: list[str]) -> dict[str, RawTable]:
    raw: dict[str, RawTable] = {}
    for name, file in folder.tables.items():
        try:
            content = folder.read(file)
            if content is not None:
                raw[name] = read_table(file, content)
            elif name == "ratings":
                problems.append(f"{file}: is missing, and without ratings there is nothing to analyse")
        except DataSetError as error:
            problems += error.problems
    if "ratings" in raw and raw["ratings"].cells.empty:
        problems.append(f"{raw.pop('ratings').file}: has no rows, so there is nothing to analyse")
    return raw


def _declared(folder: DataFolder, problems: list[str]) -> tuple[tuple[Declaration, ...], Described]:
    if list(folder.tables) == ["ratings"]:
        # A single file is read alone, whatever lies beside it.
        return (), Described()
    try:
        return read_declarations(folder), read_description(folder)
    except DataSetError as error:
        problems += error.problems
        return (), Described()


def _check_together(data_set: DataSet, faults: Mapping[str, Faults]) -> None:
    """Note what tables say of one another, as far as each is right in itself."""
    tables = {name: table for name, table in data_set.tables.items() if not faults[name]}
    if "ratings" in tables:
        check_ratings(tables["ratings"], data_set.scale, faults["ratings"])
        check_kinds(tables["ratings"], lambda *of: kinds_of(data_set.declaration(*of[:2]), of[2]), faults["ratings"])
    known = tables.pop("participants", None)
    if known is not None:
        for name, table in tables.items():
            check_known(table, known, faults[name], faults["participants"].table.file)


def _extra(raw: Mapping[str, RawTable]) -> tuple[str, ...]:
    """Name the columns that are left out."""
    notes = []
    for name, table in raw.items():
        extra = extra_columns(FORMS[name], table)
        if extra:
            word = "column" if len(extra) == 1 else "columns"
            notes.append(f"{table.file}: left out the {word} {', '.join(map(repr, extra))}.")
    return tuple(notes)
