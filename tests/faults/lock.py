"""Two requests wait for the same lock, and one of them makes the step: `python -m tests.faults.lock [--full]` (F15).

Somebody outside the program holds the database while a page is sent from two windows of the same browser. Whoever comes
second must decide by what the first one stored, not by what it read before it waited. `--full` is 200 races for each
edition.
"""

import argparse
import random
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests import postgres
from tests.faults.client import Browser, take_part
from tests.faults.oracle import Ledger, evidence
from tests.faults.program import running
from tests.outside import outside
from tests.web.bundles import read_study, write_bundle
from tests.web.people import filled
from webapp.storage.postgres_edition import WRITERS_LOCK

_HELD_S = 0.3
"""So long after both were sent, both have been read and wait."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of some races.

    Attributes:
        num_races: How many.
        num_single: How many ended with one page stored, both windows sent on, and the participant at the next page.
        num_early: How many were answered while the database was held.
        statuses: With what pages were answered, each once.
    """

    num_races: int
    num_single: int
    num_early: int
    statuses: tuple[int, ...]

    @property
    def is_clean(self) -> bool:
        """Whether every race made exactly one step."""
        return self.num_single == self.num_races and self.num_early == 0 and self.statuses == (303,)

    def to_json(self) -> dict[str, object]:
        """Return the counts by name."""
        return {name.removeprefix("num_"): getattr(self, name) for name in self.__slots__}


def race(instance: Path, num_races: int, *, mutant: str | None = None, url: str | None = None) -> Outcome:
    """Let somebody new send a page from two windows while the database is held, again and again.

    Args:
        instance: Where to make the instance.
        num_races: How often.
        mutant: Which of `mutants` runs in place of the program.
        url: The PostgreSQL database, if it is one.
    """
    write_bundle(instance, read_study())
    settings = {} if url is None else {"DATABASE_URL": url}
    num_single = num_early = 0
    statuses: list[int] = []
    with running(instance, mutant, **settings) as program:
        for number in range(num_races):
            browser = Browser(program.port)
            take_part(browser, Ledger(), random.Random(number), last=2)
            form = filled(3, browser.nonce_of("/study/3"))
            answered = list[int]()
            windows = [Browser(program.port, cookies=dict(browser.cookies)) for _ in range(2)]
            threads = [threading.Thread(target=_send, args=(window, form, answered)) for window in windows]
            with held(instance / "xar.sqlite3", url):
                for thread in threads:
                    thread.start()
                time.sleep(_HELD_S)
                num_early += len(answered)
            for thread in threads:
                thread.join()
            with outside(instance / "xar.sqlite3", url) as connection:
                ((num_rows,),) = connection.ask("SELECT count(*) FROM pages WHERE number >= 3")
            is_at_next = browser.ask("/study")[1]["Location"] == "/study/4"
            num_single += answered == [303, 303] and num_rows == number + 1 and is_at_next
            statuses += answered
            browser.close()
    return Outcome(num_races, num_single, num_early, tuple(sorted(set(statuses))))


@contextmanager
def held(path: Path, url: str | None) -> Iterator[None]:
    """Let nobody else write to a database."""
    with outside(path, url) as other:
        if url is None:
            other.execute("BEGIN IMMEDIATE")
        else:
            other.execute("SELECT pg_advisory_lock(?)", [WRITERS_LOCK])
        yield


def _send(window: Browser, form: dict[str, str], answered: list[int]) -> None:
    answered.append(window.ask_once("/study/3", form)[0])
    window.close()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if every race made one step, and one of the control did not."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="200 races for each edition")
    parser.add_argument("--races", type=int, default=5)
    options = parser.parse_args(arguments)
    num_races = 200 if options.full else options.races
    with ExitStack() as stack:
        scratch = stack.enter_context(tempfile.TemporaryDirectory())
        server = stack.enter_context(postgres.a_server())
        url = server.url(server.make())
        found = {
            "SQLite": race(Path(scratch, "sqlite"), num_races),
            "PostgreSQL": race(Path(scratch, "postgres"), num_races, url=url),
        }
        control = race(Path(scratch, "cached"), 5, mutant="cached")
    counts = {name: outcome.to_json() for name, outcome in found.items()}
    told = {"decides by what it read before": control.to_json()}
    print(evidence("F15 two requests behind one lock", counts, control=told))
    return 0 if all(outcome.is_clean for outcome in found.values()) and not control.is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
