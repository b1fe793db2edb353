"""A name that stands for two addresses, as `localhost` does where there is IPv6 as well: both are listened on."""

import http.client
from contextlib import closing
from pathlib import Path

import pytest

from tests.faults.program import free_port
from tests.web.servers import serving
from webapp.storage.instance import running_server

FIRST, SECOND = "127.0.0.2", "127.0.0.1"
"""Two of this machine's own, in the place of ::1 and 127.0.0.1: not every machine that runs tests has IPv6."""

_RESOLVER = f"""
import socket

_known = socket.getaddrinfo


def getaddrinfo(host, *more, **named):
    hosts = ({FIRST!r}, {SECOND!r}) if host == "localhost" else (host,)
    return [found for one in hosts for found in _known(one, *more, **named)]


socket.getaddrinfo = getaddrinfo
"""


@pytest.fixture
def resolver(tmp_path: Path) -> str:
    """The folder with a module that Python imports when it starts, after which `localhost` has two addresses."""
    folder = tmp_path / "resolver"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(_RESOLVER, encoding="utf-8")
    return str(folder)


def status(address: str, port: int) -> int:
    """Ask one of the addresses as if it had been found by the name."""
    with closing(http.client.HTTPConnection(address, port, timeout=10)) as connection:
        connection.request("GET", "/", headers={"Host": f"localhost:{port}"})
        return connection.getresponse().status


def test_a_name_with_two_addresses_is_served_on_both(instance: Path, resolver: str) -> None:
    port = free_port()
    with serving(instance, "--host", "localhost", "--port", str(port), PYTHONPATH=resolver) as server:
        assert server.lines[0] == f"Participants: http://localhost:{port}/"
        assert running_server(instance) == f"http://localhost:{port}"
        assert [status(address, port) for address in (FIRST, SECOND)] == [200, 200]
        code, said = server.stop()
        assert (code, said) == (0, "")


def test_on_a_free_port_the_announced_one_answers(instance: Path, resolver: str) -> None:
    """Each address gets a port of its own; the first address's is told."""
    with serving(instance, "--host", "localhost", PYTHONPATH=resolver) as server:
        assert server.lines[0] == f"Participants: http://localhost:{server.port}/"
        assert status(FIRST, server.port) == 200
        assert server.stop()[0] == 0
