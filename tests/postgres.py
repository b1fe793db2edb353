"""A PostgreSQL server of the tests' own, and a fresh database on it for each test that wants one."""

import os
import pwd
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import psycopg

from webapp.storage.database import Database

IS_WANTED = os.environ.get("XAR_TEST_POSTGRES") == "1"
"""Whether all tests that store something do so in PostgreSQL."""

TEMPLATE = "xar_template"
_STARTS_WITHIN_S = 60
_GONE_WITHIN_S = 30
_BINARIES = ("/usr/lib/postgresql/*/bin", "/opt/homebrew/opt/postgresql*/bin", "/usr/pgsql-*/bin")


@dataclass(frozen=True, slots=True)
class Server:
    """A running server, reached over a socket in its folder.

    Attributes:
        folder: What belongs to it; its data are in `data`.
    """

    folder: Path

    def url(self, name: str) -> str:
        """Return the address of a database."""
        return f"postgresql://xar@/{name}?host={self.folder}"

    def connect(self, name: str = "postgres") -> psycopg.Connection:
        """Connect as the one who may do everything."""
        return psycopg.connect(self.url(name), autocommit=True)

    def make(self, name: str | None = None, template: str = TEMPLATE) -> str:
        """Make a database and return its name."""
        name = name or f"test_{secrets.token_hex(6)}"
        with closing(self.connect()) as connection:
            connection.execute(f"CREATE DATABASE {name} TEMPLATE {template}")
        return name

    def drop(self, name: str) -> None:
        """Drop a database, whoever uses it."""
        with closing(self.connect()) as connection:
            connection.execute(f"DROP DATABASE IF EXISTS {name} WITH (FORCE)")

    def start(self, *, wait: bool = True) -> None:
        """Start, and return when connections are accepted, or at once."""
        options = f"-c listen_addresses= -c unix_socket_directories={self.folder} -c max_connections=100"
        waiting = "-w" if wait else "-W"
        run("pg_ctl", "start", waiting, "-D", self.folder / "data", "-l", self.folder / "log", "-o", options)

    def stop(self, mode: str = "fast") -> None:
        """Stop. `immediate` is as if the machine had stopped."""
        run("pg_ctl", "stop", "-w", "-D", self.folder / "data", "-m", mode)

    @contextmanager
    def gone(self) -> Iterator[None]:
        """Be gone for as long as the context lasts, as if the machine had stopped meanwhile."""
        self.stop("immediate")
        try:
            yield
        finally:
            self.start()

    def kill(self) -> None:
        """Kill the process that all others come from, and return when these have noticed it and are gone too."""
        locks = (self.folder / "data/postmaster.pid", self.folder / ".s.PGSQL.5432.lock")
        os.kill(int(locks[0].read_text(encoding="utf-8").split()[0]), signal.SIGKILL)
        ends_at = time.monotonic() + _GONE_WITHIN_S
        while left := self._processes():
            assert time.monotonic() < ends_at, f"still there after {_GONE_WITHIN_S} s: processes {left}"
            time.sleep(0.02)
        for lock in locks:  # Until somebody has waited for the process that they name, it would seem to be there.
            lock.unlink()

    def await_connections(self) -> float:
        """Return as soon as connections are accepted; the monotonic time then, in seconds."""
        ends_at = time.monotonic() + _STARTS_WITHIN_S
        while True:
            try:
                self.connect().close()
            except psycopg.OperationalError:
                assert time.monotonic() < ends_at, (self.folder / "log").read_text(encoding="utf-8")[-2000:]
                time.sleep(0.01)
            else:
                return time.monotonic()

    def _processes(self) -> list[int]:
        """Return the processes that have its data as their working directory, which all of PostgreSQL's do."""
        found = []
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):  # It is another user's, or has just ended.
                if (process / "cwd").readlink() == self.folder / "data":
                    found.append(int(process.name))
        return found


@contextmanager
def a_server(*, on_disk: bool = False) -> Iterator[Server]:
    """Run a server for as long as the context lasts, with the tables made in a template.

    Args:
        on_disk: Whether its files lie where flushing them costs what it costs.
    """
    # A socket's path may have a hundred bytes: pytest's folders are too deep.
    # In memory, a flush costs nothing; the server still does it.
    memory = Path("/dev/shm")  # noqa: S108 - where Linux has it.
    place = memory if os.access(memory, os.W_OK) and not on_disk else None
    with tempfile.TemporaryDirectory(prefix="xar-pg-", dir=place, ignore_cleanup_errors=True) as name:
        server = Server(Path(name))
        watchdog = _watch(server.folder)
        owner = _owner()
        if owner is not None:
            shutil.chown(server.folder, owner)
        run("initdb", "-D", server.folder / "data", "-U", "xar", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync")
        server.start()
        try:
            server.make(TEMPLATE, template="template0")
            with closing(Database(Path("unused"), server.url(TEMPLATE))) as database:
                database.upgrade()
            yield server
        finally:
            server.stop("immediate")
            watchdog.communicate(b"ended")


_WATCHDOG = """
import os, shutil, signal, sys, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
if not sys.stdin.buffer.read():
    try:
        with open(os.path.join(sys.argv[1], "data", "postmaster.pid")) as file:
            number = int(file.readline())
        os.kill(number, signal.SIGQUIT)
        for _ in range(100):
            os.kill(number, 0)
            time.sleep(0.1)
    except (OSError, ValueError):
        pass
    shutil.rmtree(sys.argv[1], ignore_errors=True)
"""


def _watch(folder: Path) -> subprocess.Popen[bytes]:
    """Start a process that ends the server and removes its folder, should this process end without doing so.

    The pipe to it closes with this process, however that ends.
    """
    return subprocess.Popen(
        [sys.executable, "-c", _WATCHDOG, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def run(program: str, *arguments: str | Path) -> None:
    """Run one of PostgreSQL's programs, as another user where this one is root, which they refuse to be run by."""
    owner = _owner()
    identity = {} if owner is None else {"user": owner, "group": pwd.getpwnam(owner).pw_gid, "extra_groups": []}
    finished = subprocess.run(
        [binaries() / program, *arguments],
        cwd="/",
        check=False,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **identity,  # type: ignore[call-overload]
    )
    assert finished.returncode == 0, f"{program}: {finished.stdout}"


@cache
def binaries() -> Path:
    """Return the folder of PostgreSQL's programs: `XAR_POSTGRES`, or the newest that is found."""
    named = os.environ.get("XAR_POSTGRES")
    found = [path for pattern in _BINARIES for path in Path("/").glob(pattern[1:]) if (path / "initdb").exists()]
    on_path = shutil.which("initdb")
    choices = [Path(named)] if named else [*sorted(found), *([Path(on_path).parent] if on_path else [])]
    assert choices, "PostgreSQL was not found: apt-get install postgresql, or name the folder of initdb in XAR_POSTGRES"
    return choices[-1]


def _owner() -> str | None:
    if os.geteuid() != 0:
        return None
    names = {entry.pw_name for entry in pwd.getpwall()}
    return "postgres" if "postgres" in names else "nobody"
