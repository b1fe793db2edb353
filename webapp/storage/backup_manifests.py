"""What stands beside a backup: a small JSON file that says what the backup must hold."""

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from webapp.storage.database import DatabaseError
from webapp.storage.records import Head

FORMAT = 1
"""Raised when manifests of an earlier program can no longer be read."""
SQLITE_SUFFIX = ".sqlite3"
POSTGRESQL_SUFFIX = ".pgdump"
_SUFFIXES = (SQLITE_SUFFIX, POSTGRESQL_SUFFIX)
KEY_SUFFIX = ".secret_key"
PREFIX = "xar-"
_CHUNK_BYTES = 1 << 20


class BackupError(DatabaseError):
    """A backup that cannot be made or used; the message says what to do."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a backup must hold.

    Attributes:
        made_at: The time, UTC.
        program: The version of xar that made it.
        database: Whose backup it is: the path of the file, or the address without a password.
        revision: The schema's revision; None for a database without tables.
        num_bytes: The size of the file.
        sha256: Of the file, in hexadecimal.
        head: The end of the chain of records.
        num_rows: By table.
        bundles: The versions of studies that its participants saw, or that are published; kept in `bundles` beside it.
        missing_bundles: Those that were not there, and so were not kept.
        published: The published version by study.
        has_secret_key: Whether the secret key was kept beside it.
    """

    made_at: datetime
    program: str
    database: str
    revision: str | None
    num_bytes: int
    sha256: str
    head: Head
    num_rows: Mapping[str, int]
    bundles: tuple[str, ...]
    missing_bundles: tuple[str, ...]
    published: Mapping[str, str]
    has_secret_key: bool

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values, which `from_json` reads back."""
        told = asdict(self) | {"made_at": self.made_at.astimezone(UTC).isoformat(timespec="microseconds")}
        return {"format": FORMAT} | told

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> "Manifest":
        """Read a manifest.

        Raises:
            ValueError: It is none, or of a later program.
            TypeError: It is none.
            KeyError: It is none.
        """
        fields = dict(content)
        if fields.pop("format") != FORMAT:
            raise ValueError(f"its format is {content['format']!r}, and this program reads {FORMAT}")
        fields["made_at"] = datetime.fromisoformat(fields["made_at"])
        fields["head"] = Head(**fields["head"])
        for name in ("bundles", "missing_bundles"):
            fields[name] = tuple(fields[name])
        return cls(**fields)


def manifest_path(backup: Path) -> Path:
    """Return where the manifest of a backup stands."""
    return backup.with_suffix(".json")


def read_manifest(backup: Path) -> Manifest:
    """Read the manifest beside a backup.

    Raises:
        BackupError: There is none, or it cannot be read.
    """
    path = manifest_path(backup)
    try:
        return Manifest.from_json(json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise BackupError(
            f"{backup} has no manifest {path.name} beside it: only `xar backup` makes backups, and a copy of a "
            "database that is in use may be torn"
        ) from None
    except OSError as error:
        raise BackupError(f"{path} cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise BackupError(f"{path} is no manifest of a backup: {error}") from error


def write_manifest(backup: Path, manifest: Manifest) -> Path:
    """Write the manifest of a backup, whole or not at all; with it the backup is complete.

    Returns:
        Where it stands.
    """
    path = manifest_path(backup)
    text = json.dumps(manifest.to_json(), indent=2, ensure_ascii=False)
    with tempfile.NamedTemporaryFile(dir=backup.parent, prefix=".manifest-", delete=False) as file:
        file.write(f"{text}\n".encode())
        file.flush()
        os.fsync(file.fileno())
    Path(file.name).replace(path)
    sync_folder(backup.parent)
    return path


def complete_backups(folder: Path, database: str | None = None) -> Iterator[tuple[Path, Manifest]]:
    """Yield the backups of a folder that have a manifest, the oldest first.

    Args:
        folder: Where they are.
        database: Of this database alone, as its manifest names it; None for all.
    """
    found = []
    for suffix in _SUFFIXES:
        for path in folder.glob(f"{PREFIX}*{suffix}"):
            try:
                manifest = read_manifest(path)
            except BackupError:
                continue
            if database in {None, manifest.database}:
                found.append((path, manifest))
    yield from sorted(found, key=lambda one: (one[1].made_at, one[0].name))


def newest_backup(folder: Path, database: str) -> Manifest | None:
    """Return the manifest of the newest backup of a database, or None if there is none that can be read.

    The names of backups begin with their times, so that only the newest files are looked at.
    """
    try:
        names = sorted((path for path in folder.glob(f"{PREFIX}*.json")), key=lambda path: path.name, reverse=True)
    except OSError:  # The folder belongs to somebody else.
        return None
    for path in names:
        backup = next((found for suffix in _SUFFIXES if (found := path.with_suffix(suffix)).exists()), None)
        if backup is None:
            continue
        try:
            manifest = read_manifest(backup)
        except BackupError:
            continue
        if manifest.database == database:
            return manifest
    return None


def digest(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal."""
    found = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK_BYTES):
            found.update(chunk)
    return found.hexdigest()


def copy_file(source: Path, target: Path) -> str:
    """Copy a file to a new one for its owner alone, onto the disk.

    Returns:
        The SHA-256 of what was copied, in hexadecimal.

    Raises:
        FileExistsError: The target is there.
    """
    found = hashlib.sha256()
    descriptor = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with source.open("rb") as file, os.fdopen(descriptor, "wb") as copy:
        while chunk := file.read(_CHUNK_BYTES):
            found.update(chunk)
            copy.write(chunk)
        copy.flush()
        os.fsync(copy.fileno())
    return found.hexdigest()


def sync_folder(folder: Path) -> None:
    """Put the names in a folder onto the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
