"""Backups of a SQLite database, made while a server writes to it.

A file that is copied while it is written to may hold half of one transaction and half of another. SQLite's own copy
holds one state of the database; writers wait for as long as it takes.
"""

import fcntl
import os
import sqlite3
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from webapp.stimuli.program import running_program
from webapp.storage.backup_bundles import FOLDER, copy_bundles, published_versions
from webapp.storage.backup_manifests import (
    KEY_SUFFIX,
    PREFIX,
    SQLITE_SUFFIX,
    BackupError,
    Manifest,
    complete_backups,
    copy_file,
    digest,
    manifest_path,
    sync_folder,
    write_manifest,
)
from webapp.storage.records import FIRST_HASH, Head

_DRAFT = ".backup-"
_WAIT_S = 30
"""How long a backup waits for a writer."""


@dataclass(frozen=True, slots=True)
class Contents:
    """What a SQLite file holds.

    Attributes:
        revision: The schema's revision; None without tables of ours.
        head: The end of the chain of records.
        num_rows: By table.
        versions: Of the studies that its participants saw.
        problems: What SQLite finds damaged; nothing else is read then.
    """

    revision: str | None
    head: Head
    num_rows: Mapping[str, int]
    versions: tuple[str, ...]
    problems: tuple[str, ...] = ()


def back_up(database: Path, folder: Path, now: datetime, *, with_secret_key: bool = False) -> tuple[Path, Manifest]:
    """Copy a database, and the bundles that its data refer to, into a folder; nothing is overwritten.

    A backup is complete when its manifest is there. What a killed one leaves is removed by the next.

    Args:
        database: The file; its folder is the instance.
        folder: Where the backup goes; made if it is not there.
        now: The time, which names the backup.
        with_secret_key: Whether to copy the instance's secret key too, into a file of its own.

    Returns:
        The backup's file and its manifest.

    Raises:
        BackupError: No backup can be made.
    """
    if not database.exists():
        raise BackupError(f"there is no database {database} to back up; XAR_INSTANCE says where it is")
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with new_draft(folder) as draft:
            _copy(database, draft)
            found = contents(draft)
            if found.problems:
                raise BackupError(f"the copy of {database} is damaged ({found.problems[0]}); run `xar doctor`")
            told, instance = str(database.absolute()), database.parent
            return complete(draft, found, now, database=told, instance=instance, with_secret_key=with_secret_key)
    except sqlite3.Error as error:
        raise BackupError(f"{database} cannot be copied to {folder}: {error}") from error
    except OSError as error:
        raise BackupError(f"the folder {folder} cannot hold a backup: {error.strerror}") from error


def contents(path: Path) -> Contents:
    """Read what a database file holds, whichever revision it is of, and whether SQLite finds it undamaged."""
    try:
        with closing(sqlite3.connect(path)) as connection:
            damaged = [line for (line,) in connection.execute("PRAGMA integrity_check") if line != "ok"]
            if not damaged:
                dangling = connection.execute("PRAGMA foreign_key_check")
                damaged = [f"a row of {table} refers to nothing" for table, *_ in dangling]
            if not damaged:
                return _read(connection)
    except sqlite3.DatabaseError as error:
        damaged = [str(error)]
    return Contents(None, Head(0, FIRST_HASH), {}, (), tuple(damaged))


def expendable(
    backups: Iterable[tuple[Path, Manifest]], keep_daily: int, keep_weekly: int
) -> list[tuple[Path, Manifest]]:
    """Return the backups that need not be kept: the newest of each of the latest days and weeks stay.

    Args:
        backups: In the order of time.
        keep_daily: Of how many days that have a backup; the newest backup is kept in any case.
        keep_weekly: Of how many weeks (ISO, UTC) that have one.
    """
    newest_first = list(backups)[::-1]
    kept = {path for path, _ in newest_first[:1]}
    for number, period in ((keep_daily, "%Y-%m-%d"), (keep_weekly, "%G-W%V")):
        newest: dict[str, Path] = {}
        for path, manifest in newest_first:
            newest.setdefault(manifest.made_at.astimezone(UTC).strftime(period), path)
        kept |= set(list(newest.values())[:number])
    return [(path, manifest) for path, manifest in newest_first[::-1] if path not in kept]


def remove_expendable(folder: Path, database: str, keep_daily: int, keep_weekly: int) -> list[Path]:
    """Remove earlier backups of a database from a folder, as far as `expendable` says; other files are not touched.

    Returns:
        What was removed.
    """
    removed = []
    for path, _ in expendable(complete_backups(folder, database), keep_daily, keep_weekly):
        # The manifest goes first: what has none is no backup.
        for part in (manifest_path(path), path, path.with_suffix(KEY_SUFFIX)):
            part.unlink(missing_ok=True)
        removed.append(path)
    return removed


def claim(folder: Path, now: datetime, suffix: str) -> Path:
    """Make an empty file under the name of a backup of this moment, which nobody else can then take.

    Raises:
        BackupError: There are backups of this moment already.
    """
    path = folder / f"{PREFIX}{now.astimezone(UTC):%Y%m%dT%H%M%S.%fZ}".replace(".", "-")
    path = path.with_name(path.name + suffix)
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
    except FileExistsError:
        raise BackupError(f"{path} is there already; nothing is overwritten") from None
    return path


@contextmanager
def new_draft(folder: Path) -> Iterator[Path]:
    """Make a file that disappears unless it is renamed; what killed processes left disappears too."""
    for path in folder.glob(f"{_DRAFT}*"):
        with suppress(OSError), path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink()
    handle, name = tempfile.mkstemp(prefix=_DRAFT, dir=folder)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)  # It ends with the process.
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)
        os.close(handle)


def _copy(database: Path, draft: Path) -> None:
    address = f"{database.absolute().as_uri()}?mode=rw"
    with (
        closing(sqlite3.connect(address, uri=True, timeout=_WAIT_S)) as original,
        closing(sqlite3.connect(draft)) as copy,
    ):
        original.execute("PRAGMA query_only=ON").close()
        original.backup(copy)
        # A copy of a database with a write-ahead log would want one beside it; one file is a backup.
        copy.execute("PRAGMA journal_mode=DELETE").close()
    with draft.open("rb") as file:
        os.fsync(file.fileno())


def complete(
    draft: Path,
    found: Contents,
    now: datetime,
    *,
    database: str,
    instance: Path,
    suffix: str = SQLITE_SUFFIX,
    with_secret_key: bool = False,
) -> tuple[Path, Manifest]:
    """Make a backup of a copy that is on the disk: give it its name, what it needs beside it, and its manifest.

    Args:
        draft: The copy, in the folder of backups.
        found: What it holds.
        now: The time, which names the backup.
        database: What the manifest calls the database.
        instance: The folder of bundles and key.
        suffix: Of the name.
        with_secret_key: Whether to copy the secret key.
    """
    folder = draft.parent
    published = published_versions(instance)
    versions = tuple(sorted({*found.versions, *published.values()}))
    there = tuple(version for version in versions if (instance / FOLDER / version).is_dir())
    copy_bundles(instance / FOLDER, folder / FOLDER, there)
    manifest = Manifest(
        made_at=now,
        program=running_program().version,
        database=database,
        revision=found.revision,
        num_bytes=draft.stat().st_size,
        sha256=digest(draft),
        head=found.head,
        num_rows=found.num_rows,
        bundles=there,
        missing_bundles=tuple(version for version in versions if version not in there),
        published=published,
        has_secret_key=with_secret_key,
    )
    path = claim(folder, now, suffix)
    if with_secret_key:
        copy_file(instance / "secret_key", path.with_suffix(KEY_SUFFIX))
    draft.replace(path)
    sync_folder(folder)
    write_manifest(path, manifest)
    return path, manifest


def _read(connection: sqlite3.Connection) -> Contents:
    query = "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite%' ORDER BY name"
    tables = [name for (name,) in connection.execute(query)]
    num_rows = {}
    for name in tables:
        quoted = name.replace('"', '""')
        (num_rows[name],) = connection.execute(f'SELECT count(*) FROM "{quoted}"').fetchone()  # noqa: S608 # nosec B608
    revision, last, versions = None, None, []
    if "alembic_version" in num_rows:
        (revision,) = connection.execute("SELECT version_num FROM alembic_version").fetchone() or (None,)
    if "records" in num_rows:
        last = connection.execute("SELECT number, hash FROM records ORDER BY number DESC LIMIT 1").fetchone()
    if "participants" in num_rows:
        versions = connection.execute("SELECT DISTINCT study_version FROM participants ORDER BY 1").fetchall()
    head = Head(0, FIRST_HASH) if last is None else Head(*last)
    return Contents(revision, head, num_rows, tuple(version for (version,) in versions))
