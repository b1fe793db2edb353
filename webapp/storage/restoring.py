"""Checking a backup, and taking one into use.

Nothing is looked at where it lies: the file is copied into the instance, the copy is checked, and that very copy is
what takes the database's place.
"""

import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy.exc import DBAPIError

from webapp.storage.backup_bundles import FOLDER, bundle_problems, copy_bundles, publish_again
from webapp.storage.backup_manifests import KEY_SUFFIX, BackupError, Manifest, copy_file, read_manifest, sync_folder
from webapp.storage.backups import Contents, contents
from webapp.storage.database import Database, DatabaseError
from webapp.storage.instance import only_server, prepare_instance
from webapp.storage.records import Head
from webapp.storage.revisions import known_revisions
from webapp.storage.verification import verify_log

_STAGE = ".restore-"
# Where SQLite's locks on a file are (its file format, "pending byte").
_LOCK_START, _LOCK_BYTES = 0x40000000, 512
_BESIDE = ("-journal", "-wal", "-shm")


@dataclass(frozen=True, slots=True)
class Restored:
    """What was done.

    Attributes:
        manifest: Of the backup.
        kept: Where the database that was there before is kept; None if there was none.
        has_key: Whether the instance has a secret key now.
        is_same_key: Whether it is the key that was kept with the backup; None if none was.
    """

    manifest: Manifest
    kept: Path | None
    has_key: bool
    is_same_key: bool | None


def verify(backup: Path, instance: Path) -> tuple[Manifest | None, list[str]]:
    """Check a backup without taking it into use: digest, damage, revision, counts, the chain and what it vouches for.

    Args:
        backup: The file.
        instance: The instance folder, in which it is unpacked for the moment.

    Returns:
        Its manifest if there is one, and a line for each thing that is wrong.
    """
    with _staged(backup, instance) as (_, manifest, problems):
        return manifest, problems


def restore(backup: Path, database: Path, now: datetime, *, replace: bool = False) -> Restored:
    """Take a backup into use, if nothing is wrong with it.

    Args:
        backup: The file.
        database: The database's file; its folder is the instance.
        now: The time, which names what is kept of the database before.
        replace: Whether a database that holds something may be replaced. It is kept beside the new one.

    Raises:
        BackupError: The backup is not as it should be, or there is a database.
        webapp.storage.instance.InstanceError: A server runs on the instance.
    """
    instance = database.parent
    prepare_instance(instance)
    with only_server(instance), _staged(backup, instance) as (staged, manifest, problems):
        if manifest is None or problems:
            raise BackupError(f"{backup} was not restored: {problems[0]}; `xar restore {backup} --verify` tells all")
        if not replace and holds_data(database):
            raise BackupError(f"{database} holds data; with --replace it is kept under another name")
        try:
            copy_bundles(backup.parent / FOLDER, instance / FOLDER, manifest.bundles)
            publish_again(instance, manifest.published)
            kept = None
            if database.exists():
                with _unused(database):
                    kept = _set_aside(database, now)
                    staged.replace(database)
            else:
                staged.replace(database)
            sync_folder(instance)
            has_key, is_same_key = bring_key(backup.with_suffix(KEY_SUFFIX), instance / "secret_key")
        except OSError as error:
            raise BackupError(f"{backup} cannot be restored to {instance}: {error.strerror}") from error
    return Restored(manifest, kept, has_key, is_same_key)


def holds_data(database: Path) -> bool:
    """Tell whether a database holds anything but empty tables; one that cannot be read or was killed may."""
    if not database.exists():
        return False
    if any(database.with_name(database.name + suffix).exists() for suffix in _BESIDE):
        return True
    found = contents(database)
    rows = {name: number for name, number in found.num_rows.items() if name != "alembic_version"}
    return bool(found.problems) or any(rows.values())


@contextmanager
def _staged(backup: Path, instance: Path) -> Iterator[tuple[Path, Manifest | None, list[str]]]:
    """Copy a backup into the instance, check the copy and bring its tables up to date."""
    if not backup.is_file():
        raise BackupError(f"there is no backup {backup}")
    prepare_instance(instance)
    for left in instance.glob(f"{_STAGE}*"):
        _remove_if_left(left)
    with tempfile.TemporaryDirectory(prefix=f"{_STAGE}{os.getpid()}-", dir=instance) as folder:
        staged = Path(folder) / "xar.sqlite3"
        try:
            found_digest = copy_file(backup, staged)
        except OSError as error:
            raise BackupError(f"{backup} cannot be copied to {instance}: {error.strerror}") from error
        try:
            manifest = read_manifest(backup)
        except BackupError as error:
            yield staged, None, [str(error)]
            return
        yield staged, manifest, list(_problems(backup, staged, manifest, found_digest))


def _problems(backup: Path, staged: Path, manifest: Manifest, found_digest: str) -> Iterator[str]:
    if found_digest != manifest.sha256:
        yield f"{backup} is not the file that was backed up: its digest is {found_digest}, not {manifest.sha256}"
    found = contents(staged)
    if found.problems:
        yield from (f"{backup} is damaged: {problem}" for problem in found.problems)
        return
    yield from differences(backup, found, manifest)
    if found.revision is None or found.revision in known_revisions():
        yield from chain_problems(lambda: Database(staged))


def differences(backup: Path, found: Contents, manifest: Manifest) -> Iterator[str]:
    """Yield what a backup holds otherwise than its manifest says, and what is missing beside it."""
    if found.revision != manifest.revision:
        yield f"the schema's revision is {found.revision}, not {manifest.revision}"
    for table in sorted(found.num_rows.keys() | manifest.num_rows.keys()):
        number, wanted = found.num_rows.get(table, 0), manifest.num_rows.get(table, 0)
        if number != wanted:
            yield f"the table {table} has {number} rows, not {wanted}"
    if found.head != manifest.head:
        yield f"the chain ends with {_told(found.head)}, not {_told(manifest.head)}"
    yield from bundle_problems(backup.parent / FOLDER, manifest.bundles)
    if found.revision is not None and found.revision not in known_revisions():
        yield f"the schema's revision {found.revision} is of a later version of xar; install xar {manifest.program}"


def _told(head: Head) -> str:
    return f"record {head.number} ({head.hash})"


def chain_problems(opening: Callable[[], Database]) -> Iterator[str]:
    """Bring a copy's tables up to date and yield what is not as its records say."""
    try:
        with closing(opening()) as database:
            database.upgrade()
            yield from verify_log(database).problems
    except (DatabaseError, DBAPIError) as error:
        yield str(getattr(error, "orig", None) or error)


@contextmanager
def _unused(database: Path) -> Iterator[None]:
    """Hold a database's file against every program that reads or writes it through SQLite, without opening it.

    To open it would work in what a killed program left, and change the evidence.
    """
    descriptor = os.open(database, os.O_RDWR)
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, _LOCK_BYTES, _LOCK_START)
        yield
    except BlockingIOError:
        raise BackupError(f"{database} is in use by another program; stop it first") from None
    finally:
        os.close(descriptor)


def _set_aside(database: Path, now: datetime) -> Path:
    """Give the database another name as well, and take along what a killed program left beside it.

    It is whole under the new name. Under its own it stays until the restored one takes its place.
    """
    kept = database.with_name(f"replaced-{now.astimezone(UTC):%Y%m%dT%H%M%S-%fZ}{database.suffix}")
    kept.hardlink_to(database)
    for suffix in _BESIDE:
        left = database.with_name(database.name + suffix)
        if left.exists():
            left.rename(kept.with_name(kept.name + suffix))
    sync_folder(database.parent)
    return kept


def bring_key(backed_up: Path, key: Path) -> tuple[bool, bool | None]:
    """Put the backup's key where the instance has none; tell whether it has one, and whether that is the backup's."""
    if backed_up.exists() and not key.exists():
        copy_file(backed_up, key)
    return key.exists(), key.read_bytes() == backed_up.read_bytes() if backed_up.exists() and key.exists() else None


def _remove_if_left(folder: Path) -> None:
    """Remove what a process that is no more left unpacked."""
    (process, _, _) = folder.name.removeprefix(_STAGE).partition("-")
    if process.isdecimal() and not Path(f"/proc/{process}").exists():
        shutil.rmtree(folder, ignore_errors=True)
