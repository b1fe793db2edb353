"""The real nginx with the project's configuration: its own ports, certificate and logs are all that differs."""

import os
import shutil
import socket
import ssl
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from tests.conftest import ROOT

NAME = "study.example.org"
_PATIENCE_S = 10.0
_UNCHANGED: Mapping[str, str] = MappingProxyType({})
_PLACES = {"conf.d/xar.conf": "xar.conf", "nginx.conf": "nginx.conf", "snippets": "snippets", "xar-pages": "pages"}


@dataclass(frozen=True, slots=True)
class Edge:
    """A running nginx.

    Attributes:
        folder: Where its configuration, its certificate and its logs are.
        http_port: Where it listens without TLS, on 127.0.0.1.
        https_port: Where it listens with TLS.
    """

    folder: Path
    http_port: int
    https_port: int

    @property
    def certificate(self) -> Path:
        """The certificate that a browser is to trust."""
        return self.folder / "tls/fullchain.pem"

    def logged(self) -> str:
        """Everything that was written to any log."""
        return "".join(path.read_text(encoding="utf-8") for path in sorted((self.folder / "log").iterdir()))

    def connect(self, name: str = NAME, timeout_s: float = _PATIENCE_S) -> ssl.SSLSocket:
        """Open a connection as a browser does that looks for a name."""
        context = ssl.create_default_context(cafile=self.certificate)
        context.check_hostname = name == NAME
        return context.wrap_socket(
            socket.create_connection(("127.0.0.1", self.https_port), timeout=timeout_s), server_hostname=name
        )

    def ask(self, raw: bytes, name: str = NAME) -> str:
        """Send bytes over TLS and return all that comes until the server closes."""
        with self.connect(name) as connection:
            connection.sendall(raw)
            return read_all(connection)


def read_all(connection: socket.socket) -> str:
    """Return what comes until the other side closes, even if it does so harshly."""
    came = bytearray()
    try:
        while piece := connection.recv(65536):
            came += piece
    except ConnectionError:
        pass
    return came.decode("latin-1")


def request(path: str, *headers: str, method: str = "GET", body: bytes = b"", host: str = NAME) -> bytes:
    """Write a request after whose answer the connection is closed."""
    length = [f"Content-Length: {len(body)}"] if body else []
    lines = [f"{method} {path} HTTP/1.1", f"Host: {host}", "Connection: close", *length, *headers]
    return "\r\n".join([*lines, "", ""]).encode() + body


def lay_out(
    folder: Path, http_port: int, https_port: int, upstreams: Sequence[int], other: Mapping[str, str] = _UNCHANGED
) -> None:
    """Write the configuration as a laboratory installs it, to a folder in place of `/etc/nginx`.

    Args:
        folder: The folder, which there must not be yet.
        http_port: Replaces 80.
        https_port: Replaces 443.
        upstreams: The ports of the servers behind nginx.
        other: What a test does differently on purpose: texts and what replaces them.
    """
    for name in ("conf.d", "log", "tls"):
        (folder / name).mkdir(parents=True)
    for place, source in _PLACES.items():
        origin = ROOT / "deploy/nginx" / source
        (shutil.copytree if origin.is_dir() else shutil.copy)(origin, folder / place)
    servers = " ".join(f"server 127.0.0.1:{port};" for port in upstreams)
    changes = {
        "listen 80": f"listen 127.0.0.1:{http_port}",
        "listen 443": f"listen 127.0.0.1:{https_port}",
        "server 127.0.0.1:8000;": servers,
        "worker_processes auto": "worker_processes 1",
        "/etc/nginx/mime.types": "/etc/nginx//mime.types",
        "/etc/nginx/": f"{folder}/",
        f"{folder}//": "/etc/nginx/",
        "/var/log/nginx/": f"{folder}/log/",
        "/run/nginx.pid": f"{folder}/nginx.pid",
    }
    files = [folder / "nginx.conf", folder / "conf.d/xar.conf", *(folder / "snippets").iterdir()]
    written = {path: path.read_text(encoding="utf-8") for path in files}
    for old, new in {**other, **changes}.items():
        assert any(old in text for text in written.values()), f"no file has {old!r}"
        written = {path: text.replace(old, new) for path, text in written.items()}
    for path, text in written.items():
        path.write_text(text, encoding="utf-8")
    _make_certificate(folder / "tls")


def nginx(folder: Path, *options: str) -> list[str]:
    """Return the command that runs nginx with a folder's configuration."""
    program = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin:/usr/local/sbin")
    assert program is not None, "nginx is missing; `make install-browser` installs Debian's as root"
    # The test's folder is closed to everyone but its owner.
    user = " user root;" if os.geteuid() == 0 else ""
    return [program, "-c", str(folder / "nginx.conf"), "-g", f"daemon off;{user}", *options]


def check(folder: Path) -> subprocess.CompletedProcess[str]:
    """Let nginx test a folder's configuration."""
    return subprocess.run(nginx(folder, "-t"), capture_output=True, text=True, timeout=30, check=False)


@contextmanager
def edge(folder: Path, *upstreams: int, other: Mapping[str, str] = _UNCHANGED) -> Iterator[Edge]:
    """Run nginx before servers of this machine, for as long as the context lasts."""
    http_port, https_port = _free_ports(2)
    lay_out(folder, http_port, https_port, upstreams, other)
    with running(folder, http_port, https_port) as found:
        yield found


@contextmanager
def running(folder: Path, http_port: int, https_port: int) -> Iterator[Edge]:
    """Run nginx with what was laid out in a folder."""
    with subprocess.Popen(nginx(folder), stderr=subprocess.PIPE, text=True) as process:
        try:
            _wait_for(process, https_port)
            yield Edge(folder, http_port, https_port)
        finally:
            process.terminate()
            process.wait(_PATIENCE_S)


def _wait_for(process: "subprocess.Popen[str]", port: int) -> None:
    ends_at = time.monotonic() + _PATIENCE_S
    while process.poll() is None and time.monotonic() < ends_at:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.02)
    process.kill()
    assert process.stderr is not None
    raise AssertionError(f"nginx does not listen: {process.stderr.read()}")


def _free_ports(count: int) -> list[int]:
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def _make_certificate(folder: Path) -> None:
    key, certificate = folder / "privkey.pem", folder / "fullchain.pem"
    kind = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-x509", "-days", "2"]
    name = ["-subj", f"/CN={NAME}", "-addext", f"subjectAltName=DNS:{NAME}"]
    openssl = shutil.which("openssl")
    assert openssl is not None, "openssl is missing; `make install-browser` installs Debian's as root"
    subprocess.run(
        [openssl, "req", *kind, *name, "-keyout", str(key), "-out", str(certificate)], capture_output=True, check=True
    )
