"""The files in results/evidence: one for each measurement, written by `python -m tests.evidence.record`."""

import json
import os
import platform
import shutil
import sqlite3
import subprocess
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tests.conftest import ROOT
from tests.postgres import binaries

FOLDER = ROOT / "results/evidence"
PACKAGES = ("flask", "werkzeug", "waitress", "gunicorn", "sqlalchemy", "psycopg", "jinja2")


@dataclass(frozen=True, slots=True)
class Result:
    """A measurement as it was made.

    Attributes:
        told: What the measuring program printed, one object for each of its lines of JSON.
        status: Its exit status; 0 if everything was as promised.
        command: How it was run.
        date: When it ended, UTC, to the minute.
        commit: Of the program; with `+` if files had been changed since.
        machine: What it ran on.
        versions: Of Python, SQLite, PostgreSQL and packages.
        note: What else one should know, such as that other work ran on the machine.
    """

    told: tuple[Mapping[str, Any], ...]
    status: int
    command: str
    date: str
    commit: str
    machine: str
    versions: Mapping[str, str]
    note: str = ""


def made(told: list[Mapping[str, Any]], status: int, command: str, note: str) -> Result:
    """Put a result together with its surroundings as they are now."""
    return Result(
        told=tuple(told),
        status=status,
        command=command,
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M"),
        commit=_commit(),
        machine=_machine(),
        versions={"Python": platform.python_version(), "SQLite": sqlite3.sqlite_version}
        | {"PostgreSQL": _postgres()}
        | {name: version(name) for name in PACKAGES},
        note=note,
    )


def write_result(name: str, result: Result, folder: Path = FOLDER) -> Path:
    """Write a result, in place of an earlier one."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.json"
    path.write_text(json.dumps(asdict(result), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path


def read_results(folder: Path = FOLDER) -> dict[str, Result]:
    """Return every result by name."""
    found = {}
    for path in sorted(folder.glob("*.json")):
        content = json.loads(path.read_text(encoding="utf-8"))
        found[path.stem] = Result(**content | {"told": tuple(content["told"])})
    return found


def _commit() -> str:
    commit = _git("rev-parse", "--short=12", "HEAD")
    return f"{commit}+" if _git("status", "--porcelain", "--", "webapp", "templates", "static") else commit


def _git(*words: str) -> str:
    git = shutil.which("git")
    if git is None:
        raise FileNotFoundError("git is not on the path; a result names its commit")
    return subprocess.run([git, *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def _postgres() -> str:
    told = subprocess.run([binaries() / "postgres", "--version"], check=True, capture_output=True, text=True).stdout
    return told.split()[2]


def _machine() -> str:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{os.cpu_count()} processors ({platform.machine()}), {memory:.0f} GiB, {platform.system()}"
