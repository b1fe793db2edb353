"""Time the two learning experiments at the paper's settings, and fail if they take more than 15 minutes together.

python -m tests.benchmarks.sweeps

Ten agents in each condition of `usefulness` and `count`, two worker processes, from nothing to the written summary. It
is the wall clock that is promised, so run it on a machine with two free cores.
"""

import sys
import tempfile
import time
from pathlib import Path
from types import ModuleType

from webapp.runs.run_folders import open_run
from webapp.simulations import count, usefulness
from webapp.simulations.schedulers import Scheduler

PROMISED_MINUTES = 15.0
WORKERS = 2


def main() -> int:
    """Print the minutes and what was promised, and return 0 if the promise is kept."""
    with tempfile.TemporaryDirectory() as folder:
        minutes = [minutes_of(experiment, Path(folder)) for experiment in (usefulness, count)]
    together = sum(minutes)
    kept = together <= PROMISED_MINUTES
    told = "kept" if kept else "BROKEN"
    print(f"  {'both, 2 cores':36} {together:9.1f} minutes   promised at most {PROMISED_MINUTES:.0f}   {told}")
    return 0 if kept else 1


def minutes_of(experiment: ModuleType, folder: Path) -> float:
    """Run one experiment and return how long it took."""
    settings = experiment.SETTINGS["paper"]
    begun = time.perf_counter()
    with open_run(folder / experiment.NAME, settings.to_dict()) as run:
        rows = experiment.run(settings, run, Scheduler(workers=WORKERS), lambda *_: None)
        run.complete(experiment.summarise(settings, rows), {})
    minutes = (time.perf_counter() - begun) / 60
    actions = rows["actions"].sum()
    print(f"  {experiment.NAME:36} {minutes:9.1f} minutes   {len(rows)} agents, {actions:,} actions", flush=True)
    return minutes


if __name__ == "__main__":
    sys.exit(main())
