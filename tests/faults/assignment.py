"""Let everybody agree at the same moment, through HTTP, and see that the arms stay balanced (F13).

    python -m tests.faults.assignment [--full] [--rounds 1] [--starts 64] [--postgres | --both]

After every round, the arms of the study differ by one participant at most, and each link that a recruiter sent belongs
to one participant, although half of the links are opened in two browsers at once. `--full` is 200 rounds: twenty of 64
and of 200 starts for each of 2, 3, 4, 6 and 24 cells. With `--postgres`, two workers serve from a PostgreSQL server of
the test's own; `--both` is one edition after the other.
"""

import argparse
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import text

from tests import postgres
from tests.faults.client import Browser
from tests.faults.oracle import evidence
from tests.faults.program import Program, in_threads, running
from tests.web.bundles import write_bundle
from tests.web.studies import PROLIFIC, a_study, one_experiment
from webapp.storage.database import Database
from webapp.study.counterbalancing import arrangements

KINDS = ("subgoals", "full", "none", "placebic")
DESIGNS = {2: (2, 1), 3: (3, 1), 4: (4, 1), 6: (3, 3), 24: (4, 3)}
"""By the number of cells: of how many kinds and layouts it is the number of arrangements."""

_CELLS = """
SELECT arrangements.arrangement, arrangements.layout_order FROM arrangements
JOIN participants ON participants.id = arrangements.participant_id WHERE participants.study_version = :version
"""
_PEOPLE = """
SELECT recruits.external_id FROM participants JOIN recruits ON recruits.participant_id = participants.id
WHERE participants.study_version = :version
"""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of some rounds.

    Attributes:
        num_rounds: How many.
        num_participants: How many there are in the end.
        spread: By how many participants the fullest and the emptiest cell differed at most after a round.
        num_doubled: How many participants there are beyond one for each link.
        num_missing: How many links have none.
        num_refused: How often somebody was answered with anything but the first page.
    """

    num_rounds: int
    num_participants: int
    spread: int
    num_doubled: int
    num_missing: int
    num_refused: int

    @property
    def is_clean(self) -> bool:
        """Whether everything is as promised."""
        return self.spread <= 1 and self.num_doubled == self.num_missing == self.num_refused == 0

    def to_json(self) -> dict[str, int]:
        """Return the counts by name."""
        return {name: getattr(self, name) for name in self.__slots__}


def start_at_once(
    instance: Path,
    num_cells: int,
    rounds: Sequence[int],
    *,
    mutant: str | None = None,
    url: str | None = None,
) -> Outcome:
    """Serve a study of so many cells, and let people agree at the same moment, round after round.

    Args:
        instance: Where to make the instance.
        num_cells: One of `DESIGNS`.
        rounds: How many people each round has.
        mutant: Which of `mutants` runs in place of the program.
        url: The PostgreSQL database, if it is one.
    """
    num_kinds, num_layouts = DESIGNS[num_cells]
    experiments = one_experiment(list(KINDS[:num_kinds]), num_layouts, layout_order="fixed")
    study = a_study(recruitment=PROLIFIC, experiments=experiments)
    assert len(arrangements(study.experiments[0])) == num_cells
    version = write_bundle(instance, study)
    settings = {} if url is None else {"DATABASE_URL": url, "WEB_CONCURRENCY": "2"}
    spread, num_refused, links = 0, 0, list[str]()
    with running(instance, mutant, **settings) as program, closing(Database(instance / "xar.sqlite3", url)) as database:
        for number, num_starts in enumerate(rounds):
            newcomers = [f"{num_cells:04x}{number:08x}{place:012x}" for place in range(num_starts)]
            links += newcomers
            num_refused += _one_round(program, newcomers)
            with database.read() as connection:
                cells = Counter(tuple(row) for row in connection.execute(text(_CELLS), {"version": version}))
                people = Counter(connection.execute(text(_PEOPLE), {"version": version}).scalars())
            spread = max(spread, max(cells.values()) - (min(cells.values()) if len(cells) == num_cells else 0))
    doubled = sum(people.values()) - len(people)
    return Outcome(len(rounds), sum(cells.values()), spread, doubled, len(set(links) - set(people)), num_refused)


def _one_round(program: Program, newcomers: Sequence[str]) -> int:
    """Let newcomers agree at once, every other one in two browsers, and return how many were refused."""
    opened = [link for place, link in enumerate(newcomers) for _ in range(1 + place % 2)]
    browsers = [Browser(program.port) for _ in opened]
    nonces = [""] * len(opened)
    barrier = threading.Barrier(len(opened))
    answers: list[tuple[int, str | None]] = []

    def come(place: int, step: int) -> None:
        # A few threads open the pages: only what follows is to be simultaneous.
        for at in range(place, len(opened), step):
            browsers[at].ask(f"/?PROLIFIC_PID={opened[at]}&STUDY_ID={'a' * 24}&SESSION_ID={'b' * 24}")
            nonces[at] = browsers[at].nonce_of("/")
            browsers[at].close()

    def agree(place: int) -> None:
        barrier.wait()
        status, headers, _ = browsers[place].ask("/consent", {"agree": "yes", "nonce": nonces[place]})
        answers.append((status, headers["Location"]))
        browsers[place].close()

    in_threads([threading.Thread(target=come, args=(place, 4)) for place in range(4)])
    in_threads([threading.Thread(target=agree, args=(place,)) for place in range(len(opened))])
    return len(opened) - answers.count((303, "/study/1"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if the arms stayed balanced and the control's did not."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="200 rounds")
    parser.add_argument("--rounds", type=int, default=1, help="for each number of cells and of starts")
    parser.add_argument("--starts", type=int, nargs="+", default=[64, 200])
    edition = parser.add_mutually_exclusive_group()
    edition.add_argument("--postgres", action="store_true", help="PostgreSQL in place of SQLite")
    edition.add_argument("--both", action="store_true", help="SQLite, then PostgreSQL")
    options = parser.parse_args(arguments)
    rounds = [num_starts for num_starts in options.starts for _ in range(20 if options.full else options.rounds)]
    is_as_promised = True
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if not options.postgres:
            is_as_promised = _measure(scratch / "sqlite", rounds, None)
        if options.postgres or options.both:
            server = stack.enter_context(postgres.a_server())
            is_as_promised = _measure(scratch / "postgres", rounds, server) and is_as_promised
    return 0 if is_as_promised else 1


def _measure(scratch: Path, rounds: Sequence[int], server: postgres.Server | None) -> bool:
    """Print the evidence of one edition, and tell whether it is as promised and the control is not."""

    def url() -> str | None:
        return None if server is None else server.url(server.make())

    outcomes = {
        f"{num_cells} cells": start_at_once(scratch / f"cells{num_cells}", num_cells, rounds, url=url())
        for num_cells in DESIGNS
    }
    control = start_at_once(scratch / "control", 6, [64, 64, 64], mutant="unlocked", url=url())
    counts = {name: outcome.to_json() for name, outcome in outcomes.items()}
    test = f"F13 simultaneous starts, {'SQLite' if server is None else 'PostgreSQL with two workers'}"
    print(evidence(test, counts, starts=sorted(set(rounds)), control={"unlocked": control.to_json()}), flush=True)
    return all(outcome.is_clean for outcome in outcomes.values()) and control.spread > 1


if __name__ == "__main__":
    sys.exit(main())
