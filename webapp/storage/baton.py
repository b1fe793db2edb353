"""One thread at a time works for participants, so that threads do not fight for Python's interpreter.

A thread gives the interpreter up at every question to the database and has to wait for it again while others compute:
a dozen times for a page, while it holds up everybody who wants to write, in all processes. Threads therefore wait for a
baton instead, once, and whoever has it lays it aside while waiting for anything but an answer of the database. It is no
lock that anything's correctness rests on: who does not get it soon goes on without.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

PATIENCE_S = 0.25
"""How long a thread waits for it."""


class Baton:
    """The baton of a process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._mine = threading.local()

    @property
    def is_mine(self) -> bool:
        """Whether this thread has it."""
        return getattr(self._mine, "is_held", False)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Have it, or go on without."""
        self._take()
        try:
            yield
        finally:
            self._give()

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Let others have it meanwhile."""
        was_mine = self.is_mine
        self._give()
        try:
            yield
        finally:
            if was_mine:
                self._take()

    def _take(self) -> None:
        self._mine.is_held = self._lock.acquire(timeout=PATIENCE_S)

    def _give(self) -> None:
        if self.is_mine:
            self._mine.is_held = False
            self._lock.release()
