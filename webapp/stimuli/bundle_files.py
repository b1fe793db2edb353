"""The files of a bundle: what they hash to, and which bundle of a study was built last."""

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path

_DIGEST = re.compile(r"[0-9a-f]{64}")


class BundleError(ValueError):
    """A bundle that is missing, damaged, or made by another version of the program."""


def bundle_version(folder: Path) -> str:
    """Hash a bundle's content: the path and the bytes of every file, in the order of the paths.

    Returns:
        SHA-256 in hexadecimal.
    """
    return version_of(file_digests(folder))


def file_digests(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file by its path within a bundle, in the order of the paths."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def version_of(digests: Mapping[str, str]) -> str:
    """Return the version of a bundle with these files, given as `file_digests` does."""
    lines = (f"{content}  {name}\n" for name, content in digests.items())
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def current_bundle(instance: Path, study: str) -> Path:
    """Return the folder of the bundle that was built last for a study.

    Args:
        instance: The instance folder.
        study: The study's name.

    Raises:
        BundleError: No bundle was built.
    """
    pointer = instance / "bundles" / f"current-{study}"
    try:
        version = pointer.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        raise BundleError(f"there is no bundle of study {study!r} in {instance}; run `xar build`") from None
    if not _DIGEST.fullmatch(version):
        raise BundleError(f"{pointer} does not name a bundle; run `xar build`")
    return instance / "bundles" / version
