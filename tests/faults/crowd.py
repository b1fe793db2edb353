"""People who take part one after the other while something is done to the server, and what is stored afterwards."""

import random
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tests.faults.client import Browser, GaveUp, take_part
from tests.faults.oracle import Ledger, Verdict, judge, stored_sheets
from webapp.storage.database import Database
from webapp.storage.verification import verify_log


@dataclass
class Crowd:
    """Browsers that take part one after the other until they are told to stop.

    Attributes:
        port: Where the server listens, on this machine.
        patience_s: For how long somebody sends the same again.
        ledger: What was sent and acknowledged.
        stop: Set when nobody new is to come; whoever takes part finishes.
        num_again: How often somebody had to send again.
        given_up: What those say who found no way on.
        statuses: Every status above 499 that somebody was answered with.
    """

    port: int
    patience_s: float = 30.0
    ledger: Ledger = field(default_factory=Ledger)
    stop: threading.Event = field(default_factory=threading.Event)
    num_again: int = 0
    given_up: list[str] = field(default_factory=list)
    statuses: set[int] = field(default_factory=set)

    def run(self, number: int) -> None:
        """Take part again and again, always as somebody new."""
        rng = random.Random(number)
        while not self.stop.is_set():
            browser = self.browser(number)
            try:
                take_part(browser, self.ledger, rng)
            except GaveUp as error:
                self.given_up.append(str(error))
            browser.close()
            self.num_again += browser.num_again
            self.statuses |= browser.statuses

    def browser(self, number: int) -> Browser:  # noqa: ARG002 - for those who tell them apart.
        """Open the browser of somebody new, in the place of the last one with the same number."""
        return Browser(self.port, self.patience_s)

    @contextmanager
    def coming(self, num_browsers: int, seed: int) -> Iterator[None]:
        """Let so many take part at a time for as long as the context lasts; in the end everybody finishes."""
        threads = [threading.Thread(target=self.run, args=(seed + number,)) for number in range(num_browsers)]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            self.stop.set()
            for thread in threads:
                thread.join()


def compare(
    instance: Path, ledger: Ledger, url: str | None = None, *, with_log: bool = True
) -> tuple[Verdict, list[str]]:
    """Compare what was acknowledged with what an instance holds, and look for damage.

    Args:
        instance: Its folder; no server runs on it any more.
        ledger: What was sent and acknowledged.
        url: The PostgreSQL database, if it is one.
        with_log: Whether the chain of records is verified too.

    Returns:
        What is lost, wrong, doubled or invented; and what is wrong with the database or the chain of records.
    """
    with closing(Database(instance / "xar.sqlite3", url)) as database:
        with database.read() as connection:
            stored = stored_sheets(connection)
            damage = [] if url else connection.exec_driver_sql("PRAGMA integrity_check").scalars().all()
        problems = [str(line) for line in damage if line != "ok"]
        if with_log:
            problems += verify_log(database).problems
    return judge(ledger.acknowledged, ledger.sent, stored), problems
