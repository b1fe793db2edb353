"""Take the right to write from the server, before its start and while it serves (F6).

    python -m tests.faults.read_only [--full] [--times 2]

At the start it refuses, in one line and with exit status 2. While it serves, people are asked to try again later, and
nothing is lost; once it may write again it goes on. Root is bound by permissions here as everybody else is. `--full`
takes the right away 20 times.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from tests.faults import gates
from tests.faults.disk_full import MAX_RESUME_S, Outcome, fill_and_compare
from tests.faults.oracle import bound, evidence
from tests.faults.program import Program


def take_and_give_back(
    instance: Path, num_times: int, *, mutant: str | None = None, patience_s: float = 30.0
) -> Outcome:
    """Take the right to write to its folder from a server under load and give it back, again and again.

    Args:
        instance: Where to make the instance.
        num_times: How often.
        mutant: Which of `mutants` runs in place of the program.
        patience_s: For how long participants send the same again.
    """

    def fault(_program: Program) -> AbstractContextManager[None]:
        return gates.read_only(instance)

    prefix = gates.bound_by_permissions()
    return fill_and_compare(instance, num_times, fault, mutant=mutant, prefix=prefix, patience_s=patience_s)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if starts were refused, nothing was lost, and the control lost something."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="20 times")
    parser.add_argument("--times", type=int, default=2)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as scratch:
        instance = Path(scratch, "instance")
        gates.prepare(instance)
        starts = {gate.name: (gate, gates.start(instance, gate)) for gate in gates.gates() if gate.is_bound}
        outcome = take_and_give_back(Path(scratch, "real"), 20 if options.full else options.times)
        weak = take_and_give_back(Path(scratch, "weak"), 5, mutant="careless", patience_s=2)
    print(
        evidence(
            "F6 read-only database or folder",
            outcome.to_json(),
            starts={
                name: f"exit status {begun.status}, {len(begun.lines)} line" for name, (_, begun) in starts.items()
            },
            bound=bound(outcome.num_pages),
            limits={"longest resume s": MAX_RESUME_S},
            control={"acknowledges whatever became of a page": weak.to_json()},
        )
    )
    is_refused = all(begun.is_right(gate) for gate, begun in starts.values())
    return 0 if is_refused and outcome.is_clean and weak.verdict.lost > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
