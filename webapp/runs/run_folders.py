"""The folder of one run of an experiment: begun once, resumed after an interruption, never overwritten.

While a sweep goes on, the folder holds `settings.json` and a journal with a line for each finished unit of work. A
line counts only if it is whole. At the end come rows, tables, figures and the summary, last of all `run.json`: a
folder that has it is complete.
"""

import fcntl
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

Row = dict[str, Any]
Maker = dict[str, str]
"""Versions and processor that made some rows."""


class RunFolderError(ValueError):
    """A folder that cannot be written to; the message names it and says what to do."""


@dataclass(slots=True)
class RunFolder:
    """An open folder, locked for this process.

    Attributes:
        path: Where it is.
        finished: The rows of every finished unit by the unit's number.
        makers: What made each of these units, by the unit's number.
    """

    path: Path
    journal: IO[str]
    finished: dict[int, list[Row]] = field(default_factory=dict)
    makers: dict[int, Maker] = field(default_factory=dict)

    def keep(self, unit: int, rows: Sequence[Row], maker: Maker) -> None:
        """Put the rows of a finished unit on the disk, with what made them.

        Raises:
            RunFolderError: The disk does not take them.
        """
        try:
            self.journal.write(json.dumps({"unit": unit, "rows": rows, "maker": maker}, sort_keys=True) + "\n")
            self.journal.flush()
            os.fsync(self.journal.fileno())
        except OSError as error:
            raise RunFolderError(f"{self.path} cannot be written: {error.strerror}; what was kept is kept") from error
        self.finished[unit], self.makers[unit] = list(rows), maker

    @property
    def all_makers(self) -> list[Maker]:
        """What made the rows, each once."""
        told = {json.dumps(each, sort_keys=True) for each in self.makers.values()}
        return [json.loads(text) for text in sorted(told)]

    def complete(self, files: Mapping[str, bytes], about: Mapping[str, object]) -> None:
        """Write all that was found, then `run.json`, and forget the journal."""
        for name, content in files.items():
            _write(self.path / name, content)
        _write(self.path / _ABOUT, _as_json(about))
        (self.path / _JOURNAL).unlink()


def check_run_name(name: str) -> str:
    """Return the name of a run.

    Raises:
        RunFolderError: It cannot be the name of a folder.
    """
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}", name):
        raise RunFolderError(f"a run is named by up to 80 letters, digits, dots, dashes and underscores, not {name!r}")
    return name


@contextmanager
def open_run(path: Path, settings: Mapping[str, object]) -> Iterator[RunFolder]:
    """Begin a run, or go on with it if it was interrupted.

    Args:
        path: The run's folder, made if it is missing.
        settings: All that its rows depend on, ready for JSON.

    Raises:
        RunFolderError: The folder is complete, is another run's or no run's, is in use, or cannot be written.
    """
    settings = json.loads(_as_json(settings))
    try:
        path.mkdir(parents=True, exist_ok=True)
        _check(path, settings)
        journal = (path / _JOURNAL).open("a+", encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"{path} cannot be written: {error.strerror}") from error
    with journal:
        try:
            fcntl.flock(journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RunFolderError(f"{path} is in use by another process; wait for it, or give another --run") from error
        _check(path, settings)  # Again: it may have been completed meanwhile.
        if not (path / _SETTINGS).exists():
            _write(path / _SETTINGS, _as_json(settings))
        yield RunFolder(path, journal, *_read(journal))


def _check(path: Path, settings: Mapping[str, object]) -> None:
    if (path / _ABOUT).exists():
        raise RunFolderError(f"{path} holds a complete run and is never overwritten; give another --run")
    if not (path / _SETTINGS).exists():
        if any(entry.name not in {_JOURNAL, _draft_of(path / _SETTINGS).name} for entry in path.iterdir()):
            raise RunFolderError(f"{path} is not empty and holds no run; give another --run")
        return
    try:
        begun = json.loads((path / _SETTINGS).read_text(encoding="utf-8"))
    except ValueError:
        begun = None
    if not isinstance(begun, dict):
        raise RunFolderError(f"{path / _SETTINGS} cannot be read; remove the folder or give another --run")
    if begun != settings:
        name, was, now = _first_difference(begun, dict(settings))
        if name == "code":
            raise RunFolderError(f"{path} holds an unfinished run of another version of xar; give another --run")
        raise RunFolderError(
            f"{path} holds an unfinished run with other settings: {name} was {was!r} and is {now!r}; finish it as it "
            "was begun, or give another --run"
        )


def _first_difference(begun: Any, now: Any, name: str = "settings") -> tuple[str, Any, Any]:  # noqa: ANN401 - whatever JSON holds.
    if isinstance(begun, dict) and isinstance(now, dict):
        for key in sorted({*begun, *now}):
            if begun.get(key) != now.get(key):
                return _first_difference(begun.get(key), now.get(key), key)
    return name, begun, now


def _read(journal: IO[str]) -> tuple[dict[int, list[Row]], dict[int, Maker]]:
    """Return the finished units and their makers. A last line that an interruption cut off is taken away."""
    journal.seek(0)
    finished: dict[int, list[Row]] = {}
    makers: dict[int, Maker] = {}
    end = 0
    for line in iter(journal.readline, ""):
        try:
            unit = json.loads(line) if line.endswith("\n") else None
        except ValueError:
            unit = None
        if unit is None:
            break
        finished[unit["unit"]], makers[unit["unit"]] = unit["rows"], unit["maker"]
        end = journal.tell()
    journal.truncate(end)
    journal.seek(0, os.SEEK_END)
    return finished, makers


def _as_json(content: Mapping[str, object]) -> bytes:
    return (json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False) + "\n").encode()


def _draft_of(path: Path) -> Path:
    return path.with_name(f".{path.name}.part")


def _write(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    draft = _draft_of(path)
    with draft.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)


_ABOUT, _SETTINGS, _JOURNAL = "run.json", "settings.json", "journal.jsonl"
