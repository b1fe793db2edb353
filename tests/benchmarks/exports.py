"""Export a million ratings: how much memory, how long, and whether pandas and R read back what is stored.

python -m tests.benchmarks.exports [--ratings N] [--install-r]

The database is made in a temporary folder, with more than ratings in it. The export runs in a process of its own; its
increase of memory is its peak less what it holds before it begins. Pandas and R read every table with the types of its
description and write each cell as text again; the digests of these are compared with those of Python's own reader. R
is asked if it is there; as root, `--install-r` fetches it from Debian.
"""

import argparse
import csv
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

NUM_RATINGS = 1_000_000
MAX_MIB = 100.0
_ITEMS, _TRIALS, _EVENTS = 5, 4, 2
"""Per rated page: items; trials per participant; events per page."""
_ODD_ANSWERS = (
    "NA",
    "null",
    "-5",
    "=1+1",
    "'",
    'said "no", twice',
    "one\r\ntwo",
    " ",
    "1e5",
    "007",
    "ロボット",
    "#",
    "\t",
)
_START = datetime(2031, 3, 1, 9, 30, 0, 17, tzinfo=UTC)


def main() -> int:
    """Print what was measured and what was promised, and return 0 if all promises are kept."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--ratings", type=int, default=NUM_RATINGS)
    parser.add_argument("--install-r", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        instance, folder = Path(name) / "instance", Path(name) / "data"
        num_ratings = _fill(instance, options.ratings)
        measured = _measured(instance, folder)
        tables = sorted((folder / "data").glob("*.csv"))
        size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        print(f"{num_ratings:,} ratings: {measured['seconds']:.1f} s, {size / 2**20:.0f} MiB written")
        began = time.perf_counter()
        wanted = {path.name: _digest(_rows(path)) for path in tables}
        same = {"pandas": _read_by_pandas(tables) == wanted}
        print(f"pandas read {len(tables)} tables: {time.perf_counter() - began:.1f} s")
        if _has_r(install=options.install_r):
            began = time.perf_counter()
            same["R"] = _read_by_r(tables) == wanted
            print(f"R read {len(tables)} tables: {time.perf_counter() - began:.1f} s")
        else:
            print("R is not there, and was not asked.")
    kept = measured["mib"] <= MAX_MIB
    print(f"MiB of memory more than before{measured['mib']:29.1f}   promised at most {MAX_MIB:7.1f}   {_verdict(kept)}")
    for reader, is_same in same.items():
        print(f"read back equal by {reader:66} {_verdict(is_same)}")
    return 0 if kept and all(same.values()) else 1


def _verdict(kept: bool) -> str:
    return "kept" if kept else "BROKEN"


def _fill(instance: Path, num_ratings: int) -> int:
    """Make a database, and return how many ratings it holds."""
    from webapp.storage.database import open_database  # noqa: PLC0415 - the child, which is measured, loads its own.

    with open_database(instance / "xar.sqlite3") as database, database.write() as connection:
        driver: Any = connection.connection.driver_connection
        for number in range(1, num_ratings // (_ITEMS * _TRIALS) + 1):
            for table, rows in _person(number):
                holes = ", ".join("?" * len(rows[0]))
                driver.executemany(f"INSERT INTO {table} VALUES ({holes})", rows)  # noqa: S608 - ours.
    return number * _ITEMS * _TRIALS


def _person(number: int) -> Iterator[tuple[str, list[tuple[object, ...]]]]:
    at = (_START + timedelta(seconds=number)).strftime("%Y-%m-%d %H:%M:%S.%f")
    mode = "live" if number % 10 else "test"
    columns = (
        "(id, code, token_hash, mode, study, study_version, consent_version, language, translation, num_pages, "
        "consented_at, last_seen_at, completed_at, salt)"
    )
    key = (number, f"{number:010x}", f"{number:064x}", mode, "bench", "b" * 64, "1", "en", "original", _TRIALS + 1)
    yield f"participants {columns}", [(*key, at, at, at, f"{number:032x}")]
    trials = range(1, _TRIALS + 1)
    yield "trials", [(number, trial, "1", trial, _TRIALS, f"layout{trial}", "full", None) for trial in trials]
    pages = [(number, 1, "background", None, f"{number} 1", at)]
    yield "pages", [*pages, *((number, trial + 1, "rating", trial, f"{number} {trial + 1}", at) for trial in trials)]
    yield (
        "ratings",
        [
            (number, trial + 1, f"item{item}", 1 + (number + item) % 5, None if item == 0 else 1000 + number % 7000)
            for trial in trials
            for item in range(_ITEMS)
        ],
    )
    odd = _ODD_ANSWERS[number % len(_ODD_ANSWERS)]
    yield (
        "answers",
        [(number, 1, 1, name, "background", said, None, at) for name, said in (("age", "33"), ("words", odd))],
    )
    yield (
        "events",
        [
            (number, trial + 1, event, ("painted", "changed")[event % 2], "", str(event), 100 * event)
            for trial in trials
            for event in range(1, _EVENTS + 1)
        ],
    )


def _measured(instance: Path, folder: Path) -> dict[str, float]:
    words = [sys.executable, "-m", "tests.benchmarks.exports", str(instance), str(folder)]
    finished = subprocess.run(words, check=True, stdout=subprocess.PIPE)
    found: dict[str, float] = json.loads(finished.stdout)
    return found


def export_here(instance: Path, folder: Path) -> dict[str, float]:
    """Export in this process, and return what it took."""
    from webapp.storage.database import open_database  # noqa: PLC0415 - the parent stays small.
    from webapp.storage.dataset import export  # noqa: PLC0415
    from webapp.storage.wanted import AS_STORED  # noqa: PLC0415

    with open_database(instance / "xar.sqlite3") as database:
        before, began = _peak_mib(), time.perf_counter()
        export(database, folder, AS_STORED, datetime.now(UTC))
        return {"seconds": time.perf_counter() - began, "mib": _peak_mib() - before}


def _peak_mib() -> float:
    """The most memory that this process ever held at once."""
    import resource  # noqa: PLC0415 - There is none on Windows.

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def _rows(path: Path) -> Iterator[list[str]]:
    with path.open(encoding="utf-8", newline="") as file:
        yield from csv.reader(file)


def _digest(rows: Iterator[list[str]]) -> str:
    """Digest cells as text. Line breaks count as line feeds, as R has no others within a text."""
    digest = hashlib.sha256()
    for row in rows:
        line = "\x1f".join(row).replace("\r\n", "\n").replace("\r", "\n")
        digest.update(line.encode() + b"\x1e")
    return digest.hexdigest()


def _types(path: Path) -> dict[str, str]:
    described = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))["variableMeasured"]
    return {one["name"]: one["additionalType"].removeprefix("https://schema.org/") for one in described}


def _read_by_pandas(tables: list[Path]) -> dict[str, str]:
    from tests.unit.storage.readers import read_described  # noqa: PLC0415 - the parent stays small.

    def cells(path: Path) -> Iterator[list[str]]:
        frame, types = read_described(path), _types(path)
        for name, kind in types.items():
            if kind == "DateTime":
                frame[name] = frame[name].dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
            if kind == "Boolean":
                frame[name] = frame[name].map({True: "true", False: "false"})
        yield list(frame.columns)
        for row in frame.astype(object).where(frame.notna(), "").itertuples(index=False):
            yield [str(cell) for cell in row]

    return {path.name: _digest(cells(path)) for path in tables}


_R = r"""
arguments <- commandArgs(trailingOnly = TRUE)
classes <- strsplit(arguments[3], ",")[[1]]
table <- read.csv(arguments[1], na.strings = "", fileEncoding = "UTF-8", encoding = "UTF-8", check.names = FALSE,
                  colClasses = classes, quote = "\"", comment.char = "", strip.white = FALSE)
out <- file(arguments[2], open = "wb")
line <- function(cells) paste0(enc2utf8(do.call(paste, c(cells, sep = "\x1f"))), "\x1e")
told <- lapply(table, function(column) {
  text <- if (is.logical(column)) tolower(as.character(column)) else as.character(column)
  ifelse(is.na(text), "", text)
})
writeBin(charToRaw(paste0(line(as.list(names(table))), collapse = "")), out)
if (nrow(table) > 0) for (first in seq(1, nrow(table), by = 20000)) {
  rows <- first:min(nrow(table), first + 19999)
  writeBin(charToRaw(paste0(line(unname(lapply(told, function(column) column[rows]))), collapse = "")), out)
}
close(out)
"""
_CLASSES = {
    "Text": "character",
    "Integer": "integer",
    "Number": "numeric",
    "Boolean": "logical",
    "DateTime": "character",
}


def _has_r(*, install: bool) -> bool:
    if shutil.which("Rscript") is None and install and os.geteuid() == 0:
        subprocess.run(["/usr/bin/apt-get", "install", "-y", "--no-install-recommends", "r-base-core"], check=True)
    return shutil.which("Rscript") is not None


def _read_by_r(tables: list[Path]) -> dict[str, str]:
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as name:
        script, out = Path(name) / "read.R", Path(name) / "out"
        script.write_text(_R, encoding="utf-8")
        for path in tables:
            classes = ",".join(_CLASSES[kind] for kind in _types(path).values())
            words = ["Rscript", "--vanilla", str(script), str(path), str(out), classes]
            subprocess.run(words, check=True, env={**os.environ, "LC_ALL": "C.UTF-8"})
            found[path.name] = hashlib.sha256(out.read_bytes()).hexdigest()
    return found


if __name__ == "__main__":
    if len(sys.argv) == 3 and not sys.argv[1].startswith("-"):
        print(json.dumps(export_here(Path(sys.argv[1]), Path(sys.argv[2]))))
        sys.exit(0)
    sys.exit(main())
