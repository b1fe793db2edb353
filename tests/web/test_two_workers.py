"""Two workers of one server: whichever answers, people and researchers meet the same study."""

import json
import os
import random
import signal
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests import postgres
from tests.faults.client import Browser, send_page, take_part
from tests.faults.oracle import Ledger
from tests.faults.program import Program, running
from tests.web.bundles import read_study, write_bundle
from tests.web.people import NUM_PAGES
from tests.web.researchers import LONG_AGO, NAME, PASSWORD
from webapp.storage.accounts import create_researcher
from webapp.storage.database import Database
from webapp.storage.researchers import FREE_ATTEMPTS

STARTS_WITHIN_S = 30


@dataclass(frozen=True, slots=True)
class Workers:
    """A server with two workers."""

    program: Program

    @contextmanager
    def only(self, number: int) -> Iterator[None]:
        """Let one of them answer alone: the other stands still meanwhile."""
        other = int(sorted(self.program.workers())[1 - number])
        os.kill(other, signal.SIGSTOP)
        try:
            yield
        finally:
            os.kill(other, signal.SIGCONT)

    def ask(self, number: int, browser: Browser, path: str, form: dict[str, str] | None = None) -> tuple[int, str, str]:
        """Ask one of them over a new connection; return the status, where it leads and the page."""
        with self.only(number):
            status, headers, text = browser.ask(path, form)
            browser.close()
        return status, headers["Location"] or "", text

    def by_each(self, browser: Browser, path: str) -> list[str]:
        """Return what each of them answers."""
        answers = [self.ask(number, browser, path) for number in range(2)]
        assert [status for status, _, _ in answers] == [200, 200]
        return [text for _, _, text in answers]

    def begin(self, number: int, last: int) -> Browser:
        """Return the browser of somebody new who has answered so many pages, all by one of them."""
        browser = Browser(self.program.port)
        with self.only(number):
            take_part(browser, Ledger(), random.Random(number), last)
            browser.close()
        return browser

    def sign_in(self, number: int) -> Browser:
        """Return a researcher's browser."""
        browser = Browser(self.program.port)
        status, leads_to, _ = self.ask(number, browser, "/researcher/sign-in", {"name": NAME, "password": PASSWORD})
        assert (status, leads_to) == (303, "/researcher/")
        return browser

    def unblind(self, number: int, browser: Browser) -> None:
        """Let a researcher see the arms."""
        form = {"reason": "The last person has finished", "password": PASSWORD}
        assert self.ask(number, browser, "/researcher/unblind", form)[0] == 303

    def await_both(self) -> None:
        """Return when there are two."""
        ends_at = time.monotonic() + STARTS_WITHIN_S
        while len(self.program.workers()) != 2:
            assert time.monotonic() < ends_at, self.program.log.read_text(encoding="utf-8")[-2000:]
            time.sleep(0.02)


@pytest.fixture
def workers(tmp_path: Path, postgres_server: postgres.Server) -> Iterator[Workers]:
    instance = tmp_path / "instance"
    write_bundle(instance, read_study())
    name = postgres_server.make()
    with closing(Database(instance / "xar.sqlite3", postgres_server.url(name))) as database:
        create_researcher(database, NAME, PASSWORD, LONG_AGO, "owner")
    with running(instance, DATABASE_URL=postgres_server.url(name), WEB_CONCURRENCY="2") as program:
        both = Workers(program)
        both.await_both()
        yield both
    postgres_server.drop(name)


def test_the_dashboard_tells_the_same_whichever_worker_answers(workers: Workers) -> None:
    researcher = workers.sign_in(0)
    nobody, same = workers.by_each(researcher, "/researcher/status.json")
    assert nobody == same
    assert json.loads(nobody)["participants"] == []
    for number, last in ((0, 4), (1, NUM_PAGES), (1, 7)):
        workers.begin(number, last)
        first, second = workers.by_each(researcher, "/researcher/status.json")
        assert first == second
        assert json.loads(first)["participants"][0]["progress"] == last
    assert len(json.loads(first)["participants"]) == 3
    workers.unblind(1, researcher)
    for name in ("participants.csv", "ratings.csv", "quality.csv"):
        first, second = workers.by_each(researcher, f"/researcher/{name}")
        assert first == second, name


def test_wrong_passwords_are_counted_whichever_worker_they_reach(workers: Workers) -> None:
    refused: list[int] = []
    form = {"name": NAME, "password": "wrong password"}
    while len(refused) < 2 * FREE_ATTEMPTS:
        refused.append(workers.ask(len(refused) % 2, Browser(workers.program.port), "/researcher/sign-in", form)[0])
        if refused[-1] == 429:
            break
    # Neither worker alone has seen more than what is free.
    assert refused[:FREE_ATTEMPTS] == [422] * FREE_ATTEMPTS
    assert refused[-1] == 429


def test_who_is_erased_by_one_worker_is_gone_with_the_other(workers: Workers) -> None:
    person, researcher = workers.begin(1, 5), workers.sign_in(0)
    for status in workers.by_each(researcher, "/researcher/status.json"):
        (line,) = json.loads(status)["participants"]
    code = line["code"]
    workers.unblind(1, researcher)
    assert code in workers.ask(1, researcher, "/researcher/participants.csv")[2]
    form = {"code": code, "password": PASSWORD}
    erased = workers.ask(0, researcher, f"/researcher/people/{code}/erase", form)
    assert erased[:2] == (303, "/researcher/people?done=erased")
    for status in workers.by_each(researcher, "/researcher/status.json"):
        assert json.loads(status)["participants"] == []
    for number in range(2):
        assert workers.ask(number, researcher, f"/researcher/people/{code}")[0] == 404
        assert workers.ask(number, person, "/study/6")[0] == 403
    for rows in workers.by_each(researcher, "/researcher/participants.csv"):
        assert code not in rows


def test_what_one_worker_signed_the_other_knows_and_so_do_those_that_come_after_them(workers: Workers) -> None:
    person, researcher = workers.begin(0, 2), workers.sign_in(0)
    for number in range(3, 7):
        with workers.only(number % 2):
            send_page(person, Ledger(), random.Random(number), number)
            person.close()
    # A notice is in a cookie that the server signs.
    assert workers.ask(0, person, "/study/9")[:2] == (303, "/study/7")
    gone = set(workers.program.workers())
    for process in gone:
        os.kill(int(process), signal.SIGKILL)
    while gone & set(workers.program.workers()):
        time.sleep(0.02)
    workers.await_both()
    assert "That page comes later." in workers.ask(1, person, "/study/7")[2]
    for number in range(2):
        assert workers.ask(number, researcher, "/researcher/")[0] == 200
