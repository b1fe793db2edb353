"""The server that bots talk to: the one that runs on this instance already, else one of their own."""

import os
import re
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from ipaddress import ip_address
from urllib.parse import urlsplit

from webapp.bots.browser import Site
from webapp.bots.errors import BotError
from webapp.config import Config
from webapp.storage.instance import running_server

_SERVE = "from webapp.cli import main; main(prog_name='xar')"
_PATIENCE_S = 10
_TRUSTED_ANYWAY = ("localhost", "127.0.0.1", "[::1]")


@contextmanager
def a_server(config: Config) -> Iterator[Site]:
    """Find the running server of an instance, or run one for as long as the context lasts.

    Args:
        config: Says which instance and, for a server of their own, which study.

    Raises:
        BotError: The running server is on another machine, or a new one does not start.
    """
    address = running_server(config.instance)
    if address is not None:
        yield site_of(address, config.trusted_hosts)
        return
    with _own_server(config) as own:
        yield site_of(own, _TRUSTED_ANYWAY)


def site_of(address: str, trusted_hosts: tuple[str, ...]) -> Site:
    """Return how to reach an address, which has to be one of this machine.

    Args:
        address: Such as `http://127.0.0.1:8000`.
        trusted_hosts: The names that the server listens to; empty for all. The first is taken if its own is not among
            them, as behind a proxy.

    Raises:
        BotError: It is another machine's address, or none.
    """
    parts = urlsplit(address)
    host = _reachable(parts.hostname or "")
    if not is_of_this_machine(host):
        raise BotError(f"the server {address} is not on this machine; bots talk to a server of this machine only")
    port = parts.port or 80
    written = f"[{host}]" if ":" in host else host
    name = written if not trusted_hosts or written in trusted_hosts else trusted_hosts[0]
    return Site(host, port, f"{name}:{port}")


def _reachable(host: str) -> str:
    """Return where a server can be reached that listens to a host; to all addresses of the machine is to its own."""
    try:
        address = ip_address(host)
    except ValueError:
        return host
    return ("127.0.0.1" if address.version == 4 else "::1") if address.is_unspecified else host  # noqa: PLR2004


def is_of_this_machine(host: str) -> bool:
    """Tell whether an address belongs to this machine: only then it can be listened on."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.bind(address)
    except (OSError, UnicodeError):
        return False
    return True


@contextmanager
def _own_server(config: Config) -> Iterator[str]:
    """Run `xar serve` as a test run, on a free port that nobody else can reach."""
    ours = ("XAR_", "DATABASE_URL", "WEB_CONCURRENCY")
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    settings = {"XAR_INSTANCE": str(config.instance), "XAR_STUDY": config.study}
    if config.database_url is not None:
        settings["DATABASE_URL"] = config.database_url
    command = [sys.executable, "-P", "-c", _SERVE, "serve", "--host", "127.0.0.1", "--port", "0"]
    with (
        tempfile.TemporaryFile("w+") as log,
        subprocess.Popen(  # noqa: S603 - this program itself, with arguments from above.
            command, env=inherited | settings, stdout=subprocess.PIPE, stderr=log, text=True
        ) as process,
    ):
        try:
            assert process.stdout is not None  # noqa: S101 - for the type checker: it is a pipe.
            found = re.search(r"http://\S+", process.stdout.readline())
            if found is None:
                process.wait(_PATIENCE_S)
                log.seek(0)
                said = log.read().strip().splitlines() or ["it said nothing"]
                raise BotError(f"a server for the bots does not start: {said[-1].removeprefix('xar: ')}")
            yield found[0]
        finally:
            _end(process)


def _end(process: "subprocess.Popen[str]") -> None:
    process.terminate()
    try:
        process.wait(_PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
