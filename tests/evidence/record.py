"""Run measurements and keep what they print.

python -m tests.evidence.record              # everything that has a command; this takes hours
python -m tests.evidence.record F13 L4       # these
python -m tests.evidence.record L1 --note "other work ran on the machine" -- --repetitions 5
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from tests.conftest import ROOT
from tests.evidence.measurements import FAULTS, LOAD, Measurement
from tests.evidence.results import made, write_result


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; return 0 if all of it was as promised."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    more = words[words.index("--") + 1 :] if "--" in words else []
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("ids", nargs="*", metavar="ID", help="such as F1; all if none is given")
    parser.add_argument("--short", action="store_true", help="the short version, without --full")
    parser.add_argument("--note", default="", help="what else one should know of this run")
    options = parser.parse_args(words[: len(words) - len(more) - 1] if "--" in words else words)
    known = {one.id: one for one in (*FAULTS, *LOAD) if one.command}
    unknown = sorted(set(options.ids) - set(known))
    if unknown:
        parser.error(f"nothing is measured by {', '.join(unknown)}; choose among {', '.join(known)}")
    statuses = [record(known[name], more, options.note, short=options.short) for name in options.ids or known]
    return max(statuses, default=0)


def record(measurement: Measurement, more: Sequence[str], note: str, *, short: bool = False) -> int:
    """Run one measurement and keep what it prints, also if a promise was broken; return its exit status."""
    words = [*(word for word in measurement.command.split() if not (short and word == "--full")), *more]
    print(f"== {measurement.id} {measurement.what}", flush=True)
    command = [sys.executable, "-m", *words]
    finished = subprocess.run(command, cwd=ROOT, check=False, stdout=subprocess.PIPE, text=True)
    told = told_in(finished.stdout)
    if told:
        result = made(told, finished.returncode, f"python -m {' '.join(words)}", note)
        print(write_result(measurement.results[0], result))
    return finished.returncode if told else 1


def told_in(output: str) -> list[Mapping[str, Any]]:
    """Return the objects among the lines of an output that tell of a test."""
    lines = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    return [line for line in lines if isinstance(line, dict) and "test" in line]


if __name__ == "__main__":
    sys.exit(main())
