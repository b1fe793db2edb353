"""Which program this is: its version, and a digest of all of it that runs or that a browser gets.

A web worker asks it too, so it imports nothing heavy.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]


@dataclass(frozen=True, slots=True)
class Program:
    """A state of this program's code.

    Attributes:
        version: As released.
        digest: SHA-256 in hexadecimal over the paths and bytes of the code, templates and static files.
    """

    version: str
    digest: str

    def to_json(self) -> dict[str, str]:
        """Return plain JSON values, which `Program(**content)` reads back."""
        return asdict(self)


@cache
def running_program() -> Program:
    """Return the program as it lies on the disk when this is first asked; studies do not count, which are data."""
    digest = hashlib.sha256()
    for root, file in sorted(_files(), key=lambda found: found[1].relative_to(found[0]).as_posix()):
        content = hashlib.sha256(file.read_bytes()).hexdigest()
        digest.update(f"{content}  {file.relative_to(root).as_posix()}\n".encode())
    return Program(version("xar"), digest.hexdigest())


def _files() -> Iterator[tuple[Path, Path]]:
    """Yield each file after the folder that its path counts from, which is the same wherever it is installed."""
    for ending in ("py", "toml"):
        found = (file for file in _PACKAGE.rglob(f"*.{ending}") if file.relative_to(_PACKAGE).parts[0] != "studies")
        yield from ((_PACKAGE.parent, file) for file in found)
    resources = _PACKAGE if (_PACKAGE / "templates").is_dir() else _PACKAGE.parent
    for part in ("templates", "static"):
        yield from ((resources, file) for file in (resources / part).rglob("*") if file.is_file())
