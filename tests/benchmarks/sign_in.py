"""Time refused sign-ins: does an unknown name take as long as a wrong password, so that the time names no account?

python -m tests.benchmarks.sign_in [--full]

Both are sent in turn, in an order drawn anew for each pair, through the whole application; an hour passes on its clock
after each, so that nobody waits. The control is a program that looks at no password where there is no account: the
difference must then be seen.
"""

import logging
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from flask import Flask

from tests.web.bundles import read_study, write_bundle
from tests.web.people import Clock, Visitor
from tests.web.researchers import LONG_AGO, sign_in
from webapp.app import create_app
from webapp.config import Config
from webapp.storage import researchers
from webapp.storage.accounts import create_researcher
from webapp.views.services import services_of

NUM_PAIRS = 400
NUM_PAIRS_FULL = 5_000
NUM_WARM_UP = 20
MOST_APART = 0.05
"""Of the medians, as a share of the longer one."""
KNOWN, UNKNOWN, PASSWORD = "known-name", "other-name", "a long enough password"


def main(words: list[str]) -> int:
    """Measure, print a table, and return 1 if the time tells names from one another, or would not be seen to."""
    logging.getLogger().addHandler(logging.NullHandler())  # Thousands of refusals would be told.
    num_pairs = NUM_PAIRS_FULL if "--full" in words else NUM_PAIRS
    with tempfile.TemporaryDirectory() as folder:
        write_bundle(Path(folder), read_study())
        clock = Clock()
        app = create_app(Config(Path(folder)), clock=clock)
        try:
            create_researcher(services_of(app).database, KNOWN, PASSWORD, LONG_AGO)
            apart = measure(app, clock, num_pairs, "as it is")
            with mock.patch.object(researchers, "_sign_in", _unless_unknown(researchers._sign_in)):
                apart_in_control = measure(app, clock, num_pairs // 10, "control: no hash for an unknown name")
        finally:
            services_of(app).database.close()
    is_kept, is_seen = apart <= MOST_APART, apart_in_control > MOST_APART
    print(f"at most {100 * MOST_APART:.0f} % apart: {'kept' if is_kept else 'BROKEN'}")
    print(f"the control is seen: {'yes' if is_seen else 'NO'}")
    return 0 if is_kept and is_seen else 1


def measure(app: Flask, clock: Clock, num_pairs: int, what: str) -> float:
    """Return by what share of the longer one the two medians differ."""
    visitor, stream = Visitor(app), random.Random(20310301)
    times: dict[str, list[float]] = {KNOWN: [], UNKNOWN: []}
    for pair in range(-NUM_WARM_UP, num_pairs):
        for name in stream.sample([KNOWN, UNKNOWN], 2):
            clock.wait(hours=1)
            begun_at = time.perf_counter()
            answer = sign_in(visitor, name, "not this password")
            took_ms = 1000 * (time.perf_counter() - begun_at)
            assert answer.status_code == 422
            if pair >= 0:
                times[name].append(took_ms)
    medians = {name: statistics.median(found) for name, found in times.items()}
    apart = abs(medians[KNOWN] - medians[UNKNOWN]) / max(medians.values())
    print(f"{what}, {num_pairs:,} of each, median ms")
    print(f"  wrong password  | {medians[KNOWN]:7.2f}")
    print(f"  unknown name    | {medians[UNKNOWN]:7.2f}  ratio {medians[UNKNOWN] / medians[KNOWN]:.3f}")
    return apart


def _unless_unknown(sign_in_as: Callable[..., str | None]) -> Callable[..., str | None]:
    """Return what signs in, and refuses at once whoever has no account."""
    return lambda database, name, *rest: sign_in_as(database, name, *rest) if name == KNOWN else None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
