"""Kill the server again and again while participants send pages, and count what of the acknowledged is gone (F1).

    python -m tests.faults.kills [--full | --long] [--kills 8] [--ratings 200]

Nobody is told: participants notice a broken connection and send the same form again. `--full` is at least 50 kills and
10,000 acknowledged ratings, `--long` at least 1,000 and 100,000. `postgres_kills` does so with workers and PostgreSQL.
"""

import argparse
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.faults.crowd import Crowd, compare
from tests.faults.oracle import Verdict, bound, evidence
from tests.faults.program import Program, running
from tests.web.bundles import read_study, write_bundle

NUM_BROWSERS = 8


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a run.

    Attributes:
        num_kills: How many there were.
        num_pages: How many consents and pages were acknowledged.
        num_ratings: How many ratings.
        num_again: How often somebody had to send again.
        num_given_up: How many participants found no way on.
        problems: What is wrong with the log or the database.
        verdict: What is lost, wrong, doubled or invented.
    """

    num_kills: int
    num_pages: int
    num_ratings: int
    num_again: int
    num_given_up: int
    problems: tuple[str, ...]
    verdict: Verdict

    @property
    def is_clean(self) -> bool:
        """Whether no kill did any harm."""
        return self.verdict.is_clean and not self.problems and self.num_given_up == 0

    def to_json(self) -> dict[str, object]:
        """Return the counts by name."""
        counts = {"kills": self.num_kills, "acknowledged_pages": self.num_pages, "ratings": self.num_ratings}
        more = {"sent_again": self.num_again, "given_up": self.num_given_up, "problems": list(self.problems)}
        return counts | more | self.verdict.to_json()


def run(program: Program, num_kills: int, num_ratings: int, seed: int, pause_s: float = 0.7) -> tuple[Crowd, int]:
    """Kill the server under load until there were enough kills and acknowledgements; everybody then finishes."""
    rng, crowd = random.Random(seed), Crowd(program.port)
    done = 0
    with crowd.coming(NUM_BROWSERS, seed):
        while done < num_kills or crowd.ledger.num_ratings < num_ratings:
            time.sleep(rng.uniform(0.1, pause_s))
            if done < num_kills:
                program.kill()
                program.start()
                done += 1
    return crowd, done


def kill_and_compare(
    instance: Path,
    num_kills: int,
    num_ratings: int,
    *,
    seed: int = 1,
    mutant: str | None = None,
) -> Outcome:
    """Run the server on an instance, kill it, and compare what was acknowledged with what is stored.

    Args:
        instance: Where to make the instance.
        num_kills: At least how many.
        num_ratings: At least how many acknowledged ones.
        seed: Of the moments and the ratings.
        mutant: Which of `mutants` runs in place of the program.
    """
    write_bundle(instance, read_study())
    with running(instance, mutant) as program:
        crowd, done = run(program, num_kills, num_ratings, seed)
    ledger = crowd.ledger
    verdict, problems = compare(instance, ledger, with_log=mutant is None)
    return Outcome(
        done,
        len(ledger.acknowledged),
        ledger.num_ratings,
        crowd.num_again,
        len(crowd.given_up),
        tuple(problems),
        verdict,
    )


def read_arguments(
    arguments: Sequence[str] | None, about: str, kind: str, *, few: int, full: tuple[int, int], long: tuple[int, int]
) -> tuple[int, int, int]:
    """Read how much is to be tried, in the same words for every program that kills under load.

    Args:
        arguments: What stands behind the program's name; None for what this process was given.
        about: The program's docstring.
        kind: What is counted besides ratings, such as `kills`: the name of the option.
        few: How many of them if nothing is said.
        full: How many of them and of acknowledged ratings `--full` means.
        long: How many `--long` does.

    Returns:
        How many of them, how many ratings, and the seed.
    """
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    for name, (number, num_ratings) in {"full": full, "long": long}.items():
        parser.add_argument(f"--{name}", action="store_true", help=f"{number:,} {kind}, {num_ratings:,} ratings")
    parser.add_argument(f"--{kind}", dest="number", metavar="N", type=int, default=few)
    parser.add_argument("--ratings", metavar="N", type=int, default=200)
    parser.add_argument("--seed", metavar="N", type=int, default=1)
    options = parser.parse_args(arguments)
    number, num_ratings = long if options.long else full if options.full else (options.number, options.ratings)
    return number, num_ratings, options.seed


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if nothing was lost and both controls show that it would be noticed."""
    num_kills, num_ratings, seed = read_arguments(
        arguments, str(__doc__), "kills", few=8, full=(50, 10_000), long=(1000, 100_000)
    )
    with tempfile.TemporaryDirectory() as scratch:
        outcome = kill_and_compare(Path(scratch, "real"), num_kills, num_ratings, seed=seed)
        weak = {
            mutant: kill_and_compare(Path(scratch, mutant), 8, 0, seed=seed, mutant=mutant)
            for mutant in ("hasty", "naive")
        }
    control = {mutant: found.to_json() for mutant, found in weak.items()}
    limit = bound(outcome.num_ratings)
    print(evidence("F1 kill -9", outcome.to_json(), seeds=[seed], bound=limit, control=control))
    is_noticed = weak["hasty"].verdict.lost > 0 and weak["naive"].verdict.doubled > 0
    return 0 if outcome.is_clean and is_noticed else 1


if __name__ == "__main__":
    sys.exit(main())
