"""F20 and memory: 50 people at five seconds' think time, and what the server's memory, files and journal do meanwhile.

python -m tests.benchmarks.long_soak [--minutes 5] [--full]

With `--full` it takes two hours. Drift is the resident memory at the end against that after the first tenth.
"""

import argparse
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.load import ours
from tests.benchmarks.load.crowds import send
from tests.benchmarks.load.generator import Plan
from tests.benchmarks.load.judging import judge
from tests.benchmarks.load.processes import Footprint, footprint
from tests.benchmarks.load.studies import build_load_study
from tests.faults.oracle import bound, evidence

AT_ONCE = 50
THINK_S = 5.0
FULL_MINUTES = 120
MEGABYTE = 1e6
LIMITS = {"rss_drift_percent": 5, "file_drift": 0, "largest_journal_mb": 64, "p99_ms": 250, "largest_rss_mb": 90}
_EVERY_S = 2.0


class Watch(threading.Thread):
    """Measures a server again and again.

    Attributes:
        seen: What it had, in order.
        largest_journal: Bytes of the database's journal at most.
    """

    def __init__(self, pid: int, instance: Path) -> None:
        super().__init__(daemon=True)
        self.seen: list[Footprint] = []
        self.largest_journal = 0
        self._pid, self._instance, self._over = pid, instance, threading.Event()

    def run(self) -> None:
        """Measure until told to stop."""
        while not self._over.wait(_EVERY_S):
            self.seen.append(footprint(self._pid))
            for journal in self._instance.glob("xar.sqlite3-*"):
                try:
                    self.largest_journal = max(self.largest_journal, journal.stat().st_size)
                except FileNotFoundError:  # A rollback journal is gone with the commit.
                    continue

    def stop(self) -> None:
        """Stop measuring."""
        self._over.set()
        self.join()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the numbers as JSON; return 0 if all are within their limits and nothing was lost."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--full", action="store_true", help="two hours")
    options = parser.parse_args(arguments)
    until_s = 60.0 * (FULL_MINUTES if options.full else options.minutes)
    with tempfile.TemporaryDirectory() as name:
        built, instance = build_load_study(Path(name)), Path(name, "instance")
        with ours.serve_ours(built, instance) as running:
            at_start = footprint(running.pid)
            watch = Watch(running.pid, instance)
            watch.start()
            starts = running.starts(AT_ONCE * (1 + int(until_s) // 20))
            plan = Plan(
                "127.0.0.1", running.port, starts, ours.END, AT_ONCE, THINK_S, arrive_s=THINK_S, until_s=until_s
            )
            crowd = send(plan, running.pid)
            watch.stop()
            time.sleep(_EVERY_S)
            at_end = footprint(running.pid)
        judged = judge(crowd, ours.told_to_us, ours.stored_by_us(instance))
    early = watch.seen[len(watch.seen) // 10]
    counts = {
        "minutes": round(crowd.took_s / 60, 1),
        "rss_at_start_mb": round(at_start.largest_rss / MEGABYTE, 1),
        "largest_rss_mb": round(max(one.largest_rss for one in watch.seen) / MEGABYTE, 1),
        "pss_at_end_mb": round(at_end.pss / MEGABYTE, 1),
        "rss_drift_percent": round(100 * (at_end.largest_rss / early.largest_rss - 1), 2),
        "file_drift": watch.seen[-1].num_files - early.num_files,
        "largest_journal_mb": round(watch.largest_journal / MEGABYTE, 2),
        "p99_ms": round(crowd.centile_ms(99), 1),
        **judged.to_json(),
    }
    print(evidence("F20 soak", counts, seeds=[1], bound=bound(judged.answers), limits=LIMITS))
    return 0 if judged.is_clean and all(counts[name] <= most for name, most in LIMITS.items()) else 1


if __name__ == "__main__":
    sys.exit(main())
