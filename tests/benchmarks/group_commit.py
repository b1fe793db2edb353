"""Time how many pages per second sixteen threads store with and without shared commits; fail if sharing is slower.

python -m tests.benchmarks.group_commit [--threads 16] [--people 32]

Everything is the program's own: `enrol` and `store_page` on a database in the folder for temporary files. The time of a
flush is that of the disk underneath; what is shared shows in the flushes per page. Both ways take turns, three times.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

from tests.unit.storage.people import enrol_somebody, pages_of, send
from webapp.storage.database import Database
from webapp.storage.group_commit import MAX_MEMBERS, GroupCommit

NUM_RUNS = 3


def main(arguments: Sequence[str] | None = None) -> int:
    """Print pages per second and commits per page; return 0 if sharing commits costs nothing."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--threads", type=int, default=16)
    parser.add_argument("--people", type=int, default=32)
    options = parser.parse_args(arguments)
    rates: dict[int, list[float]] = {1: [], MAX_MEMBERS: []}
    with tempfile.TemporaryDirectory() as scratch:
        print(f"a flush of this disk takes {1000 * flush_s(Path(scratch, 'flush')):.2f} ms")
        for _ in range(NUM_RUNS):
            for most, found in rates.items():
                rate, per_page = measure(Path(scratch), options.threads, options.people, most)
                found.append(rate)
                print(f"at most {most:2} turns share a commit: {rate:6.0f} pages/s, {per_page:.2f} commits per page")
    alone, shared = (statistics.median(found) for found in rates.values())
    print(f"sharing stores {shared / alone:.2f} times as many pages per second; promised at least 0.90")
    return 0 if shared >= 0.9 * alone else 1


def measure(scratch: Path, num_threads: int, num_people: int, max_members: int) -> tuple[float, float]:
    """Let people send all their pages, and return the pages per second and the commits per page."""
    with tempfile.TemporaryDirectory(dir=scratch) as folder, closing(Database(Path(folder, "xar.sqlite3"))) as database:
        database.upgrade()
        database._turns = turns = GroupCommit(database.edition.writing, max_members)
        people = [enrol_somebody(database) for _ in range(num_people)]
        num_pages = len(pages_of(database, people[0]))
        turns.num_commits, began = 0, time.perf_counter()
        with ThreadPoolExecutor(num_threads) as pool:
            list(
                pool.map(lambda person: [send(database, person, number) for number in range(1, num_pages + 1)], people)
            )
        took = time.perf_counter() - began
        return num_people * num_pages / took, turns.num_commits / (num_people * num_pages)


def flush_s(path: Path) -> float:
    """Return the median time of a small write and its flush, in seconds."""

    seconds = []
    with path.open("wb", buffering=0) as file:
        for _ in range(50):
            began = time.perf_counter()
            file.write(bytes(4096))
            os.fsync(file.fileno())
            seconds.append(time.perf_counter() - began)
    return statistics.median(seconds)


if __name__ == "__main__":
    sys.exit(main())
