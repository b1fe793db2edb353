"""200 participants at human pace, five seconds between a page and its answer: how long they wait, and what is stored.

python -m tests.benchmarks.human_pace [--seconds 60] [--full]

With `--full` it takes 20 minutes. Whoever finishes is followed by the next one.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.load import ours
from tests.benchmarks.load.crowds import send
from tests.benchmarks.load.generator import Plan
from tests.benchmarks.load.judging import judge
from tests.benchmarks.load.studies import build_load_study
from tests.faults.oracle import bound, evidence

AT_ONCE = 200
THINK_S = 5.0
ARRIVE_S = 20.0
FULL_S = 1200
MOST_P95_MS, MOST_P99_MS = 50, 150


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the numbers as JSON; return 0 if nobody waited too long and nothing was lost."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--full", action="store_true", help="20 minutes")
    options = parser.parse_args(arguments)
    until_s = FULL_S if options.full else options.seconds
    with tempfile.TemporaryDirectory() as name:
        built, instance = build_load_study(Path(name)), Path(name, "instance")
        with ours.serve_ours(built, instance) as running:
            starts = running.starts(AT_ONCE * (1 + until_s // 20))
            plan = Plan("127.0.0.1", running.port, starts, ours.END, AT_ONCE, THINK_S, ARRIVE_S, until_s=until_s)
            crowd = send(plan, running.pid)
        judged = judge(crowd, ours.told_to_us, ours.stored_by_us(instance))
    waits = {f"p{centile}_ms": round(crowd.centile_ms(centile), 1) for centile in (50, 95, 99)}
    counts = {"seconds": round(crowd.took_s), **waits, **judged.to_json()}
    limits = {"p95_ms": MOST_P95_MS, "p99_ms": MOST_P99_MS}
    print(evidence("human pace, 200 people", counts, seeds=[1], bound=bound(judged.answers), limits=limits))
    is_quick = all(counts[name] <= most for name, most in limits.items())
    return 0 if is_quick and judged.is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
