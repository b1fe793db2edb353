"""What one check found."""

from dataclasses import asdict, dataclass
from typing import Literal

Status = Literal["ok", "warning", "problem"]


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check found.

    Attributes:
        check: What was looked at.
        status: Whether it is as it should be. A problem puts data at risk, or will.
        told: What was found.
        wish: What to do; empty where nothing is to be done.
    """

    check: str
    status: Status
    told: str
    wish: str = ""

    def to_json(self) -> dict[str, str]:
        """Return plain JSON values."""
        return asdict(self)


def worst(check: str, findings: list[Finding], well: str) -> list[Finding]:
    """Return the findings, or one that all is well if there are none."""
    return findings or [Finding(check, "ok", well)]
