"""Fill the disk while people take part, make room again, and count what of the acknowledged is gone (F5).

    python -m tests.faults.disk_full [--full] [--fills 3]

The instance lies on a disk of a few megabytes, in memory, which a file fills to the last byte. That takes root's right
to mount; elsewhere the server may let no file grow beyond a few bytes. `--full` fills it 20 times.
"""

import argparse
import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.faults.client import Browser, send_page, take_part
from tests.faults.crowd import Crowd, compare
from tests.faults.mounts import behind_mount, can_mount
from tests.faults.oracle import Verdict, bound, evidence
from tests.faults.program import Program, running
from tests.web.bundles import read_study, write_bundle
from tests.web.people import filled

MAX_RESUME_S = 5.0
"""So long after there is room again, answers must be stored."""

NUM_BROWSERS = 6
_DISK_MB = 32
_FULL_FOR_S = 1.5
_WORDS = "Everything that you sent before is safe."


Fault = Callable[[Program], AbstractContextManager[None]]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a disk that could not be written to for a while.

    Attributes:
        num_fills: How often.
        num_pages: How many consents and pages were acknowledged.
        num_again: How often somebody had to send again.
        num_given_up: How many participants found no way on.
        num_told: How many forms sent meanwhile were answered with the page that says to try again later.
        num_not_told: How many were answered with anything else.
        num_unwell: How often `/healthz` said so meanwhile.
        statuses: Every status above 499.
        longest_resume_s: How long it took at most until an answer was stored, once there was room.
        problems: What is wrong with the log or the database.
        verdict: What is lost, wrong, doubled or invented.
    """

    num_fills: int
    num_pages: int
    num_again: int
    num_given_up: int
    num_told: int
    num_not_told: int
    num_unwell: int
    statuses: tuple[int, ...]
    longest_resume_s: float
    problems: tuple[str, ...]
    verdict: Verdict

    @property
    def is_clean(self) -> bool:
        """Whether everything is as promised."""
        is_told = self.num_not_told == 0 < self.num_told and self.num_unwell == self.num_fills
        is_back = self.longest_resume_s <= MAX_RESUME_S and self.num_given_up == 0
        return self.verdict.is_clean and not self.problems and is_told and is_back and set(self.statuses) <= {503}

    def to_json(self) -> dict[str, object]:
        """Return the counts by name."""
        counts: dict[str, object] = {name.removeprefix("num_"): value for name, value in asdict(self).items()}
        del counts["verdict"]
        return counts | self.verdict.to_json()


def fill_and_compare(
    instance: Path,
    num_fills: int,
    fault: Fault,
    *,
    mutant: str | None = None,
    prefix: Sequence[str] = (),
    patience_s: float = 30.0,
) -> Outcome:
    """Run the server on an instance, let nothing be written for a while, and compare what was acknowledged with it.

    Args:
        instance: Where to make the instance.
        num_fills: How often.
        fault: Keeps the server from writing for as long as its context lasts.
        mutant: Which of `mutants` runs in place of the program.
        prefix: What stands before the server's command.
        patience_s: For how long participants send the same again.
    """
    write_bundle(instance, read_study())
    resumed, told, num_unwell = list[float](), list[bool](), 0
    with running(instance, mutant, prefix) as program:
        crowd, witness = Crowd(program.port, patience_s), Browser(program.port)
        take_part(witness, crowd.ledger, random.Random(0), last=2)
        form = filled(3, witness.nonce_of("/study/3"))
        with crowd.coming(NUM_BROWSERS, seed=1):
            for _ in range(num_fills):
                time.sleep(0.5)
                with fault(program):
                    told += [_is_told(witness, form) for _ in range(2)]
                    time.sleep(_FULL_FOR_S)
                    num_unwell += witness.ask_once("/healthz")[0] == 503
                num_stored, freed_at = len(crowd.ledger.acknowledged), time.monotonic()
                while len(crowd.ledger.acknowledged) == num_stored and time.monotonic() < freed_at + patience_s:
                    time.sleep(0.01)
                resumed.append(time.monotonic() - freed_at)
        if mutant is None:
            send_page(witness, crowd.ledger, random.Random(0), 3)
        witness.close()
    verdict, problems = compare(instance, crowd.ledger, with_log=mutant is None)
    return Outcome(
        num_fills,
        len(crowd.ledger.acknowledged),
        crowd.num_again,
        len(crowd.given_up),
        sum(told),
        len(told) - sum(told),
        num_unwell,
        tuple(sorted(crowd.statuses)),
        round(max(resumed), 2),
        tuple(problems),
        verdict,
    )


def _is_told(witness: Browser, form: dict[str, str]) -> bool:
    """Send page 3, and tell whether its sender is asked to try again later."""
    status, headers, text = witness.ask_once("/study/3", form)
    return (status, headers["Retry-After"]) == (503, "5") and _WORDS in text


@contextmanager
def filled_up(folder: Path) -> Iterator[None]:
    """Take all room on a disk, to the last byte, for as long as the context lasts."""
    path = folder / "everything-else"
    with path.open("wb", buffering=0) as file, suppress(OSError):
        for size in (65536, 4096, 1):
            with suppress(OSError):
                while True:
                    file.write(b"\0" * size)
    yield
    path.unlink()


@contextmanager
def limited(program: Program) -> Iterator[None]:
    """Let no file of the server grow beyond a few bytes: every write to database and journal then fails."""
    before = resource.prlimit(program.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(program.pid, resource.RLIMIT_FSIZE, (512, before[1]))
    yield
    resource.prlimit(program.pid, resource.RLIMIT_FSIZE, before)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if nothing was lost, everybody was told, and the control lost something."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="20 times")
    parser.add_argument("--fills", type=int, default=3)
    parser.add_argument("--on", type=Path, help="a folder on a disk that may be filled")
    options = parser.parse_args(arguments)
    num_fills = 20 if options.full else options.fills
    with tempfile.TemporaryDirectory() as scratch:
        if options.on is None and can_mount():
            again = ["tests.faults.disk_full", "--fills", str(num_fills), "--on", scratch]
            return behind_mount(f'mount -t tmpfs -o size={_DISK_MB}m tmpfs "$0"', Path(scratch), again)
        place, is_small_disk = options.on or Path(scratch), options.on is not None
        fault: Fault = (lambda _program: filled_up(place)) if is_small_disk else limited
        outcome = fill_and_compare(place / "instance", num_fills, fault)
        weak = fill_and_compare(place / "weak", 1, fault, mutant="careless", patience_s=4)
    print(
        evidence(
            "F5 disk full",
            outcome.to_json(),
            how=f"a disk of {_DISK_MB} MB, filled" if is_small_disk else "no file of the server may grow",
            bound=bound(outcome.num_pages),
            limits={"longest resume s": MAX_RESUME_S},
            control={"acknowledges whatever became of a page": weak.to_json()},
        )
    )
    return 0 if outcome.is_clean and weak.verdict.lost > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
