"""The data as a data set: a folder or an archive of tables, with what describes them, all from one state.

Its form is that of Psych-DS: tables under `data/`, named `description-<table>_data.csv`, and a description in JSON.
"""

import json
import os
import platform
import secrets
import shutil
import sqlite3
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any, Protocol, cast

from sqlalchemy import Connection, func, select
from sqlalchemy.exc import SQLAlchemyError

from webapp.stimuli.catalogue import Catalogue
from webapp.storage.consort import CONSORT, consort_rows, read_flows
from webapp.storage.consort_figure import draw_flows
from webapp.storage.csv_files import Counting, Written, write_table
from webapp.storage.database import Database
from webapp.storage.dataset_description import Covered, describe, variables_measured
from webapp.storage.dataset_readme import readme
from webapp.storage.declared_files import declared_files
from webapp.storage.exports import FILE_NAMES, ExportError, columns_of, write_csv
from webapp.storage.records import COMMAND_LINE, Entry, append, head
from webapp.storage.scope import Mode, Scope
from webapp.storage.snapshot import snapshot
from webapp.storage.tables import participants
from webapp.storage.wanted import Wanted

MANIFEST_FORMAT = 1
"""Raised when the manifest's form changes."""

_NOT_PSYCH_DS = "spreadsheet/\nstudies/\nconsort.csv\nconsort.json\nconsort.svg\nmanifest.json\n"
"""What Psych-DS has no rules for; its validator looks for this list in a file of its own."""


class Place(Protocol):
    """Where a data set is written."""

    def open(self, name: str) -> AbstractContextManager[IO[bytes]]:
        """Open a new file for writing; its name may hold folders. One is open at a time."""


def data_name(table: str) -> str:
    """Return the name of a table in a data set, such as `data/description-ratings_data.csv` of `ratings.csv`."""
    return f"data/description-{table.removesuffix('.csv')}_data.csv"


def export(database: Database, folder: Path, wanted: Wanted, now: datetime) -> dict[str, int]:
    """Write the data set into a new folder; it appears complete, or not at all.

    Args:
        database: What to export. It is read for a moment alone.
        folder: Where to; an empty folder may be there.
        wanted: Which rows.
        now: The time.

    Returns:
        The number of rows of each table, by its name in the folder.

    Raises:
        ExportError: Something is there already, or the data set cannot be written. Nothing is overwritten.
    """
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise ExportError(f"{folder} exists already and is not an empty folder; choose another one")
    _refuse_nothing(database, wanted)
    draft = folder.with_name(f".{folder.name}-{secrets.token_hex(4)}.unfinished")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        draft.mkdir()
        with snapshot(database) as connection:
            written = write_dataset(connection, _Folder(draft), wanted, now)
        draft.rename(folder)
    except BaseException as error:
        shutil.rmtree(draft, ignore_errors=True)
        if isinstance(error, OSError):
            raise ExportError(f"{error.filename or folder}: {error.strerror}") from error
        if isinstance(error, SQLAlchemyError | sqlite3.Error):
            raise ExportError(f"the data cannot be read: {error}") from error
        raise
    return {name: told.num_rows or 0 for name, told in written.items() if name.startswith("data/") and _is_table(name)}


def _refuse_nothing(database: Database, wanted: Wanted) -> None:
    """Refuse a choice to which nobody belongs, which would look like data of nobody."""
    if wanted.study is None and wanted.study_version is None:
        return
    key = (participants.c.study, participants.c.study_version)
    with database.read() as connection:
        known = connection.execute(select(*key).distinct().order_by(*key)).all()
        if connection.execute(select(participants.c.id).where(wanted.of(participants)).limit(1)).first():
            return
    there = ", ".join(f"{study} {version[:12]}" for study, version in known) or "none"
    chosen = " ".join(filter(None, (wanted.study, wanted.study_version, wanted.mode)))
    raise ExportError(f"there are no data of {chosen}; there are data of {there}")


def record_export(database: Database, wanted: Wanted, now: datetime) -> None:
    """Record that a data set was written from the command line, and of what."""
    chosen = {"study": wanted.study, "version": wanted.study_version, "mode": wanted.mode}
    content = {"file": "the data set", **chosen, "own_words": wanted.with_free_text}
    with database.write() as connection:
        append(connection, Entry(now, COMMAND_LINE, "downloaded", content=content))


def write_archive(database: Database, file: IO[bytes], wanted: Wanted, now: datetime) -> None:
    """Write the data set as a ZIP archive.

    Args:
        database: What to export. It is read for a moment alone.
        file: Where to write, from its present place on.
        wanted: Which rows.
        now: The time.
    """
    with snapshot(database) as connection, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        write_dataset(connection, _Archive(archive, now), wanted, now)


def write_dataset(connection: Connection, place: Place, wanted: Wanted, now: datetime) -> dict[str, Written]:
    """Write every file of the data set, the manifest last.

    Returns:
        What was written, by the name of the file; the manifest is not among them.
    """
    covered = _covered(connection, wanted)
    bundles = _bundles(covered, wanted)
    written: dict[str, Written] = {}
    columns = {name: columns_of(connection, name, wanted) for name in FILE_NAMES}
    for name in FILE_NAMES:
        for path, is_copy in ((data_name(name), False), (f"spreadsheet/{name}", True)):
            with place.open(path) as file:
                written[path] = write_csv(connection, name, file, wanted, for_spreadsheet=is_copy)
        sidecar = {"variableMeasured": variables_measured({name: columns[name]}, bundles)}
        path = f"{data_name(name).removesuffix('.csv')}.json"
        written[path] = _write_json(place, path, sidecar)
    written |= _write_flow(connection, place, wanted)
    written |= {path: _write_bytes(place, path, content) for path, content in declared_files(covered, wanted)}
    by_path = {data_name(name): found for name, found in columns.items()}
    written["dataset_description.json"] = _write_json(
        place, "dataset_description.json", describe(covered, by_path, bundles, now)
    )
    written[".psychdsignore"] = _write_text(place, ".psychdsignore", _NOT_PSYCH_DS)
    written["README.txt"] = _write_text(place, "README.txt", readme(covered, wanted))
    _write_json(place, "manifest.json", _manifest(connection, covered, wanted, written, now))
    return written


def _write_flow(connection: Connection, place: Place, wanted: Wanted) -> dict[str, Written]:
    flows = read_flows(connection, wanted)
    with place.open("consort.csv") as file:
        table = write_table(file, CONSORT, consort_rows(flows), for_spreadsheet=False)
    return {
        "consort.csv": table,
        "consort.json": _write_json(place, "consort.json", {"flows": [flow.as_json() for flow in flows]}),
        "consort.svg": _write_text(place, "consort.svg", draw_flows(flows)),
    }


def _manifest(
    connection: Connection, covered: Covered, wanted: Wanted, written: dict[str, Written], now: datetime
) -> dict[str, Any]:
    end = head(connection)
    return {
        "format": MANIFEST_FORMAT,
        "made_at": now.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z"),
        "versions": {"xar": version("xar"), "python": platform.python_version(), "sqlite": sqlite3.sqlite_version},
        "scope": {"study": wanted.study, "study_version": wanted.study_version, "mode": wanted.mode},
        "with_free_text": wanted.with_free_text,
        "studies": [{**asdict(scope), "participants": count} for scope, count in covered.participants.items()],
        "log": {"number": end.number, "hash": end.hash},
        "files": {
            path: {"rows": told.num_rows, "bytes": told.num_bytes, "sha256": told.sha256}
            for path, told in sorted(written.items())
        },
    }


def _covered(connection: Connection, wanted: Wanted) -> Covered:
    people = participants.c
    key = (people.study, people.study_version, people.mode)
    counts = select(*key, func.count()).where(wanted.of(participants)).group_by(*key).order_by(func.min(people.id))
    span = select(func.min(people.consented_at), func.max(people.last_seen_at)).where(wanted.of(participants))
    begun_at, ended_at = connection.execute(span).one()
    spoken = select(people.language).distinct().where(wanted.of(participants)).order_by(people.language)
    return Covered(
        {Scope(study, of, cast("Mode", mode)): count for study, of, mode, count in connection.execute(counts)},
        begun_at,
        ended_at,
        connection.execute(spoken).scalars().all(),
    )


def _bundles(covered: Covered, wanted: Wanted) -> Sequence[Catalogue]:
    versions = dict.fromkeys(scope.study_version for scope in covered.participants)
    return [bundle for bundle in map(wanted.find_bundle, versions) if bundle is not None]


def _write_json(place: Place, name: str, content: object) -> Written:
    return _write_text(place, name, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def _write_text(place: Place, name: str, text: str) -> Written:
    return _write_bytes(place, name, text.encode())


def _write_bytes(place: Place, name: str, content: bytes) -> Written:
    with place.open(name) as file:
        counting = Counting(file)
        counting.write(content)
        return counting.written()


def _is_table(name: str) -> bool:
    return name.endswith(".csv")


class _Folder:
    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @contextmanager
    def open(self, name: str) -> Iterator[IO[bytes]]:
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())


class _Archive:
    def __init__(self, archive: zipfile.ZipFile, now: datetime) -> None:
        self._archive = archive
        self._time = now.timetuple()[:6]

    @contextmanager
    def open(self, name: str) -> Iterator[IO[bytes]]:
        entry = zipfile.ZipInfo(name, self._time)
        entry.compress_type = zipfile.ZIP_DEFLATED
        entry.external_attr = 0o644 << 16
        with self._archive.open(entry, "w", force_zip64=True) as file:
            yield file
