"""The version of a study that is frozen for its participants, and the refusal to serve any other under live data.

A published bundle is an ordinary one that nothing can change any more; a pointer names it. Publishing again moves the
pointer and leaves the earlier versions where they are, since rows refer to them.

A web worker asks here, so nothing heavy is imported.
"""

import json
import re
import tempfile
from collections import Counter
from pathlib import Path

from webapp.stimuli.catalogue import BundleError
from webapp.stimuli.program import Program, running_program

MANIFEST = "manifest.json"
_LISTED = ("sources/", "catalogue.json", "weights.safetensors")
"""What is told file by file when it changes; of pictures and tables only how many did."""


def published_bundle(instance: Path, study: str) -> Path:
    """Return the folder of the published version of a study.

    Args:
        instance: The instance folder.
        study: The study's name.

    Raises:
        BundleError: None was published.
    """
    pointer = _pointer(instance, study)
    try:
        version = pointer.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        raise BundleError(
            f"study {study!r} is not published in {instance}; run `xar study publish` with its folder"
        ) from None
    if not re.fullmatch(r"[0-9a-f]{64}", version):
        raise BundleError(f"{pointer} does not name a bundle; run `xar study publish` with its folder")
    return instance / "bundles" / version


def check_published(instance: Path, study: str) -> Path:
    """Return the folder of the published version, which the program that runs may show to participants.

    Raises:
        BundleError: None was published, or it was published with other code: pages could differ from those that its
            version stands for.
    """
    folder = published_bundle(instance, study)
    published, running = program_of(folder), running_program()
    if published != running:
        raise BundleError(
            f"study {study!r} was published with program {_short(published)}, and this is {_short(running)}; "
            f"run `xar study publish` with its folder for a new version, or the program that it was published with"
        )
    return folder


def program_of(folder: Path) -> Program:
    """Return the program that a bundle belongs to.

    Raises:
        BundleError: The bundle does not say so.
    """
    try:
        return Program(**json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["program"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BundleError(f"{folder} does not say which program it was built by ({error!r}); build it again") from None


def changes(before: Path, after: Path) -> tuple[str, ...]:
    """Say what differs between two bundles: the study's files one by one, of the pictures and tables how many.

    Args:
        before: A bundle.
        after: A later one.

    Returns:
        Lines such as `sources/study/study.toml changed` or `3 pictures added`; empty if nothing differs.
    """
    old, new = _contents(before), _contents(after)
    told: list[str] = []
    counts: Counter[tuple[str, str]] = Counter()
    for name in sorted(old.keys() | new.keys()):
        if old.get(name) == new.get(name) or name == MANIFEST:
            continue
        what = "removed" if name not in new else "added" if name not in old else "changed"
        if name.startswith(_LISTED):
            told.append(f"{name} {what}")
        else:
            counts[name.partition("/")[0], what] += 1
    told += [f"{number} of {part}/ {what}" for (part, what), number in sorted(counts.items())]
    if program_of(before) != program_of(after):
        told.append(f"program {_short(program_of(before))} is now {_short(program_of(after))}")
    return tuple(told)


def lock(folder: Path) -> None:
    """Take away every right to write to a bundle."""
    for path in (*folder.rglob("*"), folder):
        path.chmod(0o555 if path.is_dir() else 0o444)


def unlock(folder: Path) -> None:
    """Give the owner back the right to change a bundle, to remove a damaged one."""
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o700 if path.is_dir() else 0o600)


def point_at(instance: Path, study: str, version: str) -> None:
    """Let a version be the published one; readers see the one before or this one, nothing between."""
    pointer = _pointer(instance, study)
    with tempfile.NamedTemporaryFile(dir=pointer.parent, prefix=f"{pointer.name}.", delete=False) as draft:
        draft.write(f"{version}\n".encode())
    Path(draft.name).replace(pointer)


def _pointer(instance: Path, study: str) -> Path:
    return instance / "bundles" / f"published-{study}"


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _short(program: Program) -> str:
    return f"{program.version} ({program.digest[:12]})"
