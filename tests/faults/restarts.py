"""Restart the server again and again while people take part: nobody fails, and nobody is signed out (F12).

    python -m tests.faults.restarts [--full] [--restarts 3] [--people 20]

The server is told to stop (SIGTERM) and started again, as for an update; with PostgreSQL, gunicorn replaces its workers
(SIGHUP). Participants at human pace send again what was not answered, a researcher keeps looking at the dashboard, and
somebody keeps asking whether the server is there. `--full` is 20 restarts of each edition and 100 people at a time.
"""

import argparse
import random
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

from tests import postgres
from tests.faults.client import Browser, GaveUp, send_page, take_part
from tests.faults.crowd import compare
from tests.faults.oracle import Ledger, Verdict, bound, evidence
from tests.faults.program import Program, running
from tests.web.bundles import read_study, write_bundle
from tests.web.people import NUM_PAGES
from webapp.storage.accounts import create_researcher
from webapp.storage.database import Database

MAX_RELOAD_S = 1.0
"""For so long at most may nobody be answered while gunicorn replaces its workers."""

_THINK_S = 1.0
_LOOK_S = 0.02
_NAME, _PASSWORD = "researcher", "correct horse battery"
_FORBIDDEN = 403


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of some restarts.

    Attributes:
        num_restarts: How many.
        num_people: How many took part, to the end.
        num_pages: How many consents and pages were acknowledged.
        num_again: How often somebody had to send again.
        num_failed: How many found no way on.
        num_signed_out: How many of these the server did not know any more.
        num_looks: How often the researcher was shown the dashboard.
        num_researchers_signed_out: How often the researcher was asked to sign in instead.
        median_gap_s: How long nobody was answered around a restart.
        longest_gap_s: The longest of these times.
        problems: What is wrong with the log or the database.
        verdict: What is lost, wrong, doubled or invented.
    """

    num_restarts: int
    num_people: int
    num_pages: int
    num_again: int
    num_failed: int
    num_signed_out: int
    num_looks: int
    num_researchers_signed_out: int
    median_gap_s: float
    longest_gap_s: float
    problems: tuple[str, ...]
    verdict: Verdict

    @property
    def is_clean(self) -> bool:
        """Whether no restart did any harm."""
        harm = self.num_failed + self.num_signed_out + self.num_researchers_signed_out
        return harm == 0 and not self.problems and self.verdict.is_clean and self.num_looks > 0

    def to_json(self) -> dict[str, object]:
        """Return the counts by name."""
        counts: dict[str, object] = {name.removeprefix("num_"): value for name, value in asdict(self).items()}
        del counts["verdict"]
        return counts | self.verdict.to_json() | {"problems": list(self.problems)}


@dataclass
class _Watch:
    """Everybody who has to do with the server while it is restarted."""

    port: int
    think_s: float
    ledger: Ledger = field(default_factory=Ledger)
    stop: threading.Event = field(default_factory=threading.Event)
    num_finished: int = 0
    num_again: int = 0
    failed: list[str] = field(default_factory=list)
    num_signed_out: int = 0
    num_looks: int = 0
    num_researchers_signed_out: int = 0
    answered_at: list[float] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def take_part(self, number: int) -> None:
        """Take part at human pace, again and again, always as somebody new."""
        rng = random.Random(number)
        while not self.stop.is_set():
            browser, failure = Browser(self.port), ""
            try:
                take_part(browser, self.ledger, rng, last=0)
                for page in range(1, NUM_PAGES + 1):
                    time.sleep(rng.uniform(0, 2 * self.think_s))
                    send_page(browser, self.ledger, rng, page)
            except GaveUp as error:
                failure = str(error)
            with self.lock:
                self.num_again += browser.num_again
                self.num_finished += not failure
                if failure:
                    self.failed.append(failure)
                    self.num_signed_out += browser.ask("/study")[0] == _FORBIDDEN
            browser.close()

    def look_on(self, _number: int) -> None:
        """Sign in, and look at the dashboard; sign in again wherever that is asked for."""
        browser = Browser(self.port)
        browser.ask("/researcher/sign-in", {"name": _NAME, "password": _PASSWORD})
        while not self.stop.wait(10 * _LOOK_S):
            if browser.ask("/researcher/")[0] == 200:
                self.num_looks += 1
            else:
                self.num_researchers_signed_out += 1
                browser.ask("/researcher/sign-in", {"name": _NAME, "password": _PASSWORD})
        browser.close()

    def wait_for_answers(self, _number: int) -> None:
        """Note whenever the server says that it is well."""
        while not self.stop.wait(_LOOK_S):
            browser = Browser(self.port, patience_s=60)
            if browser.ask("/healthz")[0] == 200:
                self.answered_at.append(time.monotonic())
            browser.close()

    def gap_s(self, since: float, until: float) -> float:
        """Return the longest time between two answers from the last one before a moment to the first after another."""
        times = list(self.answered_at)
        before = [at for at in times if at <= since][-1:]
        after = [at for at in times if at >= until][:1]
        within = [*before, *(at for at in times if since < at < until), *after]
        return max((later - earlier for earlier, later in pairwise(within)), default=0.0)


Restart = Callable[[Program], None]


def restart_and_compare(
    instance: Path,
    num_restarts: int,
    num_people: int,
    *,
    restart: Restart = Program.restart,
    mutant: str | None = None,
    url: str | None = None,
    think_s: float = _THINK_S,
    pause_s: float = 2.0,
) -> Outcome:
    """Run the server on an instance, restart it under load, and compare what was acknowledged with what is stored.

    Args:
        instance: Where to make the instance.
        num_restarts: How many.
        num_people: How many take part at a time.
        restart: What a restart is.
        mutant: Which of `mutants` runs in place of the program.
        url: The PostgreSQL database, if it is one.
        think_s: How long people think about a page on average.
        pause_s: How long the server is left alone before each restart.
    """
    write_bundle(instance, read_study())
    with closing(Database(instance / "xar.sqlite3", url)) as database:
        database.prepare()
        create_researcher(database, _NAME, _PASSWORD, datetime.now(UTC))
    settings = {} if url is None else {"DATABASE_URL": url, "WEB_CONCURRENCY": "2"}
    gaps = []
    with running(instance, mutant, **settings) as program:
        watch = _Watch(program.port, think_s)
        with _everybody(watch, num_people):
            for _ in range(num_restarts):
                time.sleep(pause_s)
                began = time.monotonic()
                restart(program)
                ended = time.monotonic()
                while watch.answered_at[-1] < ended:
                    time.sleep(_LOOK_S)
                gaps.append(watch.gap_s(began, ended))
    verdict, problems = compare(instance, watch.ledger, url, with_log=mutant is None)
    return Outcome(
        num_restarts,
        watch.num_finished,
        len(watch.ledger.acknowledged),
        watch.num_again,
        len(watch.failed),
        watch.num_signed_out,
        watch.num_looks,
        watch.num_researchers_signed_out,
        round(statistics.median(gaps), 2),
        round(max(gaps), 2),
        tuple(problems),
        verdict,
    )


@contextmanager
def _everybody(watch: _Watch, num_people: int) -> Iterator[None]:
    jobs = [watch.take_part] * num_people + [watch.look_on, watch.wait_for_answers]
    threads = [threading.Thread(target=job, args=(number,)) for number, job in enumerate(jobs)]
    for thread in threads:
        thread.start()
    try:
        while not watch.answered_at:
            time.sleep(_LOOK_S)
        yield
    finally:
        watch.stop.set()
        for thread in threads:
            thread.join()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if nobody noticed, and the control signed people out."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="20 restarts, 100 people, both editions")
    parser.add_argument("--restarts", type=int, default=3)
    parser.add_argument("--people", type=int, default=20)
    options = parser.parse_args(arguments)
    num_restarts, num_people = (20, 100) if options.full else (options.restarts, options.people)
    with ExitStack() as stack:
        scratch = stack.enter_context(tempfile.TemporaryDirectory())
        found = {"SQLite, SIGTERM": restart_and_compare(Path(scratch, "sqlite"), num_restarts, num_people)}
        if options.full:
            server = stack.enter_context(postgres.a_server())
            found["PostgreSQL, SIGHUP"] = restart_and_compare(
                Path(scratch, "postgres"),
                num_restarts,
                num_people,
                restart=Program.reload,
                url=server.url(server.make()),
            )
        control = restart_and_compare(Path(scratch, "control"), 1, 10, mutant="own_key")
    total = sum(outcome.num_pages for outcome in found.values())
    print(
        evidence(
            "F12 restarts under load",
            {name: outcome.to_json() for name, outcome in found.items()},
            people_at_a_time=num_people,
            bound=bound(total),
            limits={"longest gap s with SIGHUP": MAX_RELOAD_S},
            control={"a key of each process' own": control.to_json()},
        )
    )
    reloads = [outcome for name, outcome in found.items() if "SIGHUP" in name]
    is_quick = all(outcome.longest_gap_s <= MAX_RELOAD_S for outcome in reloads)
    is_noticed = control.num_signed_out > 0 and control.num_researchers_signed_out > 0
    return 0 if is_quick and is_noticed and all(outcome.is_clean for outcome in found.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
