"""Kill the server again and again while participants send pages, and count what of the acknowledged is gone (F1, F4).

    python -m tests.faults.kills [--full | --long] [--kills 8] [--ratings 200] [--postgres]

Nobody is told: participants notice a broken connection and send the same form again. `--full` is at least 50 kills and
10,000 acknowledged ratings, `--long` at least 1,000 and 100,000. With `--postgres`, two workers serve from a PostgreSQL
server of the test's own, and single workers, processes of the database and all of the database are killed too.
"""

import argparse
import os
import random
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path

import psycopg

from tests import postgres
from tests.faults.client import Browser, GaveUp, take_part
from tests.faults.oracle import Ledger, Verdict, bound, evidence, judge, stored_sheets
from tests.faults.program import Program, running
from tests.web.bundles import read_study, write_bundle
from webapp.storage.database import Database
from webapp.storage.verification import verify_log

Fault = Callable[[Program, random.Random], None]

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


def kill_server(program: Program, _rng: random.Random) -> None:
    """Kill the whole server and start it again."""
    program.kill()
    program.start()


def postgres_faults(server: postgres.Server) -> tuple[Fault, ...]:
    """Return what may happen to the server with its workers, and to the database that they share."""

    def kill_backend(_program: Program, rng: random.Random) -> None:
        query = "SELECT pid FROM pg_stat_activity WHERE application_name = 'xar'"
        try:
            with closing(server.connect()) as connection:
                found = [pid for (pid,) in connection.execute(query).fetchall()]
            if found:
                os.kill(rng.choice(found), signal.SIGKILL)  # All others are then ended too, and PostgreSQL recovers.
        except (psycopg.OperationalError, ProcessLookupError):
            pass  # It is just recovering from the one before.

    def crash(_program: Program, _rng: random.Random) -> None:
        server.stop("immediate")
        server.start()

    return (kill_server, kill_worker, kill_worker, kill_backend, crash)


def kill_worker(program: Program, rng: random.Random) -> None:
    """Kill one worker process, which the server replaces."""
    program.kill_worker(rng)


@dataclass
class _Crowd:
    """Browsers that take part one after the other until they are told to stop."""

    port: int
    ledger: Ledger = field(default_factory=Ledger)
    stop: threading.Event = field(default_factory=threading.Event)
    num_again: int = 0
    given_up: list[str] = field(default_factory=list)

    def run(self, number: int) -> None:
        """Take part again and again, always as somebody new."""
        rng = random.Random(number)
        while not self.stop.is_set():
            browser = Browser(self.port)
            try:
                take_part(browser, self.ledger, rng)
            except GaveUp as error:
                self.given_up.append(str(error))
            browser.close()
            self.num_again += browser.num_again


def run(
    program: Program, faults: Sequence[Fault], num_kills: int, num_ratings: int, seed: int, pause_s: float = 0.7
) -> tuple[_Crowd, int]:
    """Let faults happen under load until there were enough kills and acknowledgements; everybody then finishes."""
    rng, crowd = random.Random(seed), _Crowd(program.port)
    threads = [threading.Thread(target=crowd.run, args=(seed + number,)) for number in range(NUM_BROWSERS)]
    for thread in threads:
        thread.start()
    done = 0
    try:
        while done < num_kills or crowd.ledger.num_ratings < num_ratings:
            time.sleep(rng.uniform(0.1, pause_s))
            if done < num_kills:
                rng.choice(faults)(program, rng)
                done += 1
    finally:
        crowd.stop.set()
        for thread in threads:
            thread.join()
    return crowd, done


def kill_and_compare(
    instance: Path,
    num_kills: int,
    num_ratings: int,
    *,
    seed: int = 1,
    mutant: str | None = None,
    faults: Sequence[Fault] = (kill_server,),
    url: str | None = None,
) -> Outcome:
    """Run the server on an instance, kill it, and compare what was acknowledged with what is stored.

    Args:
        instance: Where to make the instance.
        num_kills: At least how many.
        num_ratings: At least how many acknowledged ones.
        seed: Of the moments and the ratings.
        mutant: Which of `mutants` runs in place of the program.
        faults: What may happen.
        url: The PostgreSQL database, if it is one.
    """
    write_bundle(instance, read_study())
    settings = {} if url is None else {"DATABASE_URL": url, "WEB_CONCURRENCY": "2"}
    with running(instance, mutant, **settings) as program:
        crowd, done = run(program, faults, num_kills, num_ratings, seed)
    database = Database(instance / "xar.sqlite3", url)
    try:
        with database.read() as connection:
            stored = stored_sheets(connection)
            damage = [] if url else connection.exec_driver_sql("PRAGMA integrity_check").scalars().all()
        problems = [line for line in damage if line != "ok"]
        if mutant is None:
            problems += verify_log(database).problems
    finally:
        database.close()
    ledger = crowd.ledger
    verdict = judge(ledger.acknowledged, ledger.sent, stored)
    return Outcome(
        done,
        len(ledger.acknowledged),
        ledger.num_ratings,
        crowd.num_again,
        len(crowd.given_up),
        tuple(problems),
        verdict,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if nothing was lost and both controls show that it would be noticed."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="50 kills, 10,000 ratings")
    parser.add_argument("--long", action="store_true", help="1,000 kills, 100,000 ratings")
    parser.add_argument("--postgres", action="store_true")
    parser.add_argument("--kills", type=int, default=8)
    parser.add_argument("--ratings", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    num_kills, num_ratings = options.kills, options.ratings
    if options.full or options.long:
        num_kills, num_ratings = (1000, 100_000) if options.long else (50, 10_000)
    with ExitStack() as stack:
        scratch = stack.enter_context(tempfile.TemporaryDirectory())
        server = stack.enter_context(postgres.a_server()) if options.postgres else None
        url = None if server is None else server.url(server.make())
        faults = (kill_server,) if server is None else postgres_faults(server)
        outcome = kill_and_compare(
            Path(scratch, "real"), num_kills, num_ratings, seed=options.seed, faults=faults, url=url
        )
        weak = {
            mutant: kill_and_compare(Path(scratch, mutant), 8, 0, seed=options.seed, mutant=mutant)
            for mutant in ("hasty", "naive")
        }
    control = {mutant: found.to_json() for mutant, found in weak.items()}
    limit = bound(outcome.num_ratings)
    print(
        evidence(
            "F4 kill -9 and crashes of PostgreSQL" if options.postgres else "F1 kill -9",
            outcome.to_json(),
            seeds=[options.seed],
            bound=limit,
            control=control,
        )
    )
    is_noticed = weak["hasty"].verdict.lost > 0 and weak["naive"].verdict.doubled > 0
    return 0 if outcome.is_clean and is_noticed else 1


if __name__ == "__main__":
    sys.exit(main())
