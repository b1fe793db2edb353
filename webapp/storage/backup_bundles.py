"""The bundles that data refer to, kept beside backups and brought back with them.

A bundle is named after its content, so one copy serves all backups of a folder.
"""

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

from webapp.stimuli.bundle_files import bundle_version
from webapp.stimuli.publication import lock, point_at
from webapp.storage.backup_manifests import BackupError

FOLDER = "bundles"
_POINTER = "published-"


def published_versions(instance: Path) -> dict[str, str]:
    """Return the published version of each study of an instance."""
    pointers = sorted((instance / FOLDER).glob(f"{_POINTER}*"))
    return {
        pointer.name.removeprefix(_POINTER): pointer.read_text(encoding="ascii").strip()
        for pointer in pointers
        if "." not in pointer.name
    }


def bundle_problems(folder: Path, versions: Iterable[str]) -> list[str]:
    """Say which bundles are missing or changed.

    Args:
        folder: Of bundles.
        versions: Which must be there.
    """
    problems = []
    for version in versions:
        if not (folder / version).is_dir():
            problems.append(f"the bundle {version} is missing in {folder}")
        elif bundle_version(folder / version) != version:
            problems.append(f"the bundle {folder / version} was changed")
    return problems


def copy_bundles(source: Path, target: Path, versions: Iterable[str]) -> None:
    """Copy bundles into another folder of bundles, each whole or not at all; what is there stays.

    Raises:
        BackupError: One is missing or was changed.
    """
    wanted = [version for version in versions if not (target / version).is_dir()]
    problems = bundle_problems(source, wanted)
    if problems:
        raise BackupError("; ".join(problems))
    for version in wanted:
        target.mkdir(mode=0o700, parents=True, exist_ok=True)
        draft = target / f".{version}.partial"
        if draft.exists():
            shutil.rmtree(draft)
        shutil.copytree(source / version, draft, copy_function=shutil.copyfile)
        for path in (draft, *draft.rglob("*")):
            path.chmod(0o700 if path.is_dir() else 0o600)
        draft.rename(target / version)


def publish_again(instance: Path, published: Mapping[str, str]) -> None:
    """Let the versions that were published be so again, where no other one is."""
    there = published_versions(instance)
    for study, version in published.items():
        if study not in there and (instance / FOLDER / version).is_dir():
            lock(instance / FOLDER / version)
            point_at(instance, study, version)
