"""The files of a data set: where they lie, and whether they are those that were exported."""

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from webapp.reports.read_problems import DataSetError
from webapp.storage.dataset import MANIFEST_FORMAT, data_name

MOST_BYTES = 2_000_000_000
"""The largest file that is read; ratings of a hundred thousand participants have a tenth of it."""

MANIFEST = "manifest.json"


Difference = Literal["missing", "changed", "added"]


@dataclass(frozen=True, slots=True)
class DataFiles:
    """What the files of a data set are called, and how they differ from the export; of files that are read.

    Attributes:
        names: The file of each table within the data set, also of those that are not there.
        has_manifest: Whether the data set has a manifest, without which no difference is known.
        missing: Files that the manifest has and that are not there.
        changed: Files that are not as the manifest has them.
        added: Files that the manifest does not have.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    has_manifest: bool = False
    missing: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    added: tuple[str, ...] = ()

    def name_of(self, table: str) -> str:
        """Return the name of a table's file, as messages tell it."""
        return self.names.get(table, f"{table}.csv")


@dataclass(frozen=True, slots=True)
class DataFolder:
    """The files of a data set.

    Attributes:
        root: The folder.
        tables: The file of each table that is there or should be, within the folder.
        manifest: What was written at the export, None if it is not there.
        changed_ok: Whether files are read that are not those of the manifest.
        digests: The SHA-256 of every file that was read, by its name.
        notes: What whoever reads the report should know of the files.
        differences: How files that were looked for differ from the manifest, by their names.
    """

    root: Path
    tables: Mapping[str, str]
    manifest: Mapping[str, Any] | None
    changed_ok: bool
    digests: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    differences: dict[str, Difference] = field(default_factory=dict)

    def files(self) -> DataFiles:
        """Return what the files are called, and how those that were looked for differ from the manifest."""
        by_difference = {wanted: tuple(sorted(self._that_are(wanted))) for wanted in ("missing", "changed", "added")}
        return DataFiles(self.tables, self.manifest is not None, **by_difference)

    def _that_are(self, wanted: str) -> Iterator[str]:
        return (name for name, difference in self.differences.items() if difference == wanted)

    def read(self, name: str) -> bytes | None:
        """Return a file's content, None if it is not there.

        Raises:
            DataSetError: It cannot be read, or is not the file of the manifest.
        """
        content = _content(self.root / name, name)
        if content is not None:
            self.digests[name] = hashlib.sha256(content).hexdigest()
        self._compare(name)
        return content

    def folders(self, name: str) -> list[str]:
        """Return the folders within a folder, by their letters: those that are there, and those of the manifest."""
        files = () if self.manifest is None else self.manifest["files"]
        exported = {file.split("/")[1] for file in files if file.startswith(f"{name}/") and file.count("/") > 1}
        try:
            there = {path.name for path in (self.root / name).iterdir() if path.is_dir()}
        except OSError:
            there = set()
        return sorted(exported | there)

    def _compare(self, name: str) -> None:
        if self.manifest is None or name == MANIFEST:
            return
        told = self.manifest["files"].get(name)
        found = self.digests.get(name)
        if (None if told is None else told["sha256"]) == found:
            return
        difference: Difference = "added" if told is None else "missing" if found is None else "changed"
        self.differences[name] = difference
        if told is None:
            what = "is not in the manifest, so it was added after the export"
        elif found is None:
            what = "is missing, and the manifest has it, so it was removed after the export"
        else:
            what = f"was changed after the export: its SHA-256 is {found}, the manifest has {told['sha256']}"
        if not self.changed_ok:
            wish = "take the data set as it was exported; if the change is meant, say --changed-data-ok"
            raise DataSetError([f"{name}: {what}; {wish}"])
        self.notes.append(f"{name} {what}.")


def find_data(path: Path, names: Collection[str], *, changed_ok: bool) -> DataFolder:
    """Find the files of a data set.

    Args:
        path: A data set as exported, a folder with `ratings.csv` and others by their plain names, or one file of
            ratings.
        names: The tables to look for.
        changed_ok: Whether files are read that are not those of the manifest.

    Raises:
        DataSetError: There is nothing like that, or the manifest is none.
    """
    if path.is_file():
        if path.suffix.lower() == ".zip":
            raise DataSetError([f"{path}: is an archive; unpack it, and name the folder"])
        return DataFolder(path.parent, {"ratings": path.name}, None, changed_ok)
    if not path.is_dir():
        raise DataSetError([f"{path}: is not there; name a folder that `xar export` wrote, or a file of ratings"])
    manifest = _manifest(path)
    exported, plain = data_name("ratings.csv"), "ratings.csv"
    is_exported = (path / exported).exists() or (manifest is not None and exported in manifest["files"])
    if not is_exported and not (path / plain).exists():
        above = "; name the folder above it" if (path / Path(exported).name).exists() else ""
        raise DataSetError([f"{path}: holds no ratings: neither {exported} nor {plain}{above}"])
    tables = {name: data_name(f"{name}.csv") if is_exported else f"{name}.csv" for name in names}
    folder = DataFolder(path, tables, manifest if is_exported else None, changed_ok)
    if folder.manifest is None:
        folder.notes.append(f"There is no {MANIFEST}, so whether the files are as they were exported is not known.")
    return folder


def _content(path: Path, name: str) -> bytes | None:
    if not path.exists():
        return None
    if not path.is_file():
        raise DataSetError([f"{name}: is no file"])
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            told = f"has {size / 1e9:.1f} GB, and no study has more than {MOST_BYTES / 1e9:g} GB"
            raise DataSetError([f"{name}: {told}; is it the right file?"])
        return path.read_bytes()
    except OSError as error:
        raise DataSetError([f"{name}: cannot be read: {error.strerror}"]) from None


def _manifest(root: Path) -> Mapping[str, Any] | None:
    content = _content(root / MANIFEST, MANIFEST)
    if content is None:
        return None
    try:
        manifest = json.loads(content)
    except (ValueError, RecursionError):
        manifest = None
    if not _is_manifest(manifest):
        raise DataSetError([f"{MANIFEST}: is no manifest of a data set; take the one of the export, or remove it"])
    if manifest["format"] != MANIFEST_FORMAT:
        told = f"has the format {manifest['format']!r}, and this program reads {MANIFEST_FORMAT}"
        raise DataSetError([f"{MANIFEST}: {told}; export the data again"])
    return dict(manifest)


def _is_manifest(manifest: object) -> bool:
    files = manifest.get("files") if isinstance(manifest, dict) else None
    return (
        isinstance(manifest, dict)
        and isinstance(manifest.get("format"), int)
        and isinstance(files, dict)
        and all(isinstance(told, dict) and isinstance(told.get("sha256"), str) for told in files.values())
    )
