import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import ClassVar

import pytest

from webapp.bots.browser import Browser, Site, TimeLimit
from webapp.bots.errors import OutOfTimeError, WalkError


class Handler(BaseHTTPRequestHandler):
    """Answers by the path: `/busy` is busy twice, `/moved` leads to `/`, `/taken` takes the cookie back."""

    protocol_version = "HTTP/1.1"
    asked: ClassVar[list[tuple[str, str]]] = []

    def do_GET(self) -> None:
        self.asked.append((self.path, self.headers.get("Cookie", "")))
        is_busy = self.path == "/busy" and sum(path == "/busy" for path, _ in self.asked) < 3
        status = 503 if is_busy or self.path == "/full" else 303 if self.path == "/moved" else 200
        self.send_response(status)
        for name, value in (
            ("Retry-After", "5" if is_busy else ""),
            ("Location", "/?a=1" if status == 303 else ""),
            ("Set-Cookie", "token=; Path=/; Max-Age=0" if self.path == "/taken" else "token=abc; Path=/; HttpOnly"),
            ("Content-Length", "0"),
        ):
            if value:
                self.send_header(name, value)
        self.end_headers()

    def do_POST(self) -> None:
        self.do_GET()

    def log_message(self, *_args: object) -> None:
        """Say nothing."""


@pytest.fixture
def browser() -> Iterator[Browser]:
    with serving() as site:
        browser = Browser(site, TimeLimit(20, threading.Event()))
        yield browser
        browser.close()


@contextmanager
def serving() -> Iterator[Site]:
    Handler.asked.clear()
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield Site("127.0.0.1", server.server_port, "127.0.0.1")
        server.shutdown()


def test_a_busy_server_is_asked_again(browser: Browser) -> None:
    assert browser.get("/busy").status == 200
    assert [path for path, _ in Handler.asked] == ["/busy"] * 3


def test_a_server_that_is_not_just_busy_is_taken_at_its_word(browser: Browser) -> None:
    assert browser.post("/full", {}).status == 503
    with pytest.raises(WalkError, match="/full was answered with 503"):
        browser.get("/full")


def test_a_redirect_is_followed_with_the_cookie_that_came_with_it(browser: Browser) -> None:
    answer = browser.get("/moved")
    assert (answer.path, answer.status) == ("/?a=1", 200)
    assert Handler.asked == [("/moved", ""), ("/?a=1", "token=abc")]


def test_a_form_is_not_followed_by_itself(browser: Browser) -> None:
    assert browser.post("/moved", {"a": "1"}).next == "/?a=1"
    assert len(Handler.asked) == 1


def test_a_cookie_that_is_taken_back_is_forgotten_but_was_there(browser: Browser) -> None:
    browser.get("/")
    browser.get("/taken")
    assert browser.cookies == {}
    assert browser.all_cookies == {("token", "abc")}


def test_without_a_server_a_bot_gives_up_when_its_time_is_over() -> None:
    with serving() as site:
        gone = site
    with pytest.raises(OutOfTimeError):
        Browser(gone, TimeLimit(0.3, threading.Event())).get("/")


def test_when_all_are_to_stop_nobody_has_time_left() -> None:
    stop = threading.Event()
    limit = TimeLimit(100, stop)
    assert limit.left() > 90
    stop.set()
    with pytest.raises(OutOfTimeError):
        limit.wait(50)
