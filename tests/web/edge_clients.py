"""Who comes to the edge: a bot's browser, many forms at once, and connections that take their time."""

import socket
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress

import urllib3

from tests.web.edge import NAME, Edge, request
from webapp.bots.browser import Browser, Site, TimeLimit

NUM_OTHERS = 20
HALVES = (
    b"POST /consent HTTP/1.1\r\nHost: ",
    f"POST /consent HTTP/1.1\r\nHost: {NAME}\r\nContent-Length: 1000\r\n\r\nagree=".encode(),
)


class SecureBrowser(Browser):
    """A bot's browser that knows TLS, and believes nginx's certificate alone."""

    def __init__(self, found: Edge) -> None:
        super().__init__(Site("127.0.0.1", found.https_port, NAME), TimeLimit(60, threading.Event()))
        self._pool = pool_of(found)


def pool_of(found: Edge, num_connections: int = 2) -> urllib3.HTTPSConnectionPool:
    return urllib3.HTTPSConnectionPool(
        "127.0.0.1",
        found.https_port,
        maxsize=num_connections,
        ca_certs=str(found.certificate),
        server_hostname=NAME,
        assert_hostname=NAME,
    )


def send_forms(found: Edge, path: str, count: int) -> Mapping[int, int]:
    """Send small forms as fast as it goes; count the answers by their status."""
    with pool_of(found, 8) as pool, ThreadPoolExecutor(8) as hands:
        headers = {"Host": NAME, "Content-Type": "application/x-www-form-urlencoded"}
        answers = hands.map(lambda _: pool.request("POST", path, body="a=b", headers=headers).status, range(count))
        return Counter(answers)


def num_served_beside_slow_ones(found: Edge) -> int:
    """Hold 200 connections with half a request each, and count how many of 20 others get an answer."""
    with slow_ones(lambda: found.connect(timeout_s=0.5)), ThreadPoolExecutor(NUM_OTHERS) as hands:
        return sum(hands.map(lambda _: _is_served(found), range(NUM_OTHERS)))


@contextmanager
def slow_ones(connect: Callable[[], socket.socket]) -> Iterator[None]:
    with ExitStack() as stack:
        for number in range(200):
            with suppress(OSError):
                slow = stack.enter_context(connect())
                slow.sendall(HALVES[number % 2])
        yield


def _is_served(found: Edge) -> bool:
    try:
        with found.connect(timeout_s=3) as connection:
            connection.sendall(request("/"))
            return connection.recv(12) == b"HTTP/1.1 200"
    except OSError:
        return False
