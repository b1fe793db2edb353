"""F19: how long 50 people wait for their answers to be stored while the data are exported again and again.

python -m tests.benchmarks.export_under_load [--crowd 2000]

The database already holds a crowd. Half a minute without exports and half a minute with them are compared.
"""

import argparse
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.crowd import write_crowd
from tests.benchmarks.load import ours
from tests.benchmarks.load.crowds import Crowd, send
from tests.benchmarks.load.generator import Plan
from tests.benchmarks.load.judging import judge
from tests.benchmarks.load.studies import NAME, build_load_study
from tests.faults.oracle import bound, evidence
from tests.web.servers import run
from webapp.stimuli.catalogue import Catalogue, current_bundle
from webapp.storage.database import open_database
from webapp.storage.scope import Scope

AT_ONCE = 50
THINK_S = 1.0
SECONDS = 30.0
MOST_RATIO = 2.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the numbers as JSON; return 0 if exports do not double the wait and nothing was lost."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--crowd", type=int, default=2000)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        built, instance = build_load_study(scratch), scratch / "instance"
        with ours.serve_ours(built, instance) as running:
            catalogue = Catalogue.open(current_bundle(instance, NAME))
            with open_database(instance / "xar.sqlite3", make=False) as database:
                write_crowd(database, catalogue.study, Scope(NAME, catalogue.version, "live"), options.crowd)
            alone = _answer(running, seed=1)
            num_exports, beside = _answer_beside_exports(running, scratch)
        stored = ours.stored_by_us(instance)
    judged = [judge(crowd, ours.told_to_us, stored) for crowd in (alone, beside)]
    waits = [crowd.centile_ms(95, "post") for crowd in (alone, beside)]
    counts = {
        "people stored before": options.crowd,
        "exports": num_exports,
        "p95_ms_alone": round(waits[0], 1),
        "p95_ms_beside_exports": round(waits[1], 1),
        "ratio": round(waits[1] / waits[0], 2),
        "answers": sum(one.answers for one in judged),
        "lost": sum(one.lost for one in judged),
        "errors": sum(one.errors for one in judged),
    }
    print(evidence("F19 export while people answer", counts, seeds=[1, 2], bound=bound(counts["answers"])))
    is_good = num_exports > 0 and waits[1] <= MOST_RATIO * waits[0]
    return 0 if is_good and all(one.is_clean for one in judged) else 1


def _answer(running: ours.Running, seed: int) -> Crowd:
    starts = running.starts(40 * AT_ONCE)
    plan = Plan("127.0.0.1", running.port, starts, ours.END, AT_ONCE, THINK_S, THINK_S, until_s=SECONDS, seed=seed)
    return send(plan, running.pid)


def _answer_beside_exports(running: ours.Running, scratch: Path) -> tuple[int, Crowd]:
    over = threading.Event()
    done: list[int] = []

    def _export() -> None:
        while not over.is_set():
            finished = run(running.instance, "export", str(scratch / f"export-{len(done)}"))
            assert finished.returncode == 0, finished.stderr
            done.append(1)

    exporting = threading.Thread(target=_export)
    exporting.start()
    try:
        crowd = _answer(running, seed=2)
    finally:
        over.set()
        exporting.join()
    return len(done), crowd


if __name__ == "__main__":
    sys.exit(main())
