"""The server's loop: which connections it asks, and that nothing that one of them waits for is missed."""

import os
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import pytest
from waitress import wasyncore  # type: ignore[import-untyped]
from waitress.channel import HTTPChannel  # type: ignore[import-untyped]
from waitress.server import create_server  # type: ignore[import-untyped]

from webapp import server_loop
from webapp.server_loop import Sockets

_App = Callable[[dict[str, Any], Callable[..., Any]], Iterable[bytes]]
LARGE = 20_000_000  # More than the system's own buffers hold.
PATIENCE_S = 10


def answer(environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
    """Return the path, or many bytes, or the length of what was sent."""
    body = environ["wsgi.input"].read()
    content = b"x" * LARGE if environ["PATH_INFO"] == "/large" else f"{environ['PATH_INFO']} {len(body)}".encode()
    start_response("200 OK", [("Content-Length", str(len(content)))])
    return [content]


@contextmanager
def running(app: _App = answer, host: str = "127.0.0.1", **settings: Any) -> Iterator[tuple[Sockets, int]]:  # noqa: ANN401
    """Serve in a thread."""
    sockets = Sockets()
    server = create_server(app, map=sockets, host=host, port=0, threads=2, **settings)
    port = next(opened.effective_port for opened in sockets.values() if opened.accepting)
    is_over = threading.Event()

    def _serve() -> None:
        with suppress(SystemExit):
            sockets.serve()
        is_over.set()

    def _end() -> None:
        raise SystemExit

    threading.Thread(target=_serve, daemon=True).start()
    try:
        yield sockets, port
    finally:
        next(opened for opened in sockets.values() if opened.accepting).handle_accept = _end
        with suppress(OSError):
            socket.create_connection((host, port), timeout=PATIENCE_S).close()
        assert is_over.wait(PATIENCE_S)
        server.task_dispatcher.shutdown()
        wasyncore.close_all(sockets)


def connected(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)


def received(connection: socket.socket, end: bytes) -> bytes:
    content = b""
    while not content.endswith(end):
        content += (more := connection.recv(65536))
        assert more, content[-200:]
    return content


@pytest.fixture
def never_asked_without_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nothing that the loop missed be put right within a second."""
    monkeypatch.setattr(server_loop, "_ASK_ALL_S", 3600.0)


@pytest.mark.usefixtures("never_asked_without_cause")
def test_requests_on_one_connection_are_answered_in_order() -> None:
    with running() as (_, port), connected(port) as connection:
        for number in range(20):
            connection.sendall(f"GET /{number} HTTP/1.1\r\nHost: a\r\n\r\n".encode())
            received(connection, f"/{number} 0".encode())


@pytest.mark.usefixtures("never_asked_without_cause")
def test_a_number_that_was_used_before_serves_the_next_connection() -> None:
    with running() as (_, port):
        for number in range(50):
            with connected(port) as connection:
                connection.sendall(f"GET /{number} HTTP/1.1\r\nHost: a\r\n\r\n".encode())
                received(connection, f"/{number} 0".encode())


class Rival(wasyncore.dispatcher):  # type: ignore[misc]
    """A connection that, when something comes, closes another one, whose number a silent one has at once."""

    def __init__(self, connection: socket.socket, sockets: Sockets, read: list["Rival"]) -> None:
        super().__init__(connection, sockets)
        self.read, self.rivals = read, list[Rival]()

    def handle_read(self) -> None:
        self.read.append(self)
        for rival in self.rivals:
            number = rival.socket.fileno()
            mine, self.theirs = socket.socketpair()
            rival.close()
            with mine:
                Rival(socket.socket(fileno=os.dup2(mine.fileno(), number)), self._map, self.read)

    def writable(self) -> bool:
        return False


def test_what_happened_on_a_closed_connection_is_not_told_to_the_one_that_has_its_number_now() -> None:
    sockets, read = Sockets(), list[Rival]()
    pairs = [socket.socketpair() for _ in range(2)]
    first, second = (Rival(mine, sockets, read) for mine, _ in pairs)
    first.rivals, second.rivals = [second], [first]
    for _, theirs in pairs:
        theirs.sendall(b"x")
    sockets._ask(tuple(sockets))
    # Both are readable in this turn; whichever comes first closes the other.
    sockets._turn()
    assert len(read) == 1
    wasyncore.close_all(sockets)
    for connection in (*(theirs for _, theirs in pairs), read[0].theirs):
        connection.close()


@pytest.mark.usefixtures("never_asked_without_cause")
def test_requests_sent_at_once_are_answered_in_order() -> None:
    with running() as (_, port), connected(port) as connection:
        connection.sendall(b"".join(f"GET /{number} HTTP/1.1\r\nHost: a\r\n\r\n".encode() for number in range(30)))
        content = received(connection, b"/29 0")
    places = [content.index(f"\r\n\r\n/{number} 0".encode()) for number in range(30)]
    assert places == sorted(places)


@pytest.mark.usefixtures("never_asked_without_cause")
def test_a_body_in_pieces_is_put_together() -> None:
    with running() as (_, port), connected(port) as connection:
        connection.sendall(b"POST /a HTTP/1.1\r\nHost: a\r\nContent-Length: 30\r\n\r\n")
        for _ in range(10):
            time.sleep(0.01)
            connection.sendall(b"abc")
        received(connection, b"/a 30")


@pytest.mark.usefixtures("never_asked_without_cause")
def test_a_client_that_reads_slowly_gets_everything_and_holds_up_nobody() -> None:
    with running() as (_, port), connected(port) as slow:
        slow.sendall(b"GET /large HTTP/1.1\r\nHost: a\r\n\r\n")
        time.sleep(0.2)
        with connected(port) as other:
            other.sendall(b"GET /b HTTP/1.1\r\nHost: a\r\n\r\n")
            received(other, b"/b 0")
        received_so_far = slow.recv(65536)
        missing = LARGE - received_so_far.count(b"x")
        while missing:
            more = slow.recv(1 << 20)
            assert more
            missing -= len(more)


@pytest.mark.usefixtures("never_asked_without_cause")
def test_connections_are_taken_in_again_when_some_have_gone() -> None:
    with running(connection_limit=12) as (_, port), ExitStack() as stack:
        first = [stack.enter_context(connected(port)) for _ in range(10)]
        late = stack.enter_context(connected(port))
        late.sendall(b"GET /late HTTP/1.1\r\nHost: a\r\n\r\n")
        late.settimeout(0.3)
        with pytest.raises(TimeoutError):
            late.recv(1)
        late.settimeout(PATIENCE_S)
        for connection in first:
            connection.close()
        received(late, b"/late 0")


def test_an_idle_connection_is_closed() -> None:
    with running(channel_timeout=1, cleanup_interval=1) as (sockets, port), connected(port) as idle:
        assert idle.recv(1) == b""
        assert not any(isinstance(opened, HTTPChannel) for opened in sockets.values())


@pytest.mark.usefixtures("never_asked_without_cause")
def test_a_client_that_leaves_while_it_is_answered_leaves_nothing_behind() -> None:
    may_go_on, has_begun = threading.Event(), threading.Event()

    def slow(environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
        has_begun.set()
        may_go_on.wait(PATIENCE_S)
        return answer(environ, start_response)

    with running(slow) as (sockets, port):
        connection = connected(port)
        connection.sendall(b"GET /a HTTP/1.1\r\nHost: a\r\n\r\n")
        assert has_begun.wait(PATIENCE_S)
        connection.close()
        may_go_on.set()
        for _ in range(100):
            if not any(isinstance(opened, HTTPChannel) for opened in sockets.values()):
                break
            time.sleep(0.05)
        assert not any(isinstance(opened, HTTPChannel) for opened in sockets.values())


@pytest.mark.usefixtures("never_asked_without_cause")
def test_a_client_that_resets_while_a_thread_answers_does_not_end_the_loop() -> None:
    """The thread cannot send that the rest of the second request may come, and must not close what the loop asks."""
    both = b"GET / HTTP/1.1\r\nHost: a\r\n\r\nPOST / HTTP/1.1\r\nHost: a\r\n%sContent-Length: 10\r\n\r\n"
    reset = struct.pack("ii", 1, 0)
    with running(connection_limit=1000) as (sockets, port):
        for _ in range(4000):
            with connected(port) as connection:
                connection.sendall(both % b"Expect: 100-continue\r\n")
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
        with connected(port) as other:
            other.sendall(b"GET /b HTTP/1.1\r\nHost: a\r\n\r\n")
            received(other, b"/b 0")
        assert set(sockets._waited_for) <= set(sockets)


@pytest.mark.usefixtures("never_asked_without_cause")
def test_a_loop_that_no_longer_listens_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_loop, "_ASK_ALL_S", 0.1)
    sockets = Sockets()
    server = create_server(answer, map=sockets, host="127.0.0.1", port=0, threads=1)

    def _fail() -> None:
        server.close()

    server.handle_accept = _fail
    address = server.effective_host, int(server.effective_port)
    with socket.create_connection(address, timeout=PATIENCE_S), pytest.raises(OSError, match="does not listen"):
        sockets.serve()
    server.task_dispatcher.shutdown()


def test_only_connections_on_which_something_happened_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Waitress's own loop asks all of them at every turn: 200 times 20 here, and more."""
    asked: list[int] = []
    usual = HTTPChannel.readable

    def _readable(channel: HTTPChannel) -> bool:
        asked.append(1)
        return bool(usual(channel))

    monkeypatch.setattr(HTTPChannel, "readable", _readable)
    with running(connection_limit=1000) as (_, port), ExitStack() as stack:
        for _ in range(200):
            stack.enter_context(connected(port))
        time.sleep(0.2)
        with connected(port) as connection:
            began, before = time.monotonic(), len(asked)
            for number in range(20):
                connection.sendall(f"GET /{number} HTTP/1.1\r\nHost: a\r\n\r\n".encode())
                received(connection, f"/{number} 0".encode())
            seconds = time.monotonic() - began
    # Once a second all are asked.
    assert len(asked) - before < 20 * 20 + 201 * (2 + seconds)
