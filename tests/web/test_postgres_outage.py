"""PostgreSQL is gone for a while: everybody is asked to wait, and whoever tries again is answered as before."""

import json
import random
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path

import pytest

from tests import postgres
from tests.faults.client import Browser, send_page, take_part
from tests.faults.crowd import compare
from tests.faults.oracle import Ledger
from tests.faults.program import Program, running
from tests.web.bundles import read_study, write_bundle
from tests.web.people import filled
from webapp.app import create_app
from webapp.config import Config
from webapp.storage.database import UnreachableError
from webapp.views.services import services_of


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    folder = tmp_path / "instance"
    write_bundle(folder, read_study())
    return folder


@pytest.fixture
def url(postgres_server: postgres.Server) -> Iterator[str]:
    name = postgres_server.make()
    yield postgres_server.url(name)
    postgres_server.drop(name)


@pytest.fixture
def program(instance: Path, url: str) -> Iterator[Program]:
    """A server with two workers."""
    with running(instance, DATABASE_URL=url, WEB_CONCURRENCY="2") as program:
        yield program


def test_while_the_database_is_gone_people_are_asked_to_wait_and_what_they_send_again_is_stored_once(
    program: Program, instance: Path, url: str, postgres_server: postgres.Server
) -> None:
    ledger, rng = Ledger(), random.Random(1)
    browsers = [Browser(program.port) for _ in range(4)]
    for browser in browsers:
        take_part(browser, ledger, rng, last=2)
    forms = [filled(3, browser.nonce_of("/study/3")) for browser in browsers]
    with postgres_server.gone():
        for browser, form in zip(browsers, forms, strict=True):
            for path, sent in (("/study/3", form), ("/study/3", None), ("/study", None), ("/healthz", None)):
                began = time.monotonic()
                status, headers, text = browser.ask_once(path, sent)
                assert (status, headers["Retry-After"], headers["Location"]) == (503, "5", None), path
                assert path == "/healthz" or "Everything that you sent before is safe." in text
                assert time.monotonic() - began < 5
    for browser in browsers:
        send_page(browser, ledger, rng, 3)
        browser.close()
    program.stop()
    verdict, problems = compare(instance, ledger, url)
    assert verdict.is_clean, verdict
    assert problems == []
    errors = [json.loads(line) for line in program.log.read_text(encoding="utf-8").splitlines() if '"ERROR"' in line]
    assert len(errors) == 4 * 3, "a line for each page, and none for /healthz"
    for error in errors:
        assert error["traceback"].count("in raw_connection\n") == 1, "one traceback, not the driver's besides"
        assert "psycopg.OperationalError\n" in error["traceback"]


def test_a_worker_that_loses_the_database_while_it_starts_says_so_in_a_way_that_it_may_try_again(
    instance: Path, url: str, postgres_server: postgres.Server
) -> None:
    told: list[str] = []

    def start() -> None:
        try:
            services_of(create_app(Config(instance, database_url=url))).database.close()
        except UnreachableError as error:
            told.append(str(error))

    name = url.partition("?")[0].rpartition("/")[2]
    end = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = %s AND wait_event_type = 'Lock'"
    starting = threading.Thread(target=start)
    with closing(postgres_server.connect(name)) as owner, closing(postgres_server.connect()) as other:
        owner.execute("BEGIN")
        owner.execute("LOCK alembic_version IN ACCESS EXCLUSIVE MODE")
        starting.start()
        while starting.is_alive() and not other.execute(end, (name,)).fetchall():
            time.sleep(0.01)
        starting.join()
    assert len(told) == 1
    assert "cannot be used now: terminating connection" in told[0]


def test_a_worker_killed_while_the_database_is_gone_is_replaced_by_one_that_waits_for_it(
    program: Program, postgres_server: postgres.Server
) -> None:
    browser = Browser(program.port)
    take_part(browser, Ledger(), random.Random(1), last=2)
    browser.close()
    before = program.pid
    with postgres_server.gone():
        for _ in range(2):
            program.kill_worker(random.Random(1))
        time.sleep(2.5)  # The new ones have tried by now.
    send_page(browser, Ledger(), random.Random(2), 3)
    browser.close()
    assert program.pid == before
    assert len(program.workers()) == 2


def test_an_answer_that_does_not_need_the_form_leaves_nothing_of_it_to_the_next_request(program: Program) -> None:
    with closing(HTTPConnection("127.0.0.1", program.port, timeout=10)) as connection:
        for _ in range(300):
            connection.request("POST", "/consent", "agree=yes", {"Sec-Fetch-Site": "cross-site"})
            answers = [connection.getresponse()]
            answers[0].read()
            connection.request("GET", "/healthz")
            answers.append(connection.getresponse())
            answers[1].read()
            assert [answer.status for answer in answers] == [403, 200]
