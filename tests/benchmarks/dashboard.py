"""Time the dashboard's numbers with ten thousand participants, and weigh what is kept of them.

python -m tests.benchmarks.dashboard

Once with the paper's study (11 pages) and once with everything that can stand around a trial. The numbers are taken in
a process of their own, which holds what a web worker holds of them and nothing else.
"""

import gc
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from tests.benchmarks.crowd import write_crowd
from tests.unit.storage.histories import EVERY_RULE
from tests.unit.storage.people import DRIVING, STUDY, content_of, pages_of
from webapp.storage.answers import store_page
from webapp.storage.database import Database, open_database
from webapp.storage.live import LiveNumbers
from webapp.storage.participants import find_participant
from webapp.storage.scope import Scope
from webapp.study.protocol import Study

NUM_PEOPLE = 10_000
NUM_CHANGES = 50
STUDIES = {"sakai2021": STUDY, "understanding": DRIVING}

LIMITS = {
    "first look": 15_000.0,
    "again, nothing new": 100.0,
    "after 50 changes": 150.0,
    "list, first page": 100.0,
    "list, after 50 changes": 150.0,
    "list, flagged": 100.0,
    "list, stalled": 100.0,
    "list, search": 100.0,
    "a person": 50.0,
    "MiB kept": 60.0,
}
"""Milliseconds, the last entry apart. A page of the dashboard has 300, of which the numbers may take half."""


def main() -> int:
    """Print a table of what was measured and what may be, and return 0 if all limits are kept."""
    kept = True
    print(f"{'':13} {f'{NUM_PEOPLE:,} participants':24} |  measured |   at most")
    for name in STUDIES:
        measured = _measured(name)
        for what, limit in LIMITS.items():
            is_kept = measured[what] <= limit
            kept = kept and is_kept
            print(f"{name:13} {what:24} | {measured[what]:9.1f} | {limit:9.1f}  {'kept' if is_kept else 'BROKEN'}")
    return 0 if kept else 1


def measure(path: Path, name: str, now: datetime) -> dict[str, float]:
    """Take all numbers in this process."""
    study = STUDIES[name].model_copy(update={"quality": EVERY_RULE})
    scope = Scope(study.name, "v1", "live")
    with open_database(path, make=False) as database:
        before = _kept_mib()
        numbers = LiveNumbers(database)
        found = {"first look": _milliseconds(lambda: numbers.overview(study, scope, now))}
        found["MiB kept"] = _kept_mib() - before
        found["again, nothing new"] = _median(lambda: numbers.overview(study, scope, now))
        found["after 50 changes"] = _after_changes(
            database, numbers, study, scope, now, lambda: numbers.overview(study, scope, now)
        )
        found["list, after 50 changes"] = _after_changes(
            database, numbers, study, scope, now, lambda: numbers.people(study, scope, now)
        )
        found["list, first page"] = _median(lambda: numbers.people(study, scope, now))
        found["list, flagged"] = _median(lambda: numbers.people(study, scope, now, flagged=True))
        found["list, stalled"] = _median(lambda: numbers.people(study, scope, now, state="stalled"))
        found["list, search"] = _median(lambda: numbers.people(study, scope, now, search="abc"))
        code = numbers.people(study, scope, now, state="completed").lines[0].code
        found["a person"] = _median(lambda: numbers.person(study, scope, code, now))
        assert numbers.overview(study, scope, now) == LiveNumbers(database).overview(study, scope, now)
    return found


def _after_changes(
    database: Database, numbers: LiveNumbers, study: Study, scope: Scope, now: datetime, look: Callable[[], object]
) -> float:
    times = []
    for _ in range(3):
        _change(database, numbers, study, scope, now)
        times.append(_milliseconds(look))
    return statistics.median(times)


def _change(database: Database, numbers: LiveNumbers, study: Study, scope: Scope, now: datetime) -> None:
    """Let people who may still go on send a page each."""
    lines = numbers.people(study, scope, now, state="stalled", per_page=NUM_PEOPLE).lines
    for line in [line for line in lines if line.progress + 1 < line.num_pages][:NUM_CHANGES]:
        details = numbers.person(study, scope, line.code, now)
        assert details is not None
        person = find_participant(database, f"{details.id:064x}")
        assert person is not None
        page = pages_of(database, person, study)[person.num_stored]
        nonce = f"{line.code} {page.number}"
        assert (
            store_page(database, person, page, nonce, content_of(page, 3, study), now - timedelta(days=1)) == "accept"
        )


def _kept_mib() -> float:
    gc.collect()
    status = Path("/proc/self/status").read_text(encoding="ascii")
    (line,) = [line for line in status.splitlines() if line.startswith("VmRSS")]
    return int(line.split()[1]) / 2**10


def _median(action: Callable[[], object]) -> float:
    return statistics.median(_milliseconds(action) for _ in range(5))


def _milliseconds(action: Callable[[], object]) -> float:
    began = time.perf_counter()
    action()
    return 1000 * (time.perf_counter() - began)


def _measured(name: str) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "instance" / "xar.sqlite3"
        with open_database(path) as database:
            began = time.perf_counter()
            study = STUDIES[name]
            now = write_crowd(database, study, Scope(study.name, "v1", "live"), NUM_PEOPLE)
            print(f"{name:13} written in {time.perf_counter() - began:.0f} s, {path.stat().st_size / 2**20:.0f} MiB")
        words = [sys.executable, "-m", "tests.benchmarks.dashboard", str(path), name, now.isoformat()]
        finished = subprocess.run(words, check=True, stdout=subprocess.PIPE)
    found: dict[str, Any] = json.loads(finished.stdout)
    return found


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(measure(Path(sys.argv[1]), sys.argv[2], datetime.fromisoformat(sys.argv[3]))))
        sys.exit(0)
    sys.exit(main())
