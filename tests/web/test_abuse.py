"""What one hostile client can do to the server itself, with no nginx before it: nothing that others notice."""

import re
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from http.server import HTTPServer, SimpleHTTPRequestHandler
from pathlib import Path

import pytest
import urllib3

from tests.web.bundles import read_study, write_bundle
from tests.web.edge import read_all
from tests.web.reading import num_rows
from tests.web.servers import Server, serving

NUM_SLOW = 200
NUM_OTHERS = 20
MANY_BYTES = 100 * 1024 * 1024
MOST_GROWTH_KB = 10 * 1024

# What is sent by the byte, after which the client sends no more. HOST stands for the server's own name.
START = b"Host: HOST\r\nConnection: close\r\n"
POST = b"POST /consent HTTP/1.1\r\nSec-Fetch-Site: same-origin\r\n" + START
RAW = {
    "nothing but line ends": b"\r\n\r\n\r\n\r\n",
    "no HTTP": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(range(256)),
    "no version": b"GET /\r\n\r\n",
    "a version that does not exist": b"GET / HTTP/9.9\r\n" + START + b"\r\n",
    "a method that does not exist": b"\xff\xfeGET / HTTP/1.1\r\n" + START + b"\r\n",
    "TRACE": b"TRACE / HTTP/1.1\r\n" + START + b"X-Secret: 1\r\n\r\n",
    "CONNECT": b"CONNECT evil.example:443 HTTP/1.1\r\n" + START + b"\r\n",
    "OPTIONS of everything": b"OPTIONS * HTTP/1.1\r\n" + START + b"\r\n",
    "NUL in the path": b"GET /study/\x00 HTTP/1.1\r\n" + START + b"\r\n",
    "NUL in the path, written out": b"GET /study/%00/resume/%00 HTTP/1.1\r\n" + START + b"\r\n",
    "NUL in a file's name": b"GET /static/000000000000/%00../secret_key HTTP/1.1\r\n" + START + b"\r\n",
    "a way out of the folder": b"GET /static/x/..%2f..%2f..%2f..%2fetc/passwd HTTP/1.1\r\n" + START + b"\r\n",
    "broken escapes": b"GET /%zz%f0%28%8c%28?a=%ff%fe&%=% HTTP/1.1\r\n" + START + b"\r\n",
    "bytes that are no text": b"GET /\xff\xc0\xaf?\xf0\x28 HTTP/1.1\r\n" + START + b"Cookie: \xff=\xfe\r\n\r\n",
    "another site's path": b"GET //evil.example/%2e%2e HTTP/1.1\r\n" + START + b"\r\n",
    "another site's address": b"GET http://evil.example/ HTTP/1.1\r\n" + START + b"\r\n",
    "a long path": b"GET /" + 200_000 * b"a" + b" HTTP/1.1\r\n" + START + b"\r\n",
    "endless headers": b"GET / HTTP/1.1\r\n" + START + b"".join(b"X-%d: y\r\n" % n for n in range(50_000)),
    "one endless header": b"GET / HTTP/1.1\r\n" + START + b"X: " + 1_000_000 * b"y",
    "many cookies": b"GET / HTTP/1.1\r\n" + START + b"Cookie: " + b"a=b; " * 20_000 + b"\r\n\r\n",
    "a folded header": b"GET / HTTP/1.1\r\n" + START + b"X: y\r\n\tz\r\n\r\n",
    "a header without a name": b"GET / HTTP/1.1\r\n" + START + b": y\r\n\r\n",
    "line feeds alone": b"GET / HTTP/1.1\nHost: HOST\nX: y\n\n",
    "two hosts": b"GET / HTTP/1.1\r\nHost: evil.example\r\n" + START + b"\r\n",
    "a host with a path": b"GET / HTTP/1.1\r\nHost: HOST/@evil.example\r\nConnection: close\r\n\r\n",
    "no host": b"GET / HTTP/1.1\r\nConnection: close\r\n\r\n",
    "an injected header": b"GET /?lang=en%0d%0aX-Injected:%201&next=%0d%0aX-Injected:1 HTTP/1.1\r\n" + START + b"\r\n",
    "an injected cookie": b"GET /resume/%0d%0aSet-Cookie:participant=X-Injected HTTP/1.1\r\n" + START + b"\r\n",
    "a negative length": POST + b"Content-Length: -1\r\n\r\nagree=yes",
    "a length that is no number": POST + b"Content-Length: 1e9\r\n\r\nagree=yes",
    "two lengths": POST + b"Content-Length: 9\r\nContent-Length: 0\r\n\r\nagree=yes",
    "a length beyond all": POST + b"Content-Length: " + 400 * b"9" + b"\r\n\r\nagree=yes",
    "a length and chunks": POST
    + b"Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\nGET / HTTP/1.1\r\n\r\n",
    "chunks without a size": POST + b"Transfer-Encoding: chunked\r\n\r\nagree=yes\r\n",
    "chunks of a negative size": POST + b"Transfer-Encoding: chunked\r\n\r\n-5\r\nagree\r\n0\r\n\r\n",
    "chunks of another size": POST + b"Transfer-Encoding: chunked\r\n\r\n3\r\nagree=yes\r\n0\r\n\r\n",
    "chunks that promise too much": POST + b"Transfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\nagree",
    "chunks that end early": POST + b"Transfer-Encoding: chunked\r\n\r\n9\r\nagr",
    "a form that ends early": POST + b"Content-Length: 1000\r\n\r\nagree=yes",
    "a form of no kind": POST + b"Content-Type: multipart/form-data\r\nContent-Length: 9\r\n\r\nagree=yes",
    "a form in no alphabet": POST
    + b"Content-Type: application/x-www-form-urlencoded; charset=utf-99\r\nContent-Length: 9\r\n\r\nagree=yes",
    "a form of broken escapes": POST
    + b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 18\r\n\r\nagree=%ff%00&%zz=%",
    "garbage after a request": b"GET / HTTP/1.1\r\nHost: HOST\r\n\r\n" + 1000 * b"\x00garbage\r\n" + b"\r\n\r\n",
    "a hundred requests at once": 100 * b"GET /healthz HTTP/1.1\r\nHost: HOST\r\n\r\n"
    + b"GET / HTTP/1.1\r\n"
    + START
    + b"\r\n",
    "a promise to go on": POST + b"Expect: 100-continue\r\nContent-Length: 9\r\n\r\nagree=yes",
    "an unknown expectation": POST + b"Expect: a miracle\r\nContent-Length: 9\r\n\r\nagree=yes",
    "a websocket": b"GET / HTTP/1.1\r\nHost: HOST\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\r\n",
    "ranges": b"GET / HTTP/1.1\r\n" + START + b"Range: bytes=" + 1000 * b"0-1," + b"\r\n\r\n",
}

UNANSWERED = {
    "nothing but line ends",
    "no HTTP",
    "line feeds alone",
    "chunks that promise too much",
    "chunks that end early",
    "a form that ends early",
}
"""What is not yet a request when the client says no more."""


pytestmark = pytest.mark.sqlite_only(reason="one server serves the whole module")


@pytest.fixture(scope="module")
def instance(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("abuse") / "instance"
    write_bundle(folder, read_study())
    return folder


@pytest.fixture(scope="module")
def server(instance: Path) -> Iterator[Server]:
    """One server for all; at its end it must not have said a word about any of it."""
    with serving(instance) as running:
        yield running
        assert "Traceback" not in running.stop()[1]


@pytest.mark.parametrize("name", RAW)
def test_no_bytes_are_an_error_of_the_server_or_end_it(server: Server, name: str) -> None:
    answer = send(server.port, RAW[name])
    statuses = [int(status) for status in re.findall(r"(?m)^HTTP/1\.[01] (\d{3})", answer)]
    assert all(status < 500 for status in statuses), answer[:500]
    assert bool(statuses) != (name in UNANSWERED)
    head = answer.partition("\r\n\r\n")[0]
    assert not re.search(r"(?im)^(x-injected|set-cookie:.*x-injected|location:.*evil)", head)
    assert "root:" not in answer
    assert is_served(server.port)


def test_unused_sessions_store_nothing_and_used_ones_lock_nobody_out(server: Server, instance: Path) -> None:
    """Without nginx nothing counts addresses: docs/decisions/0032-deployment.md says why."""
    before = num_rows(instance, "participants")
    with urllib3.HTTPConnectionPool("127.0.0.1", server.port, maxsize=8) as pool, ThreadPoolExecutor(8) as hands:
        pages = list(hands.map(lambda _: pool.request("GET", "/").data.decode(), range(300)))
        assert num_rows(instance, "participants") == before
        nonces = [re.findall(r'name="nonce" value="(\w+)"', page)[0] for page in pages[:100]]
        statuses = list(hands.map(lambda nonce: _agree(pool, nonce), nonces))
    assert statuses == 100 * [303]
    assert num_rows(instance, "participants") == before + 100
    # The same page sent again is the same participant: no session is opened by repeating one.
    with urllib3.HTTPConnectionPool("127.0.0.1", server.port) as pool:
        assert {_agree(pool, nonces[0]) for _ in range(20)} == {303}
    assert num_rows(instance, "participants") == before + 100
    assert is_served(server.port)


def test_two_hundred_slow_connections_hold_up_nobody(server: Server) -> None:
    assert num_served_beside_slow_ones(server.port) == NUM_OTHERS
    # Control: a server that reads one connection after the other serves nobody.
    with one_after_the_other() as port:
        assert num_served_beside_slow_ones(port, num_slow=1) == 0


def test_a_hundred_megabytes_are_refused_and_not_held(server: Server) -> None:
    before = resident_kb(server.process.pid)
    length = f"Content-Length: {MANY_BYTES}\r\n\r\n".encode()
    assert send(server.port, POST + length).startswith("HTTP/1.1 413 ")
    for rest in (length, b"Transfer-Encoding: chunked\r\n\r\n"):
        begun_at = time.monotonic()
        num_sent, answer = pour(server.port, POST + rest)
        assert num_sent < MANY_BYTES
        assert answer == "" or answer.startswith("HTTP/1.1 413 ")
        assert time.monotonic() - begun_at < 30
    assert resident_kb(server.process.pid) - before <= MOST_GROWTH_KB
    # What is beyond a form's size and within the server's is told on a page.
    told = send(server.port, POST + b"Content-Length: 70000\r\n\r\n" + 70_000 * b"x")
    assert told.startswith("HTTP/1.1 413 ")
    assert "<h1>" in told
    assert is_served(server.port)


@pytest.mark.parametrize("num_parts", [101, 10_000])
def test_forms_of_many_parts_are_refused(server: Server, num_parts: int) -> None:
    part = b'--x\r\nContent-Disposition: form-data; name="a"\r\n\r\n\r\n'
    body = num_parts * part + b"--x--\r\n"
    kind = f"Content-Type: multipart/form-data; boundary=x\r\nContent-Length: {len(body)}\r\n\r\n".encode()
    assert send(server.port, POST + kind + body).startswith("HTTP/1.1 413 ")
    # As many fields of the usual kind are a form without consent, if they fit.
    body = num_parts * b"a=1&"
    kind = f"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: {len(body)}\r\n\r\n".encode()
    assert send(server.port, POST + kind + body).startswith("HTTP/1.1 422 ")


def send(port: int, raw: bytes) -> str:
    """Send bytes, then nothing more, and return all that comes."""
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        try:
            connection.sendall(raw.replace(b"HOST", f"127.0.0.1:{port}".encode()))
            connection.shutdown(socket.SHUT_WR)
        except OSError:
            pass  # The server has closed already; what it said is read all the same.
        return read_all(connection)


def pour(port: int, head: bytes) -> tuple[int, str]:
    """Send a hundred megabytes unless the server stops it; return how many were sent, and the answer."""
    piece, num_sent = b"10000\r\n" + 65_536 * b"x" + b"\r\n", 0
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        connection.sendall(head.replace(b"HOST", f"127.0.0.1:{port}".encode()))
        try:
            while num_sent < MANY_BYTES:
                connection.sendall(piece)
                num_sent += len(piece)
        except OSError:
            pass
        return num_sent, read_all(connection)


def is_served(port: int, timeout_s: float = 10) -> bool:
    """Tell whether a page is answered to somebody else."""
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=timeout_s) as connection:
            connection.sendall(b"GET / HTTP/1.1\r\n" + START.replace(b"HOST", f"127.0.0.1:{port}".encode()) + b"\r\n")
            return connection.recv(12) == b"HTTP/1.1 200"
    except OSError:
        return False


def num_served_beside_slow_ones(port: int, num_slow: int = NUM_SLOW) -> int:
    """Hold connections with half a head, or half a form, and count how many others get an answer."""
    halves = (b"GET / HTTP/1.1\r\nHost: ", POST + b"Content-Length: 1000\r\n\r\nagree=")
    with ExitStack() as stack:
        for number in range(num_slow):
            slow = stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=10))
            slow.sendall(halves[number % 2])
        patience_s = 10 if num_slow > 1 else 0.5
        with ThreadPoolExecutor(NUM_OTHERS) as hands:
            return sum(hands.map(lambda _: is_served(port, patience_s), range(NUM_OTHERS)))


@contextmanager
def one_after_the_other() -> Iterator[int]:
    """Run a server that has one hand, and return its port."""
    with HTTPServer(("127.0.0.1", 0), SimpleHTTPRequestHandler) as single:
        thread = threading.Thread(target=single.serve_forever, args=(0.05,))
        thread.start()
        yield single.server_port
        single.shutdown()
        thread.join()


def resident_kb(pid: int) -> int:
    """Return how much memory a process holds."""
    told = subprocess.run(["/bin/ps", "-o", "rss=", "-p", str(pid)], capture_output=True, text=True, check=True)
    return int(told.stdout)


def _agree(pool: urllib3.HTTPConnectionPool, nonce: str) -> int:
    form = {"agree": "yes", "nonce": nonce}
    headers = {"Sec-Fetch-Site": "same-origin"}
    return pool.request("POST", "/consent", fields=form, encode_multipart=False, headers=headers, redirect=False).status
