"""Where the numbers of a report come from: files with their hashes, the program, versions, and what was asked for."""

import hashlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version

from webapp.stimuli.program import running_program

_PACKAGES = ("xar", "numpy", "scipy", "pandas", "statsmodels", "matplotlib")


@dataclass(frozen=True, slots=True)
class Origin:
    """What decides every byte of a report. It knows no paths and no times.

    Attributes:
        files: SHA-256 in hexadecimal of every file that was read, by its name within the data set.
        code: The hash of this program.
        versions: Of Python and the packages that compute and draw.
        asked: The options that choose rows or change what is refused.
        notes: What is to be said of the files: what was changed or left out.
        differences: In which ways files and choice of people differ from the export and the declared rules.
    """

    files: Mapping[str, str]
    code: str
    versions: Mapping[str, str]
    asked: Mapping[str, object]
    notes: tuple[str, ...] = ()
    differences: tuple[str, ...] = ()

    @property
    def input_hash(self) -> str:
        """One hash for all files that were read."""
        lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(self.files.items()))
        return hashlib.sha256(lines.encode()).hexdigest()

    def settings(self) -> dict[str, object]:
        """Return all of it, ready for JSON."""
        return {
            "analysis": dict(self.asked),
            "input": dict(sorted(self.files.items())),
            "code": self.code,
            "versions": dict(self.versions),
        }


def origin_of(
    digests: Mapping[str, str],
    asked: Mapping[str, object],
    notes: Sequence[str] = (),
    differences: Sequence[str] = (),
) -> Origin:
    """Return the origin of a report that this program makes.

    Args:
        digests: SHA-256 of every file that was read, by its name within the data set.
        asked: The options.
        notes: What is to be said of the files.
        differences: From the export and the declared rules.
    """
    versions = {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}
    return Origin(digests, running_program().digest, versions, asked, tuple(notes), tuple(differences))
