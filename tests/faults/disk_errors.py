"""Let reading, writing and flushing of files fail at random, and count what of the acknowledged is gone (F7).

    python -m tests.faults.disk_errors [--full] [--pages 300] [--probability 0.01]

libfiu stands between the server and the system: whatever opens, closes, reads, writes, flushes or removes a file fails
with this probability, with any error that the call may have. `--full` is 10,000 acknowledged pages.
"""

import argparse
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.faults.client import Browser, take_part
from tests.faults.crowd import Crowd, compare
from tests.faults.oracle import Verdict, bound, evidence
from tests.faults.program import Program, running
from tests.web.bundles import read_study, write_bundle

NUM_BROWSERS = 8
PROBABILITY = 0.01
CALLS = ("oc/open", "rw/pread*", "rw/pwrite*", "rw/ftruncate", "sync/*", "dir/unlink")
"""What fails, by libfiu's names: all that SQLite does with files but closing them, since sockets are closed alike."""

_LIBRARIES = (Path("/usr/lib/fiu"), Path("/usr/local/lib/fiu"))


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a run.

    Attributes:
        num_pages: How many consents and pages were acknowledged.
        num_again: How often somebody had to send or to ask again.
        num_given_up: How many participants found no way on.
        statuses: Every status above 499.
        problems: What is wrong with the log or the database.
        verdict: What is lost, wrong, doubled or invented.
    """

    num_pages: int
    num_again: int
    num_given_up: int
    statuses: tuple[int, ...]
    problems: tuple[str, ...]
    verdict: Verdict

    @property
    def is_clean(self) -> bool:
        """Whether no error of the disk did any harm, and there were some."""
        is_told = set(self.statuses) == {503} and self.num_given_up == 0
        return self.verdict.is_clean and not self.problems and is_told

    def to_json(self) -> dict[str, object]:
        """Return the counts by name."""
        counts: dict[str, object] = {name.removeprefix("num_"): value for name, value in asdict(self).items()}
        del counts["verdict"]
        return counts | self.verdict.to_json()


def fail_and_compare(
    instance: Path, num_pages: int, probability: float, *, mutant: str | None = None, patience_s: float = 30.0
) -> Outcome:
    """Run the server on an instance with a bad disk, and compare what was acknowledged with what is stored.

    Args:
        instance: Where to make the instance.
        num_pages: At least how many acknowledgements.
        probability: With which each call fails.
        mutant: Which of `mutants` runs in place of the program.
        patience_s: For how long a participant sends the same again.
    """
    write_bundle(instance, read_study())
    pipe = instance.with_name("fiu")
    libraries = _libraries()
    preload = f"{libraries / 'fiu_run_preload.so'} {libraries / 'fiu_posix_preload.so'}"
    with running(instance, mutant, LD_PRELOAD=preload, FIU_CTRL_FIFO=str(pipe)) as program:
        crowd = Crowd(program.port, patience_s)
        first = Browser(program.port)
        take_part(first, crowd.ledger, random.Random(0))
        first.ask("/nowhere")  # So that templates are there by now, the one that tells of errors included.
        first.close()
        let_fail(program, pipe, probability)
        with crowd.coming(NUM_BROWSERS, seed=1):
            while len(crowd.ledger.acknowledged) < num_pages and len(crowd.given_up) < NUM_BROWSERS:
                time.sleep(0.05)
    verdict, problems = compare(instance, crowd.ledger, with_log=mutant is None)
    return Outcome(
        len(crowd.ledger.acknowledged),
        crowd.num_again,
        len(crowd.given_up),
        tuple(sorted(crowd.statuses)),
        tuple(problems),
        verdict,
    )


def let_fail(program: Program, pipe: Path, probability: float) -> None:
    """Let the calls of a running server fail until it ends: what could end it before has to read, and fails too."""
    words = [
        word for calls in CALLS for word in ("-c", f"enable_random name=posix/io/{calls},probability={probability}")
    ]
    control = shutil.which("fiu-ctrl")
    assert control is not None, "fiu-ctrl was not found: apt-get install fiu-utils"
    subprocess.run([control, "-f", str(pipe), *words, str(program.pid)], check=True, timeout=30)


def _libraries() -> Path:
    for folder in _LIBRARIES:
        if (folder / "fiu_posix_preload.so").is_file():
            return folder
    raise FileNotFoundError("libfiu was not found: apt-get install fiu-utils")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if nothing was lost, and the control lost something."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="10,000 acknowledged pages")
    parser.add_argument("--pages", type=int, default=300)
    parser.add_argument("--probability", type=float, default=PROBABILITY)
    options = parser.parse_args(arguments)
    num_pages = 10_000 if options.full else options.pages
    with tempfile.TemporaryDirectory() as scratch:
        outcome = fail_and_compare(Path(scratch, "real"), num_pages, options.probability)
        weak = fail_and_compare(Path(scratch, "weak"), 300, options.probability, mutant="careless", patience_s=10)
    print(
        evidence(
            "F7 errors of the disk",
            outcome.to_json(),
            probability=options.probability,
            calls=CALLS,
            bound=bound(outcome.num_pages),
            control={"acknowledges whatever became of a page": weak.to_json()},
        )
    )
    return 0 if outcome.is_clean and weak.verdict.lost > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
