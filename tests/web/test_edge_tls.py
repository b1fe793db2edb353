"""What nginx and browsers agree on before a byte is sent."""

import socket
import ssl
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.web.edge import NAME, Edge, edge, request
from tests.web.upstreams import upstream

OLD = {
    "ssl_protocols TLSv1.2 TLSv1.3": "ssl_protocols TLSv1 TLSv1.1 TLSv1.2 TLSv1.3",
    "ECDHE-RSA-CHACHA20-POLY1305;": "ALL:@SECLEVEL=0;",
}
"""What the tests must find fault with."""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Edge]:
    with upstream() as server, edge(tmp_path_factory.mktemp("tls") / "nginx", server.port) as found:
        yield found


def agreed(found: Edge, version: ssl.TLSVersion, ciphers: str = "ALL:@SECLEVEL=0") -> tuple[str, str] | None:
    """Connect by one version of TLS; return version and cipher, or None where nginx refuses."""
    context = ssl.create_default_context(cafile=found.certificate)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        context.set_ciphers(ciphers)
        context.minimum_version = context.maximum_version = version
    try:
        plain = socket.create_connection(("127.0.0.1", found.https_port), timeout=10)
        with plain, context.wrap_socket(plain, server_hostname=NAME) as secure:
            secure.sendall(request("/"))
            assert secure.recv(12) == b"HTTP/1.1 200"
            used = secure.cipher()
            return (secure.version() or "", used[0] if used else "")
    except (ssl.SSLError, ConnectionError):
        return None


def test_browsers_connect_by_tls_1_2_and_1_3_alone(found: Edge, tmp_path: Path) -> None:
    versions = (ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1, ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3)
    told = [agreed(found, version) for version in versions]
    assert told[:2] == [None, None]
    assert [one and one[0] for one in told[2:]] == ["TLSv1.2", "TLSv1.3"]
    # Control: an nginx that lets old versions in is found out.
    with upstream() as server, edge(tmp_path / "old", server.port, other=OLD) as old:
        assert agreed(old, ssl.TLSVersion.TLSv1_1) is not None


def test_every_cipher_is_forward_secret_and_authenticated(found: Edge) -> None:
    context = ssl.create_default_context()
    context.set_ciphers("ALL:!aNULL:@SECLEVEL=0")
    offered = [str(one["name"]) for one in context.get_ciphers() if not str(one["name"]).startswith("TLS_")]
    taken = {name for name in offered if agreed(found, ssl.TLSVersion.TLSv1_2, f"{name}:@SECLEVEL=0")}
    assert taken
    assert all(name.startswith("ECDHE-") and ("GCM" in name or "POLY1305" in name) for name in taken)
    # Control: this client offers others too.
    assert any("CBC" in name or name.startswith("AES") for name in offered)
