"""Kill PostgreSQL, and the workers that use it, again and again while participants send pages (F4).

    python -m tests.faults.postgres_kills [--full | --long] [--rounds 1] [--ratings 200]

Two workers serve from a PostgreSQL server of the test's own. Each round has one fault of every kind, in random order:
a worker, all of the web server, one process of the database, and its first process are killed, and it is stopped as if
the machine had. Nobody is told: participants send the same form again until it is answered. After a fault of the
database it is measured how long people still have to try again once connections are accepted, with the same workers.
`--full` is 12 rounds, 60 kills, and at least 20,000 acknowledged ratings; `--long` is 200 rounds and 100,000.
"""

import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, field
from http.client import HTTPMessage
from pathlib import Path

import psycopg

from tests import postgres
from tests.faults.client import Browser
from tests.faults.crowd import Crowd, compare
from tests.faults.kills import read_arguments
from tests.faults.oracle import Verdict, bound, evidence
from tests.faults.postgres_faults import KINDS, NUM_WORKERS, OF_DATABASE, Faults
from tests.faults.program import running
from tests.web.bundles import read_study, write_bundle

NUM_BROWSERS = 8
MAX_RECOVERY_S = 5.0
"""For so long at most may anybody have to try again once PostgreSQL accepts connections."""

_UNAVAILABLE = 503
_FAILED = 500
_PATIENCE_S = 30.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a run.

    Attributes:
        kills: How many faults there were of each kind.
        num_pages: How many consents and pages were acknowledged.
        num_ratings: How many ratings.
        num_again: How often somebody had to send again.
        num_given_up: How many participants found no way on.
        statuses: Every status above 499 that somebody was answered with.
        recoveries_s: After each fault of the database: for how long, once it accepted connections, some were not
            answered as usual.
        num_restarts: After how many of these other workers served than before.
        problems: What is wrong with the log or the database.
        verdict: What is lost, wrong, doubled or invented.
    """

    kills: Mapping[str, int]
    num_pages: int
    num_ratings: int
    num_again: int
    num_given_up: int
    statuses: tuple[int, ...]
    recoveries_s: tuple[float, ...]
    num_restarts: int
    problems: tuple[str, ...]
    verdict: Verdict

    @property
    def is_clean(self) -> bool:
        """Whether no fault did any harm."""
        is_kept = self.verdict.is_clean and not self.problems and self.num_given_up == 0
        is_back = max(self.recoveries_s, default=0.0) <= MAX_RECOVERY_S and self.num_restarts == 0
        return is_kept and is_back and set(self.statuses) <= {_UNAVAILABLE}

    def to_json(self) -> dict[str, object]:
        """Return the counts by name."""
        recoveries = sorted(self.recoveries_s)
        return {
            "kills": dict(self.kills),
            "acknowledged_pages": self.num_pages,
            "ratings": self.num_ratings,
            "sent_again": self.num_again,
            "given_up": self.num_given_up,
            "statuses_above_499": list(self.statuses),
            "median_recovery_s": round(recoveries[len(recoveries) // 2], 3) if recoveries else None,
            "longest_recovery_s": round(recoveries[-1], 3) if recoveries else None,
            "restarted_workers": self.num_restarts,
            "problems": list(self.problems),
        } | asdict(self.verdict)


class _Observer(Browser):
    """A browser that tells how each try ended."""

    told: Callable[[bool], None]

    def ask_once(self, path: str, form: dict[str, str] | None = None) -> tuple[int, HTTPMessage, str]:
        """Ask once."""
        is_well = False
        try:
            answer = super().ask_once(path, form)
            is_well = answer[0] < _FAILED
        finally:
            self.told(is_well)
        return answer


@dataclass
class Observers(Crowd):
    """A crowd that knows when each of its places was last answered, and when anybody last was not.

    Attributes:
        answered_at: By place: when it was last answered as usual, in monotonic seconds.
        failed_at: When anybody last was not.
    """

    answered_at: dict[int, float] = field(default_factory=dict)
    failed_at: float = 0.0

    def browser(self, number: int) -> Browser:
        """Open the browser of somebody new."""
        browser = _Observer(self.port, self.patience_s)
        browser.told = lambda is_well: self._note(number, is_well=is_well)
        return browser

    def _note(self, number: int, *, is_well: bool) -> None:
        if is_well:
            self.answered_at[number] = time.monotonic()
        else:
            self.failed_at = time.monotonic()

    def await_answers(self, since: float) -> float:
        """Wait until everybody was answered after a time, and return when that was; or, at last, that it was not."""
        first: dict[int, float] = {}
        ends_at = time.monotonic() + _PATIENCE_S
        while len(first) < NUM_BROWSERS and time.monotonic() < ends_at:
            for number, at in list(self.answered_at.items()):
                if at > since:
                    first.setdefault(number, at)
            time.sleep(0.005)
        return max(first.values()) if len(first) == NUM_BROWSERS else ends_at


def kill_and_compare(
    instance: Path,
    server: postgres.Server,
    num_rounds: int,
    num_ratings: int,
    *,
    seed: int = 1,
    kinds: Sequence[str] = KINDS,
    mutant: str | None = None,
) -> Outcome:
    """Run workers on a new database, let faults happen, and compare what was acknowledged with what is stored.

    Args:
        instance: Where to make the instance.
        server: The server of the database; it runs in the end.
        num_rounds: How often each kind of fault happens.
        num_ratings: At least how many acknowledged ones.
        seed: Of the moments and the ratings.
        kinds: Which of the methods of `Faults`.
        mutant: Which of `mutants` runs in place of the program.
    """
    write_bundle(instance, read_study())
    url = server.url(server.make(template="template0"))  # Without tables, which some mutants make in their own way.
    rng, kills, recoveries, num_restarts = random.Random(seed), Counter[str](), list[float](), 0
    with running(instance, mutant, DATABASE_URL=url, WEB_CONCURRENCY=str(NUM_WORKERS)) as program:
        crowd, faults = Observers(program.port), Faults(program, server, rng)
        with crowd.coming(NUM_BROWSERS, seed):
            crowd.await_answers(0.0)
            for kind in (kind for _ in range(num_rounds) for kind in rng.sample(kinds, len(kinds))):
                time.sleep(rng.uniform(0.1, 0.7))
                before = program.workers()
                getattr(faults, kind)()
                kills[kind] += 1
                if kind in OF_DATABASE:
                    accepts_at = server.await_connections()
                    answered_at = crowd.await_answers(accepts_at)
                    time.sleep(rng.uniform(0.3, 0.7))
                    recoveries.append(max(answered_at, crowd.failed_at) - accepts_at)
                    num_restarts += program.workers() != before
            while crowd.ledger.num_ratings < num_ratings:
                time.sleep(0.1)
    verdict, problems = compare(instance, crowd.ledger, url, with_log=mutant is None)
    return Outcome(
        kills=dict(kills),
        num_pages=len(crowd.ledger.acknowledged),
        num_ratings=crowd.ledger.num_ratings,
        num_again=crowd.num_again,
        num_given_up=len(crowd.given_up),
        statuses=tuple(sorted(crowd.statuses)),
        recoveries_s=tuple(recoveries),
        num_restarts=num_restarts,
        problems=(*problems, *_damaged(url)),
        verdict=verdict,
    )


def _damaged(url: str) -> list[str]:
    """Return what PostgreSQL's own check finds wrong with the indexes, with every row looked up in them."""
    query = (
        "SELECT indexrelid::regclass::text FROM pg_index JOIN pg_class ON pg_class.oid = indrelid "
        "WHERE relnamespace = 'public'::regnamespace"
    )
    found = []
    with closing(psycopg.connect(url, autocommit=True)) as connection:
        connection.execute("CREATE EXTENSION amcheck SCHEMA pg_catalog")
        for (index,) in connection.execute(query).fetchall():
            try:
                connection.execute("SELECT bt_index_check(%s::regclass, true)", (index,))
            except psycopg.Error as error:
                found.append(f"{index}: {error}")
    return found


def controls(scratch: Path, server: postgres.Server, seed: int, num_rounds: int) -> dict[str, Verdict]:
    """Return what comes of kills where a protection is missing.

    `hasty` acknowledges before it commits, and is to lose what a killed process of the database had not committed;
    `naive` stores whatever comes, and is to store twice what killed workers had stored and not acknowledged.
    """
    wanted = {"hasty": ("backend", "immediate"), "naive": ("all_workers",)}
    return {
        mutant: kill_and_compare(scratch / mutant, server, num_rounds, 0, seed=seed, kinds=kinds, mutant=mutant).verdict
        for mutant, kinds in wanted.items()
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if nothing was lost and both controls show that it would be noticed."""
    num_rounds, num_ratings, seed = read_arguments(
        arguments, str(__doc__), "rounds", few=1, full=(12, 20_000), long=(200, 100_000)
    )
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        server = stack.enter_context(postgres.a_server())
        outcome = kill_and_compare(scratch / "real", server, num_rounds, num_ratings, seed=seed)
        weak = controls(scratch, server, seed, num_rounds=4)
    print(
        evidence(
            "F4 PostgreSQL and its workers killed",
            outcome.to_json(),
            seeds=[seed],
            bound=bound(outcome.num_ratings),
            limits={"longest_recovery_s": MAX_RECOVERY_S},
            control={mutant: verdict.to_json() for mutant, verdict in weak.items()},
        )
    )
    is_noticed = weak["hasty"].lost > 0 and weak["naive"].doubled > 0
    return 0 if outcome.is_clean and is_noticed else 1


if __name__ == "__main__":
    sys.exit(main())
