"""Do with a page what impatient, unlucky and curious people do: `python -m tests.faults.gestures [--full]` (F9).

The gestures are tests in Chromium: two tabs, double clicks, Enter held down, back, forward, reloads, lost answers. Each
must leave exactly one row of every answer and lead to the next page. The control is a server that inserts whatever
comes, into tables without keys. `--full` adds the tests of misuse.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from tests.conftest import ROOT
from tests.faults.oracle import evidence

MIN_GESTURES = 12
GESTURES = "tests/browser/test_gestures.py"
MISUSE = "tests/browser/test_misuse.py"
TELLING = "two_tabs or answer_that_got_lost"
"""The gestures by which a server without keys is found out; the page itself stops a second click."""


def try_gestures(module: str, only: str = "", mutant: str | None = None) -> dict[str, str]:
    """Run a module of tests in the browser, and return by test what became of it: `passed`, or why it failed.

    Args:
        module: Its path from the repository's root.
        only: Which of its tests, as pytest's `-k` has it; all if empty.
        mutant: Which of `mutants` runs in place of the program.
    """
    with tempfile.TemporaryDirectory() as scratch:
        report = Path(scratch, "report.xml")
        command = [sys.executable, "-m", "pytest", "-q", f"--junit-xml={report}", "-k", only, module]
        variables = os.environ | ({} if mutant is None else {"XAR_TEST_MUTANT": mutant})
        subprocess.run(command, cwd=ROOT, env=variables, check=False, stdout=sys.stderr, timeout=1500)
        cases = ET.parse(report).getroot().iter("testcase")  # noqa: S314 - pytest wrote it just now.
        return {case.get("name", ""): _became(case) for case in cases}


def _became(case: ET.Element) -> str:
    """Return what became of a test; where it did not even get to its end, there is an error, and no failure."""
    for kind in ("failure", "error", "skipped"):
        found = case.find(kind)
        if found is not None:
            return f"{kind}: {found.get('message', '')}".splitlines()[0][:160]
    return "passed"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if every gesture left one row, and some left more in the control."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="the tests of misuse too")
    options = parser.parse_args(arguments)
    found = try_gestures(GESTURES)
    more = try_gestures(MISUSE) if options.full else {}
    weak = try_gestures(GESTURES, TELLING, mutant="naive")
    both = found | more
    failed = {name: became for name, became in both.items() if became != "passed"}
    told = {name: became for name, became in weak.items() if became.startswith("failure")}
    counts = {"gestures": len(found), "tests_of_misuse": len(more), "passed": len(both) - len(failed)}
    print(
        evidence(
            "F9 gestures",
            counts | {"failed": sorted(failed)},
            tried=[name.partition("[")[2].rstrip("]").replace("_", " ") for name in found],
            control={"a server that inserts whatever comes": {"failed": len(told), "of": len(weak)}},
        )
    )
    return 0 if len(found) >= MIN_GESTURES and not failed and told else 1


if __name__ == "__main__":
    sys.exit(main())
