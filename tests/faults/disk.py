"""A disk that forgets: files as APSW writes them, and what would be left of them if the power went now.

What was written since a file's last sync may be there or not, sector by sector; a file that was made or removed since
its folder's last sync may be there or not. SQLite assumes no less: that a sync waits for the disk, and that a write
touches no bytes beside it. The simulation tests the program's pragmas and where it commits, in APSW's SQLite.
"""

import os
import random
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import apsw

Fate = Literal["none", "first", "any"]
"""What of the unsynced writes has reached the disk: nothing, the first ones, or any sectors of them."""

SECTOR = 512
VFS_NAME = "forgetful"

_Change = tuple[int, bytes] | int
"""Bytes at an offset, or a new length."""


@dataclass(slots=True)
class _Content:
    """A file: what is on disk for sure, what was changed since, and whether the folder knows of it for sure."""

    durable: bytearray
    changes: list[_Change] = field(default_factory=list)
    has_entry: bool = True

    def left(self, fate: Fate, rng: random.Random) -> bytes:
        content = bytearray(self.durable)
        num_kept = {"none": 0, "first": rng.randint(0, len(self.changes)), "any": len(self.changes)}[fate]
        for change in self.changes[:num_kept]:
            for piece in _sectors(change):
                if fate == "first" or rng.random() < 0.5:
                    _apply(content, piece)
        return bytes(content)


class Disk:
    """The folder that is written through `VFS_NAME`, one at a time.

    Attributes:
        num_operations: How many writes, truncations, syncs and removals there were.
    """

    def __init__(self, folder: Path) -> None:
        self.num_operations = 0
        self._folder = folder
        self._lock = threading.RLock()
        self._files = {path.name: _Content(bytearray(path.read_bytes())) for path in folder.iterdir()}
        self._removed: dict[str, _Content] = {}
        self._plan: tuple[int, Callable[[], None]] | None = None

    def at_operation(self, number: int, action: Callable[[], None]) -> None:
        """Let something happen just before an operation."""
        self._plan = (number, action)

    def cut(self, target: Path, fate: Fate, rng: random.Random) -> None:
        """Write what is left of every file if the power goes now into an empty folder."""
        for name in {*self._files, *self._removed}:
            there = self._files.get(name)
            is_back = name in self._removed and (fate == "none" or rng.random() < 0.5)
            if is_back and (there is None or not there.has_entry):
                there = self._removed[name]
            elif there is not None and not there.has_entry and (fate == "none" or rng.random() < 0.5):
                there = None
            if there is not None and not name.endswith("-shm"):
                (target / name).write_bytes(there.left(fate, rng))

    def opened(self, name: str) -> None:
        """Notice a file, which is new if it was not there before."""
        with self._lock:
            self._files.setdefault(name, _Content(bytearray(), has_entry=False))

    def changed(self, name: str, change: _Change) -> None:
        """Note what is written before anybody says that it is on disk."""
        with self._lock:
            self._count()
            self._files[name].changes.append(change)

    def synced(self, name: str) -> None:
        """Put a file on disk for sure, and its folder with it where the file is new: so SQLite does on Unix."""
        with self._lock:
            self._count()
            content = self._files[name]
            for change in content.changes:
                _apply(content.durable, change)
            content.changes.clear()
            if not content.has_entry:
                self._sync_folder()

    def removed(self, name: str, *, sync_folder: bool) -> None:
        """Remove a file, for sure if its folder is synced."""
        with self._lock:
            self._count()
            content = self._files.pop(name, None)
            if content is not None and content.has_entry:
                self._removed[name] = content
            if sync_folder:
                self._sync_folder()

    def _sync_folder(self) -> None:
        self._removed.clear()
        for content in self._files.values():
            content.has_entry = True

    def _count(self) -> None:
        self.num_operations += 1
        if self._plan is not None and self.num_operations == self._plan[0]:
            self._plan[1]()


class _File(apsw.VFSFile):
    def __init__(self, disk: Disk, name: str | apsw.URIFilename, flags: list[int]) -> None:
        path = name.filename() if isinstance(name, apsw.URIFilename) else name
        self._disk, self._name = disk, Path(path).name
        super().__init__("", name, flags)
        disk.opened(self._name)

    def xWrite(self, data: bytes, offset: int) -> None:  # noqa: N802 - APSW's names
        self._disk.changed(self._name, (offset, bytes(data)))
        super().xWrite(data, offset)

    def xTruncate(self, newsize: int) -> None:  # noqa: N802
        self._disk.changed(self._name, newsize)
        super().xTruncate(newsize)

    def xSync(self, flags: int) -> None:  # noqa: ARG002, N802
        self._disk.synced(self._name)  # The simulated disk waits for no real one.


class Forgetful(apsw.VFS):
    """The default file system, with everything that changes files told to a disk."""

    def __init__(self, disk: Disk) -> None:
        self._disk = disk
        super().__init__(VFS_NAME, "")

    def xOpen(self, name: str | apsw.URIFilename | None, flags: list[int]) -> apsw.VFSFile:  # noqa: N802
        """Open a file; temporary ones have no name, and no power cut matters to them."""
        return apsw.VFSFile("", None, flags) if name is None else _File(self._disk, name, flags)

    def xDelete(self, filename: str, syncdir: bool) -> None:  # noqa: N802
        """Remove a file."""
        if os.path.exists(filename):  # noqa: PTH110
            self._disk.removed(Path(filename).name, sync_folder=bool(syncdir))
        super().xDelete(filename, syncdir)


def _apply(content: bytearray, change: _Change) -> None:
    if isinstance(change, int):
        del content[change:]
        return
    offset, data = change
    content.extend(bytes(max(0, offset - len(content))))
    content[offset : offset + len(data)] = data


def _sectors(change: _Change) -> list[_Change]:
    if isinstance(change, int):
        return [change]
    offset, data = change
    pieces: list[_Change] = []
    while data:
        size = SECTOR - offset % SECTOR
        pieces.append((offset, data[:size]))
        offset, data = offset + size, data[size:]
    return pieces
