"""Requests that are too long or too large, told so by each of the real servers with the status that fits."""

import re
import socket
import ssl
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

import pytest

from tests import postgres
from tests.web.bundles import read_study, write_bundle
from tests.web.edge import NAME, Edge, edge, read_all
from tests.web.servers import Server, serving

HOST = f"Host: {NAME}\r\nConnection: close\r\n".encode()
FORM = b"POST /consent HTTP/1.1\r\nSec-Fetch-Site: same-origin\r\n" + HOST
PART = b'--x\r\nContent-Disposition: form-data; name="a"\r\n\r\n\r\n'
MULTIPART = b"Content-Type: multipart/form-data; boundary=x\r\n"
URLENCODED = b"Content-Type: application/x-www-form-urlencoded\r\n"


def with_body(body: bytes, kind: bytes = URLENCODED) -> bytes:
    return FORM + kind + f"Content-Length: {len(body)}\r\n\r\n".encode() + body


def with_path(length: int) -> bytes:
    return b"GET /?" + (length - len("GET /? HTTP/1.1")) * b"a" + b" HTTP/1.1\r\n" + HOST + b"\r\n"


def with_headers(number: int) -> bytes:
    return b"GET /declined HTTP/1.1\r\n" + HOST + b"".join(b"X-%d: y\r\n" % one for one in range(number)) + b"\r\n"


def with_header(size: int) -> bytes:
    return b"GET /declined HTTP/1.1\r\n" + HOST + b"Cookie: a=" + size * b"y" + b"\r\n\r\n"


CUT = 0
"""The server closed while the client was still sending, so that its answer may not have arrived."""

# Each with what waitress, nginx before it, and gunicorn say to it.
REQUESTS: Mapping[str, tuple[bytes, int, int, int]] = {
    "a usual one": (with_header(100), 200, 200, 200),
    "a line of 2,000 bytes": (with_path(2_000), 303, 303, 303),
    "a line of 5,000 bytes": (with_path(5_000), 303, 303, 400),
    "a line of 10,000 bytes": (with_path(10_000), 303, 414, 400),
    "a line of 300,000 bytes": (with_path(300_000), 431, 414, 400),
    "40 headers": (with_headers(40), 200, 200, 200),
    "100 headers": (with_headers(100), 200, 200, 431),
    "50,000 headers": (with_headers(50_000), 431, 400, 431),
    "a header of 4,000 bytes": (with_header(4_000), 200, 200, 200),
    "a header of 9,000 bytes": (with_header(9_000), 200, 400, 431),
    "a header of 40,000 bytes": (with_header(40_000), 200, 400, 431),
    "a header of 300,000 bytes": (with_header(300_000), 431, 400, 431),
    "a body of 60,000 bytes": (with_body(b"x=" + 60_000 * b"y"), 422, 422, 422),
    "a body of 70,000 bytes": (with_body(b"x=" + 70_000 * b"y"), 413, 413, 413),
    "a body of 100 MB": (FORM + URLENCODED + b"Content-Length: 104857600\r\n\r\n" + 1000 * b"x", 413, 413, 413),
    "100 parts": (with_body(100 * PART + b"--x--\r\n", MULTIPART), 422, 422, 422),
    "101 parts": (with_body(101 * PART + b"--x--\r\n", MULTIPART), 413, 413, 413),
    "10,000 parts": (with_body(10_000 * PART + b"--x--\r\n", MULTIPART), 413, 413, 413),
    "10,000 fields": (with_body(10_000 * b"a=1&"), 422, 422, 422),
    "20,000 fields": (with_body(20_000 * b"a=1&"), 413, 413, 413),
}

pytestmark = pytest.mark.sqlite_only(reason="each server has a database of its own kind")


@pytest.fixture(scope="module")
def waitress(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    instance = tmp_path_factory.mktemp("waitress") / "instance"
    write_bundle(instance, read_study())
    with serving(instance, XAR_HTTPS="yes", XAR_TRUSTED_HOSTS=NAME) as server:
        yield server
        assert "Traceback" not in server.stop()[1]


@pytest.fixture(scope="module")
def nginx(waitress: Server, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Edge]:
    with edge(tmp_path_factory.mktemp("nginx") / "site", waitress.port) as found:
        yield found


@pytest.fixture(scope="module")
def gunicorn(tmp_path_factory: pytest.TempPathFactory, postgres_server: postgres.Server) -> Iterator[Server]:
    instance = tmp_path_factory.mktemp("gunicorn") / "instance"
    write_bundle(instance, read_study())
    given = {"DATABASE_URL": postgres_server.url(postgres_server.make()), "XAR_HTTPS": "yes"}
    with serving(instance, "--workers", "2", XAR_TRUSTED_HOSTS=NAME, **given) as server:
        yield server
        assert "Traceback" not in server.stop()[1]


@pytest.mark.parametrize("name", REQUESTS)
def test_waitress_says_what_is_too_much(waitress: Server, name: str) -> None:
    raw, wanted, *_ = REQUESTS[name]
    assert status(send(_plainly(waitress.port), raw)) in expected(raw, wanted)
    assert status(send(_plainly(waitress.port), REQUESTS["a usual one"][0])) == 200


@pytest.mark.parametrize("name", REQUESTS)
def test_nginx_says_what_is_too_much(nginx: Edge, name: str) -> None:
    raw, _, wanted, _ = REQUESTS[name]
    assert status(send(nginx.connect, raw)) in expected(raw, wanted)
    assert status(send(nginx.connect, REQUESTS["a usual one"][0])) == 200


@pytest.mark.parametrize("name", REQUESTS)
def test_gunicorn_says_what_is_too_much(gunicorn: Server, name: str) -> None:
    raw, *_, wanted = REQUESTS[name]
    assert status(send(_plainly(gunicorn.port), raw)) in expected(raw, wanted)
    assert status(send(_plainly(gunicorn.port), REQUESTS["a usual one"][0])) == 200


def expected(raw: bytes, wanted: int) -> set[int]:
    """Return the statuses that may be seen: of what is much longer than a server reads, the answer may get lost."""
    return {wanted, CUT} if len(raw) > 200_000 and wanted >= 400 else {wanted}


def send(connect: Callable[[], socket.socket], raw: bytes) -> str:
    """Send bytes and return what comes; a server that has said no closes before it has read all of them."""
    try:
        with connect() as connection:
            with suppress(OSError):
                connection.sendall(raw)
            return read_all(connection)
    except ssl.SSLError:
        return ""


def status(answer: str) -> int:
    """Return the status of an answer, `CUT` where none arrived."""
    found = re.match(r"HTTP/1\.[01] (\d{3}) ", answer)
    return CUT if found is None else int(found[1])


def _plainly(port: int) -> Callable[[], socket.socket]:
    return lambda: socket.create_connection(("127.0.0.1", port), timeout=20)
