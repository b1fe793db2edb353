"""100 people who arrive within a second, as when a recruiter opens a study, and go on without thinking.

python -m tests.benchmarks.arrival_burst
"""

import sys
import tempfile
from pathlib import Path

from tests.benchmarks.load import ours
from tests.benchmarks.load.crowds import send
from tests.benchmarks.load.generator import Plan
from tests.benchmarks.load.judging import judge
from tests.benchmarks.load.studies import build_load_study
from tests.faults.oracle import bound, evidence

PEOPLE = 100
MOST_P95_MS, MOST_P99_MS = 500, 1000


def main() -> int:
    """Print the numbers as JSON; return 0 if nobody waited too long and nothing was lost."""
    with tempfile.TemporaryDirectory() as name:
        built, instance = build_load_study(Path(name)), Path(name, "instance")
        with ours.serve_ours(built, instance) as running:
            plan = Plan("127.0.0.1", running.port, running.starts(PEOPLE), ours.END, PEOPLE, arrive_s=1.0)
            crowd = send(plan, running.pid)
        judged = judge(crowd, ours.told_to_us, ours.stored_by_us(instance))
    waits = {f"p{centile}_ms": round(crowd.centile_ms(centile), 1) for centile in (50, 95, 99)}
    counts = {**waits, "answers_per_s": round(judged.answers / crowd.took_s, 1), **judged.to_json()}
    limits = {"p95_ms": MOST_P95_MS, "p99_ms": MOST_P99_MS}
    print(evidence("burst of 100 arrivals", counts, seeds=[1], bound=bound(judged.answers), limits=limits))
    is_quick = all(counts[name] <= most for name, most in limits.items())
    return 0 if is_quick and judged.is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
