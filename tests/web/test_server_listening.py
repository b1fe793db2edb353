"""That the server's loop goes on listening while a thread answers, and is woken only where it has something to do."""

import select
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

import pytest
from waitress import trigger  # type: ignore[import-untyped]

from tests.web.test_server_loop import LARGE, PATIENCE_S, answer, connected, received, running
from webapp import server_loop
from webapp.server_loop import Sockets

pytestmark = pytest.mark.usefixtures("never_asked_without_cause")


@pytest.fixture
def never_asked_without_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nothing that the loop missed be put right within a second."""
    monkeypatch.setattr(server_loop, "_ASK_ALL_S", 3600.0)


class Slow:
    """An app that answers at `/slow` when it is told to."""

    def __init__(self) -> None:
        self.has_begun, self.may_end = threading.Event(), threading.Event()

    def __call__(self, environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
        if environ["PATH_INFO"].startswith("/slow"):
            self.has_begun.set()
            assert self.may_end.wait(PATIENCE_S)
        return answer(environ, start_response)


def request(path: str, *headers: str) -> bytes:
    return "\r\n".join([f"GET {path} HTTP/1.1", "Host: a", *headers, "", ""]).encode()


def count_turns(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Count how often the loop turns, and how often a thread wakes it."""
    counted: Counter[str] = Counter()

    def _turn(sockets: Sockets, turn: Callable[[Sockets], None] = Sockets._turn) -> None:
        counted["turns"] += 1
        turn(sockets)

    def _pull(pulled: object, *arguments: object, pull: Callable[..., None] = trigger.trigger.pull_trigger) -> None:
        counted["wakes"] += 1
        pull(pulled, *arguments)

    monkeypatch.setattr(Sockets, "_turn", _turn)
    monkeypatch.setattr(trigger.trigger, "pull_trigger", _pull)
    return counted


def test_nobody_wakes_the_loop_for_requests_that_come_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = count_turns(monkeypatch)
    with running() as (_, port), connected(port) as connection:
        for number in range(50):
            connection.sendall(request(f"/{number}"))
            received(connection, f"/{number} 0".encode())
            time.sleep(0.002)
        # On a busy machine the next request may be there before the thread is quite through.
        assert counted["wakes"] < 25, counted
        assert counted["turns"] < 50 + 25, counted


def test_what_comes_while_a_thread_answers_is_answered_next(monkeypatch: pytest.MonkeyPatch) -> None:
    counted, app = count_turns(monkeypatch), Slow()
    with running(app) as (sockets, port), connected(port) as connection:
        connection.sendall(request("/slow"))
        assert app.has_begun.wait(PATIENCE_S)
        before = counted["turns"]
        connection.sendall(request("/next"))
        (channel,) = sockets.answering
        while not channel.is_turned_away_from:
            assert counted["turns"] < before + 20, "the loop spins"
        assert counted["turns"] <= before + 2
        app.may_end.set()
        received(connection, b"/next 0")
        # And from then on as usual.
        before = counted["wakes"]
        for number in range(20):
            connection.sendall(request(f"/{number}"))
            received(connection, f"/{number} 0".encode())
            time.sleep(0.002)
        assert counted["wakes"] < before + 10


def test_who_leaves_while_a_thread_answers_is_forgotten() -> None:
    app = Slow()
    with running(app) as (sockets, port):
        with connected(port) as connection:
            connection.sendall(request("/slow"))
            assert app.has_begun.wait(PATIENCE_S)
        (channel,) = sockets.answering
        app.may_end.set()
        with connected(port) as other:
            other.sendall(request("/other"))
            received(other, b"/other 0")
        for _ in range(100):
            if channel._fileno not in sockets or sockets.get(channel._fileno) is not channel:
                return
            time.sleep(0.05)
        pytest.fail("the connection is kept")


def test_a_connection_that_is_to_be_closed_is_closed() -> None:
    with running() as (_, port), connected(port) as connection:
        connection.sendall(request("/last", "Connection: close"))
        received(connection, b"/last 0")
        assert select.select([connection], [], [], PATIENCE_S)[0]
        assert connection.recv(1) == b""


def test_what_a_thread_cannot_send_the_loop_sends() -> None:
    with running() as (_, port), connected(port) as connection:
        connection.sendall(request("/large"))
        content = bytearray()
        while len(content) < LARGE:
            content += (more := connection.recv(1_000_000))
            assert more
    assert content.count(b"x") == LARGE


def test_an_answer_goes_out_in_one_piece() -> None:
    with running() as (_, port), connected(port) as connection:
        for number in range(10):
            connection.sendall(request(f"/{number}"))
            assert connection.recv(65536).endswith(f"\r\n\r\n/{number} 0".encode())


def test_what_is_kept_back_meanwhile_does_not_keep_the_loop_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A part of an answer that is not sent yet, while the thread works on the next."""
    counted, may_end = count_turns(monkeypatch), threading.Event()

    def in_parts(_environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
        start_response("200 OK", [("Content-Length", "2")])
        yield b"a"
        assert may_end.wait(PATIENCE_S)
        yield b"b"

    with running(in_parts) as (sockets, port), connected(port) as connection, connected(port) as other:
        connection.sendall(request("/"))
        while not sockets.answering or not sockets.answering[0].total_outbufs_len:
            time.sleep(0.001)
        before = counted["turns"]
        other.sendall(request("/"))
        time.sleep(0.2)
        assert counted["turns"] <= before + 3
        may_end.set()
        assert received(connection, b"ab").startswith(b"HTTP/1.1 200 OK")
        received(other, b"ab")
