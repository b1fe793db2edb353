"""Start the server where it must not serve, or not without a word: `python -m tests.faults.gates [--full]` (F18).

Each gate is tried on an instance that has served before and is in order but for one thing. The server either refuses,
in one line that names the thing and with exit status 2, or starts all the same and says so. Without the one thing it
starts without a word. `--full` adds the gates of the PostgreSQL edition.
"""

import argparse
import os
import random
import re
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from tests import postgres
from tests.conftest import ROOT
from tests.faults.client import Browser, take_part
from tests.faults.oracle import Ledger, evidence
from tests.faults.program import running
from tests.web.bundles import read_study, write_bundle
from tests.web.servers import XAR, environment
from webapp.storage.instance import only_server
from webapp.storage.revisions import known_revisions
from webapp.storage.sqlite_edition import journal_mode

OPEN_GATES = (sys.executable, "-m", "tests.faults.mutants", "open_gates")
"""The program without some of its gates, as a control."""

_LISTENS = "Test run: answers are marked as a test."
_PATIENCE_S = 40.0


@contextmanager
def _nothing(_instance: Path) -> Iterator[None]:
    yield


@dataclass(frozen=True, slots=True)
class Gate:
    """Something with which a server must not just start.

    Attributes:
        name: What it is.
        says: What the line has to match.
        spoil: Brings it about in an instance, for as long as the context lasts; it may yield another folder to serve.
        words: What else stands on the command line.
        settings: More environment variables.
        is_refused: Whether the server must not start at all.
        is_bound: Whether permissions bind the server, as they bind all users but root.
    """

    name: str
    says: str
    spoil: Callable[[Path], AbstractContextManager[Path | None]] = _nothing
    words: tuple[str, ...] = ()
    settings: Mapping[str, str] = field(default_factory=dict)
    is_refused: bool = True
    is_bound: bool = False


@dataclass(frozen=True, slots=True)
class Start:
    """How a start went.

    Attributes:
        status: The exit status; None if the server listened, and was stopped then.
        lines: What it said besides its addresses.
    """

    status: int | None
    lines: tuple[str, ...]

    def is_right(self, gate: Gate) -> bool:
        """Tell whether it is what a gate asks for."""
        is_told = any(re.search(gate.says, line) for line in self.lines)
        return is_told and len(self.lines) == 1 and self.status == (2 if gate.is_refused else None)


@contextmanager
def _another_server(instance: Path) -> Iterator[None]:
    with only_server(instance):
        yield


@contextmanager
def _other_journal(instance: Path) -> Iterator[None]:
    """Let another program keep the database in the journal mode that this version of SQLite must not have."""
    other = {"delete": "wal", "wal": "delete"}[journal_mode(sqlite3.sqlite_version_info)]
    with closing(sqlite3.connect(instance / "xar.sqlite3", isolation_level=None)) as connection:
        connection.execute(f"PRAGMA journal_mode={other}")
        connection.execute("BEGIN")
        connection.execute("SELECT * FROM participants").fetchall()
        yield


@contextmanager
def _key(instance: Path, content: bytes | None, mode: int = 0o600) -> Iterator[None]:
    path = instance / "secret_key"
    kept = path.read_bytes()
    path.unlink()
    if content is not None:
        path.write_bytes(content or kept)
        path.chmod(mode)
    yield


@contextmanager
def _moved(instance: Path, folder: str) -> Iterator[Path]:
    moved = instance.parent / folder / instance.name
    shutil.copytree(instance, moved)
    yield moved


@contextmanager
def _revision(instance: Path, revision: str) -> Iterator[None]:
    with closing(sqlite3.connect(instance / "xar.sqlite3", isolation_level=None)) as connection:
        connection.execute("UPDATE alembic_version SET version_num = ?", [revision])
    yield


@contextmanager
def _no_database(instance: Path) -> Iterator[None]:
    (instance / "xar.sqlite3").write_text("This is a letter.\n" * 100, encoding="utf-8")
    yield


@contextmanager
def _without_bundle(instance: Path) -> Iterator[None]:
    shutil.rmtree(instance / "bundles")
    yield


@contextmanager
def read_only(instance: Path) -> Iterator[None]:
    """Let nobody write to an instance, as far as permissions go."""
    instance.chmod(0o500)
    yield
    instance.chmod(0o700)


@contextmanager
def _read_only_database(instance: Path) -> Iterator[None]:
    (instance / "xar.sqlite3").chmod(0o400)
    yield


def gates() -> list[Gate]:
    """Return the gates of the SQLite edition."""
    return [
        Gate("two servers on one instance", "another server is running", _another_server),
        Gate("a journal that may lose commits", "keeps journal mode|locked", _other_journal),
        Gate("more workers than one with SQLite", "SQLite is served by one process", words=("--workers", "2")),
        Gate("a synchronised folder", "is synchronised", partial(_moved, folder="Dropbox"), is_refused=False),
        Gate("no secret key beside data", "made a new secret key", partial(_key, content=None), is_refused=False),
        Gate("a short secret key", "holds 5 bytes, not 32", partial(_key, content=b"short")),
        Gate("a secret key for all to read", "can be read by others", partial(_key, content=b"", mode=0o644)),
        Gate("debugging", "FLASK_DEBUG is '1'", settings={"FLASK_DEBUG": "1"}),
        Gate("tables of an earlier version", "run `xar migrate`", partial(_revision, revision=known_revisions()[-1])),
        Gate("tables of a later version", "made by a later version", partial(_revision, revision="9999")),
        Gate("a database that is none", "cannot be used as the database", _no_database),
        Gate("a folder that cannot be written to", "cannot be written to", read_only, is_bound=True),
        Gate("a database that cannot be written to", "cannot be opened", _read_only_database, is_bound=True),
        Gate("no study built", "xar build", _without_bundle),
        Gate("placeholders in a live study", "still placeholders|xar study publish", words=("--live",)),
        Gate("an address that is none", "DATABASE_URL begins with", settings={"DATABASE_URL": "mysql://x/y"}),
    ]


def postgres_gates(server: postgres.Server) -> list[Gate]:
    """Return the gates of the PostgreSQL edition; the server is left with `fsync` off."""
    name = server.make()
    with closing(server.connect()) as connection:
        connection.execute("ALTER SYSTEM SET fsync = off")
        connection.execute("SELECT pg_reload_conf()")
    return [
        Gate("PostgreSQL without flushes", "fsync", settings={"DATABASE_URL": server.url(name)}),
        Gate(
            "no PostgreSQL there", "cannot", settings={"DATABASE_URL": f"postgresql://x@127.0.0.1:{_closed_port()}/x"}
        ),
    ]


def prepare(instance: Path) -> None:
    """Make an instance that is in order, where somebody has taken part."""
    write_bundle(instance, read_study())
    with running(instance) as program:
        browser = Browser(program.port)
        take_part(browser, Ledger(), random.Random(1), last=2)
        browser.close()


def start(instance: Path, gate: Gate, program: Sequence[str] = XAR) -> Start:
    """Start the server at a gate, on a copy of an instance, and stop it if it does start."""
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch, "instance")
        shutil.copytree(instance, copy)
        with gate.spoil(copy) as moved:
            command = [
                *(bound_by_permissions() if gate.is_bound else ()),
                *program,
                "serve",
                "--port",
                "0",
                *gate.words,
            ]
            variables = environment(moved or copy, **{"DATABASE_URL": "", **gate.settings})
            with subprocess.Popen(
                command, cwd=ROOT, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
            ) as process:
                return _outcome(process)


def bound_by_permissions() -> Sequence[str]:
    """Return the beginning of a command that permissions bind even if root runs it."""
    if os.geteuid() != 0:
        return ()
    setpriv = shutil.which("setpriv")
    assert setpriv is not None, "setpriv was not found: apt-get install util-linux"
    without = "-dac_override,-dac_read_search"
    return (setpriv, f"--inh-caps={without}", f"--bounding-set={without}")


def _outcome(process: "subprocess.Popen[str]") -> Start:
    timer = threading.Timer(_PATIENCE_S, process.kill)
    timer.start()
    assert process.stdout is not None
    lines = []
    listens = False
    for line in process.stdout:
        listens = listens or line.rstrip() == _LISTENS
        if listens:
            process.terminate()
        if not re.match(r"Participants: |Dashboard: |Test run: ", line):
            lines.append(line.rstrip())
    status = process.wait()
    timer.cancel()
    return Start(None if listens else status, tuple(lines))


def _closed_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


CONTROLLED = ("two servers on one instance", "debugging", "tables of a later version")
"""The gates that the control leaves open."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if every gate holds, and those of the control do not."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="PostgreSQL's gates too")
    options = parser.parse_args(arguments)
    with ExitStack() as stack:
        instance = Path(stack.enter_context(tempfile.TemporaryDirectory()), "instance")
        prepare(instance)
        tried = gates()
        if options.full:
            tried += postgres_gates(stack.enter_context(postgres.a_server()))
        found = {gate.name: (gate, start(instance, gate)) for gate in tried}
        well = start(instance, Gate("nothing", ""))
        weak = {gate.name: start(instance, gate, OPEN_GATES) for gate in gates() if gate.name in CONTROLLED}
        with closing(sqlite3.connect(instance / "xar.sqlite3")) as connection:
            (journal,) = connection.execute("PRAGMA journal_mode").fetchone()
    told = {name: re.sub(r"/\S*/(?=\w)", ".../", " | ".join(begun.lines)) for name, (_, begun) in found.items()}
    is_safe = journal == journal_mode(sqlite3.sqlite_version_info)
    wrong = [name for name, (gate, begun) in found.items() if not begun.is_right(gate)]
    num_refused = sum(begun.status == 2 for _, begun in found.values())
    print(
        evidence(
            "F18 what a server refuses to start with",
            {"gates": len(found), "refused": num_refused, "started and told": len(found) - num_refused, "wrong": wrong},
            journal=f"{journal} with SQLite {sqlite3.sqlite_version}, {'' if is_safe else 'not '}as it needs",
            told=told,
            without_any={"starts": well.status is None, "lines": len(well.lines)},
            control={name: {"starts": begun.status is None} for name, begun in weak.items()},
        )
    )
    is_open = all(begun.status is None for begun in weak.values())
    return 0 if not wrong and is_safe and well == Start(None, ()) and is_open else 1


if __name__ == "__main__":
    sys.exit(main())
