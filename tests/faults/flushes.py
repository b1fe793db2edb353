"""Watch the server's system calls: every page is flushed to disk after it arrives and before it is answered (F3).

    python -m tests.faults.flushes [--full] [--people 2]

`strace` writes down what the server receives, flushes and sends, in order. `--full` is two hundred pages.
"""

import argparse
import random
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.faults.client import Browser, take_part
from tests.faults.oracle import Ledger, evidence
from tests.faults.program import in_threads, running
from tests.web.bundles import read_study, write_bundle
from tests.web.people import NUM_PAGES

NUM_AT_ONCE = 4
_CALLS = "fsync,fdatasync,recvfrom,sendto"
_POST = re.compile(r'recvfrom\((\d+)(?:<[^>]*>)?, "POST /study/')
_FLUSH = re.compile(r"(?:fsync|fdatasync)\(.*= 0")
_UNFINISHED, _RESUMED = re.compile(r"(\d+) +(.*) <unfinished \.\.\.>$"), re.compile(r"(\d+) +<\.\.\. \w+ resumed>(.*)")
_SENT = re.compile(r'sendto\((\d+)(?:<[^>]*>)?, "HTTP/1\.1 303')


def watch(instance: Path, num_people: int, *, mutant: str | None = None) -> tuple[int, int]:
    """Return how many pages were answered with a redirect, and how many of them had been flushed by then."""
    write_bundle(instance, read_study())
    trace = instance.with_name(f"{instance.name}.trace")
    with running(instance, mutant) as program:
        strace = shutil.which("strace")
        assert strace is not None, "strace was not found: apt-get install strace"
        tracer = subprocess.Popen(
            [strace, "-f", "-q", "-s", "24", "-e", f"trace={_CALLS}", "-o", trace, "-p", str(program.pid)],
            stderr=subprocess.PIPE,
        )
        _until_attached(program.pid)
        numbers = [list(range(first, num_people, NUM_AT_ONCE)) for first in range(NUM_AT_ONCE)]
        in_threads([threading.Thread(target=_take_part, args=(program.port, some)) for some in numbers])
        program.stop()
        tracer.communicate(timeout=20)
    return count(trace.read_text(encoding="utf-8", errors="replace").splitlines())


def count(lines: Sequence[str]) -> tuple[int, int]:
    """Count answered pages in a trace, and those with a flush between the request and the answer."""
    flushes, received = 0, dict[str, int]()
    num_answered = num_flushed = 0
    for line in _calls(lines):
        if _FLUSH.search(line):
            flushes += 1
        elif posted := _POST.search(line):
            received[posted[1]] = flushes
        elif (sent := _SENT.search(line)) and sent[1] in received:
            num_answered += 1
            num_flushed += flushes > received.pop(sent[1])
    return num_answered, num_flushed


def _calls(lines: Sequence[str]) -> Iterator[str]:
    """Put calls together that another thread's came between: sending counts when it begins, the others at their end."""
    begun: dict[str, str] = {}
    for line in lines:
        if unfinished := _UNFINISHED.match(line):
            begun[unfinished[1]] = unfinished[2]
            if unfinished[2].startswith("sendto"):
                yield unfinished[2]
        elif resumed := _RESUMED.match(line):
            call = begun.pop(resumed[1], "")
            if not call.startswith("sendto"):
                yield call + resumed[2]
        else:
            yield line


def _take_part(port: int, numbers: Sequence[int]) -> None:
    for number in numbers:
        browser = Browser(port)
        take_part(browser, Ledger(), random.Random(number))
        browser.close()


def _until_attached(pid: int) -> None:
    status = Path(f"/proc/{pid}/status")
    while "TracerPid:\t0\n" in status.read_text(encoding="ascii"):
        pass


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if every page was flushed, and none of the control's."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="200 pages")
    parser.add_argument("--people", type=int, default=2)
    options = parser.parse_args(arguments)
    num_people = -(-200 // NUM_PAGES) if options.full else options.people
    with tempfile.TemporaryDirectory() as scratch:
        answered, flushed = watch(Path(scratch, "real"), num_people)
        control = watch(Path(scratch, "unsynced"), num_people, mutant="unsynced")
    counts = {"pages": answered, "flushed": flushed}
    print(evidence("F3 flush before the answer", counts, control={"pages": control[0], "flushed": control[1]}))
    return 0 if answered == flushed == num_people * NUM_PAGES and control[1] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
