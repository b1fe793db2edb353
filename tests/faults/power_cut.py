"""Cut the power while the program stores consents and pages, and count what of the acknowledged is gone (F2).

    python -m tests.faults.power_cut [--full] [--seeds 20] [--first-seed 0]

Each seed is one life of a database: the program's own `Database`, `enrol` and `store_page` run on a simulated disk, the
power goes at one of their writes, syncs or removals, and the program opens what is left. `--full` has 1,000 seeds for
each journal, with one thread and with four that share commits, and the controls, which must lose something.
"""

import argparse
import random
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal
from unittest import mock

import apsw

from tests.faults.apsw_driver import on_disk
from tests.faults.disk import Disk, Fate
from tests.faults.oracle import Ledger, Sheet, Verdict, bound, evidence, judge, stored_sheets
from tests.unit.storage.people import NOW, STUDY, content_of
from webapp.storage.answers import store_page
from webapp.storage.database import Database, open_database
from webapp.storage.enrolment import Enrolment, enrol
from webapp.storage.group_commit import _Group
from webapp.storage.participants import find_trials, hash_token
from webapp.storage.verification import verify_log
from webapp.study.session import pages

Journal = Literal["delete", "wal"]

_NAME = "xar.sqlite3"
_VERSIONS: dict[Journal, tuple[int, int, int]] = {"delete": (3, 40, 1), "wal": (3, 51, 3)}
"""Which version of SQLite makes the program choose which journal."""

_FATES: tuple[Fate, ...] = ("none", "first", "any")


@dataclass(frozen=True, slots=True)
class Setting:
    """How the program runs while the power goes.

    Attributes:
        journal: Which journal it keeps.
        num_threads: How many store at the same time, one participant each.
        weakened: What stands in place of pieces of its statements.
        hasty: Whether, as a control, members of a group go on before it is committed.
    """

    journal: Journal
    num_threads: int = 1
    weakened: tuple[tuple[str, str], ...] = ()
    hasty: bool = False

    @property
    def name(self) -> str:
        """What evidence calls it."""
        words = [self.journal, f"{self.num_threads} threads", *(weak for _, weak in self.weakened)]
        return ", ".join([*words, "acknowledged before the commit"] if self.hasty else words)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of some power cuts.

    Attributes:
        num_cuts: How many.
        num_acknowledged: How many consents and pages had been acknowledged before them.
        num_broken: How many databases could not be read, were damaged, or had a log that does not hold.
        verdict: What is not as it should be in the others.
    """

    num_cuts: int = 0
    num_acknowledged: int = 0
    num_broken: int = 0
    verdict: Verdict = field(default_factory=Verdict)

    @property
    def is_clean(self) -> bool:
        """Whether no cut did any harm."""
        return self.num_broken == 0 and self.verdict.is_clean

    def __add__(self, other: "Outcome") -> "Outcome":
        return Outcome(
            self.num_cuts + other.num_cuts,
            self.num_acknowledged + other.num_acknowledged,
            self.num_broken + other.num_broken,
            self.verdict + other.verdict,
        )

    def to_json(self) -> dict[str, int]:
        """Return the counts by name."""
        counts = {"cuts": self.num_cuts, "acknowledged": self.num_acknowledged, "broken": self.num_broken}
        return counts | self.verdict.to_json()


def settings() -> list[Setting]:
    """Return how the program runs."""
    return [Setting(journal, threads) for journal in _VERSIONS for threads in (1, 4)]


def controls() -> list[Setting]:
    """Return what must lose something: syncing less, and acknowledging too early."""
    off, normal, full = (("synchronous=EXTRA", f"synchronous={weak}") for weak in ("OFF", "NORMAL", "FULL"))
    return [
        Setting("delete", weakened=(off,)),
        Setting("wal", weakened=(off,)),
        Setting("wal", weakened=(normal,)),
        # The removal of a rollback journal, which is the commit, is not on disk before its folder is synced.
        Setting("delete", weakened=(full,)),
        Setting("delete", num_threads=4, hasty=True),
        Setting("wal", num_threads=4, hasty=True),
    ]


def cut_power(setting: Setting, seeds: Sequence[int], scratch: Path) -> Outcome:
    """Cut the power once for each seed."""
    empty = scratch / "empty" / _NAME
    if not empty.exists():
        with open_database(empty):
            pass
    num_operations = _live(setting, empty, scratch, seed=-1).num_operations
    outcome = Outcome()
    for seed in seeds:
        outcome += _one_cut(setting, empty, scratch, seed, num_operations)
    return outcome


class _Life:
    """One life of a database, up to the moment at which the power goes."""

    def __init__(self, folder: Path) -> None:
        self.ledger = Ledger()
        self.disk = Disk(folder)
        self.is_over = threading.Event()
        self.acknowledged: list[Sheet] = []

    @property
    def num_operations(self) -> int:
        return self.disk.num_operations

    def end(self, target: Path, rng: random.Random) -> None:
        """Note what has been acknowledged, and what would be left."""
        if not self.is_over.is_set():
            self.is_over.set()
            self.acknowledged = list(self.ledger.acknowledged)
            self.disk.cut(target, rng.choice(_FATES), rng)


def _one_cut(setting: Setting, empty: Path, scratch: Path, seed: int, num_operations: int) -> Outcome:
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory(dir=scratch) as left:
        target = Path(left)
        at = rng.randint(1, num_operations)
        life = _live(setting, empty, scratch, seed, lambda life: (at, partial(life.end, target, rng)), target, rng)
        outcome = Outcome(1, len(life.acknowledged))
        try:
            with mock.patch("sqlite3.sqlite_version_info", (3, 40, 1)), open_database(target / _NAME) as database:
                with database.read() as connection:
                    stored = stored_sheets(connection)
                    (verdict,) = connection.exec_driver_sql("PRAGMA integrity_check").one()
                is_broken = verdict != "ok" or bool(verify_log(database).problems)
        except Exception:
            return replace(outcome, num_broken=1)
    return replace(outcome, num_broken=int(is_broken), verdict=judge(life.acknowledged, life.ledger.sent, stored))


def _live(
    setting: Setting,
    empty: Path,
    scratch: Path,
    seed: int,
    plan: Callable[[_Life], tuple[int, Callable[[], None]]] | None = None,
    target: Path | None = None,
    rng: random.Random | None = None,
) -> _Life:
    """Let the program store, until the power goes or everything is stored, whichever is first."""
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        shutil.copy(empty, folder)
        life = _Life(Path(folder))
        driver = on_disk(life.disk, _VERSIONS[setting.journal], dict(setting.weakened))
        with _hasty(setting.hasty), driver, closing(Database(Path(folder, _NAME))) as database:
            if plan is not None:
                life.disk.at_operation(*plan(life))
            people = [(f"{seed} {number}", life, database) for number in range(max(2, setting.num_threads))]
            with ThreadPoolExecutor(setting.num_threads) as pool:
                list(pool.map(lambda person: _take_part(*person), people))
            if target is not None and rng is not None:
                life.end(target, rng)
        return life


def _take_part(token: str, life: _Life, database: Database) -> None:
    for sheet, store in _visit(token, database):
        life.ledger.send(sheet)
        store()
        life.ledger.acknowledge(sheet)
        if life.is_over.is_set():
            return


def _visit(token: str, database: Database) -> Iterator[tuple[Sheet, Callable[[], object]]]:
    """Yield what somebody sends, each with what stores it."""
    rng, token_hash = random.Random(token), hash_token(token)
    participant = None

    def consent() -> None:
        nonlocal participant
        participant = enrol(database, Enrolment(STUDY, "v1", "test", token_hash, "en"), NOW)

    yield Sheet((token_hash, 0), ""), consent
    assert participant is not None
    for page in pages(STUDY, find_trials(database, participant)):
        nonce, content = f"{token} {page.number}", content_of(page, rng.randint(1, 5))
        ratings = () if content.ratings is None else tuple(sorted(content.ratings.values.items()))
        sheet = Sheet((token_hash, page.number), nonce, ratings)
        yield sheet, partial(store_page, database, participant, page, nonce, content, NOW)


@contextmanager
def _hasty(is_wanted: bool) -> Iterator[None]:
    """As a control, let nobody wait for the commit of a group."""
    if is_wanted:
        with mock.patch.object(_Group, "wait", return_value=None):
            yield
    else:
        yield


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if nothing was lost and every control lost something."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="1,000 seeds")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    options = parser.parse_args(arguments)
    seeds = range(options.first_seed, options.first_seed + (1000 if options.full else options.seeds))
    with tempfile.TemporaryDirectory() as scratch:
        outcomes = {setting.name: cut_power(setting, seeds, Path(scratch)) for setting in settings()}
        weak = {control.name: cut_power(control, seeds[:100], Path(scratch)) for control in controls()}
    total = sum(outcomes.values(), Outcome())
    print(
        evidence(
            "F2 power cut",
            _counts(outcomes),
            seeds=[seeds[0], seeds[-1]],
            bound=bound(total.num_acknowledged),
            control=_counts(weak),
            sqlite=apsw.sqlite_lib_version(),
        )
    )
    return 0 if total.is_clean and not any(outcome.is_clean for outcome in weak.values()) else 1


def _counts(outcomes: Mapping[str, Outcome]) -> dict[str, object]:
    return {name: outcome.to_json() for name, outcome in outcomes.items()}


if __name__ == "__main__":
    sys.exit(main())
