"""A network that loses what the server answered: every form is stored once, and nothing that was typed is lost."""

import random
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.browser.participant import Participant
from tests.browser.site import Site, serve
from tests.browser.windows import DESKTOP, OpenContext
from tests.faults.client import Browser
from tests.faults.lossy_network import SHORT, Proxy, lose_answers
from tests.web.bundles import read_study, write_bundle

PROVOKED = ("ERR_EMPTY_RESPONSE", "ERR_CONNECTION", "ERR_FAILED", "Failed to load resource")


@pytest.fixture(scope="module")
def served(planned_instance: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with serve(planned_instance, tmp_path_factory.mktemp("instance")) as served:
        yield served


@pytest.fixture(scope="module")
def proxy(served: Site) -> Iterator[Proxy]:
    proxy = Proxy(int(served.address.rpartition(":")[2]))
    with proxy.running():
        yield proxy


@pytest.fixture(scope="module")
def site(served: Site, proxy: Proxy) -> Site:
    """The site as browsers reach it, through the proxy."""
    return replace(served, address=f"http://127.0.0.1:{proxy.port}")


@pytest.fixture
def participant(site: Site, open_context: OpenContext) -> Iterator[Participant]:
    """A participant at the first rating page."""
    participant = Participant(open_context(expected=PROVOKED, **DESKTOP).new_page(), site, random.Random(1))
    participant.agree()
    participant.go_on("instructions.start")
    participant.go_on("situation.continue")
    yield participant
    participant.page.close()


def rows_of_the_latest(site: Site) -> list[tuple[str, str]]:
    last = max(site.export("participants.csv"), key=lambda row: row["consented_at"])
    mine = [row for row in site.export("ratings.csv") if row["participant"] == last["participant"]]
    return sorted((row["item"], row["rating"]) for row in mine)


def test_a_form_whose_answer_got_lost_is_sent_again_by_itself_and_stored_once(
    participant: Participant, proxy: Proxy, site: Site
) -> None:
    before = proxy.num_dropped
    proxy.delays_s, proxy.drop_next = (0.2, 0.6), 2
    items = participant.items()
    participant.answer_all(4)
    participant.button("explanation.send").click(no_wait_after=True)
    participant.page.wait_for_url("**/study/4", timeout=30_000)
    assert proxy.num_dropped == before + 2
    assert rows_of_the_latest(site) == sorted((item, "4") for item in items)


def test_where_nothing_comes_back_the_answers_stay_and_go_once_it_does(
    participant: Participant, proxy: Proxy, site: Site
) -> None:
    proxy.delays_s, proxy.drop_next = (0.0, 0.02), 1_000
    items = participant.items()
    participant.answer_all(2)
    participant.button("explanation.send").click(no_wait_after=True)
    expect(participant.page.locator(".sending-notice")).to_be_visible()
    assert participant.page.url.endswith("/study/3")
    for item in items:
        expect(participant.page.locator(f"#rating-{item}-2")).to_be_checked()
    proxy.drop_next = 0
    participant.page.wait_for_url("**/study/4", timeout=30_000)
    assert rows_of_the_latest(site) == sorted((item, "2") for item in items)


def test_of_sixty_forms_with_a_lost_answer_none_is_lost_or_doubled(tmp_path: Path) -> None:
    instance = tmp_path / "instance"
    write_bundle(instance, read_study())
    outcome = lose_answers(instance, SHORT)
    assert outcome.num_dropped >= SHORT
    assert outcome.num_acknowledged >= SHORT
    assert outcome.is_clean, outcome.line


def test_a_server_that_stores_whatever_comes_stores_much_twice() -> None:
    """The control: without the page's nonce as a key, a form that is sent again is another one."""
    stored: list[bytes] = []

    class Naive(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            stored.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(303)
            self.send_header("Location", "/")
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Naive)
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()
    proxy = Proxy(server.server_address[1], drops=0.45)
    with proxy.running():
        browser = Browser(proxy.port)
        for number in range(30):
            browser.ask("/", {"nonce": str(number)})
        browser.close()
    server.shutdown()
    server.server_close()
    thread.join()
    assert proxy.num_dropped > 5
    assert len(stored) - len(set(stored)) == proxy.num_dropped
