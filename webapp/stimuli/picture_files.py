"""The pictures of a bundle, sent only as they were built: a picture's name is the hash of its bytes.

A browser keeps what it was sent for ever, so a file that was changed under a running server must not leave it.
"""

import hashlib
import os
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

_SETTLED_NS = 1_000_000_000
"""A file that was changed within this time may change once more without looking any different."""

_State = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture.

    Attributes:
        content: The bytes of a PNG.
        changed_at: When its file was written.
    """

    content: bytes
    changed_at: datetime


class PictureFiles:
    """The pictures in a folder. Threads may share it.

    Args:
        folder: Holds `<digest>.png`.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._right: dict[str, _State] = {}

    def read(self, digest: str) -> Picture:
        """Return a picture; it is hashed once for each state of its file.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is not the picture of this digest any more.
        """
        with (self._folder / f"{digest}.png").open("rb") as file:
            # Before the bytes: of a file that changes meanwhile, this state is never met again.
            found = os.fstat(file.fileno())
            content = file.read()
        state = (found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns)
        if self._right.get(digest) != state:
            if hashlib.sha256(content).hexdigest() != digest:
                raise ValueError(f"pictures/{digest}.png was changed")
            if time.time_ns() - max(found.st_mtime_ns, found.st_ctime_ns) > _SETTLED_NS:
                self._right[digest] = state
        return Picture(content, datetime.fromtimestamp(found.st_mtime, UTC))
