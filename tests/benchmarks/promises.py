"""Time what the documentation promises, and fail if a promise is broken.

python -m tests.benchmarks.promises
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tests.browser.site import STUDY
from tests.conftest import ROOT
from tests.web.servers import XAR, environment, serving

LAYOUT = ROOT / f"webapp/studies/{STUDY}/layouts/simulation.txt"
REPEATS = 3


def main() -> int:
    """Print measured and promised seconds, one line each, and return 0 if all promises are kept."""
    with tempfile.TemporaryDirectory() as scratch:
        instance = Path(scratch)
        lines = [
            ("first build of the study, training included", _seconds(lambda: _build(instance)), 180.0),
            ("second build, nothing changed", _median(lambda: _build(instance)), 5.0),
            ("xar explain on an 8 x 8 map", _median(lambda: _explain(instance)), 2.0),
            ("start of the server", _median(lambda: _start(instance)), 5.0),
        ]
    for name, seconds, promise in lines:
        print(f"{name:45} {seconds:7.2f} s   promised {promise:5.0f} s   {'kept' if seconds <= promise else 'BROKEN'}")
    return 0 if all(seconds <= promise for _, seconds, promise in lines) else 1


def _median(action: Callable[[], None]) -> float:
    return statistics.median(_seconds(action) for _ in range(REPEATS))


def _seconds(action: Callable[[], None]) -> float:
    began = time.perf_counter()
    action()
    return time.perf_counter() - began


def _build(instance: Path) -> None:
    _succeed(instance, "build", STUDY)


def _explain(instance: Path) -> None:
    _succeed(instance, "explain", "--layout", str(LAYOUT), "--json")


def _start(instance: Path) -> None:
    with serving(instance) as server:
        server.stop()


def _succeed(instance: Path, *words: str) -> None:
    subprocess.run([*XAR, *words], env=environment(instance), check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = "1"
    sys.exit(main())
