"""oTree, the peer of the load tests: installed at a pinned version in an environment of its own, and served.

It is served in production mode, by the web process that `otree prodserver` starts (the other, for time limits on pages,
has nothing to do here), with a link for each person. Its session is made, with a row for every person, before the clock
starts.
"""

import json
import os
import secrets
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import psycopg
from psycopg.rows import dict_row

from tests.benchmarks.load.ours import Answers
from tests.conftest import ROOT

VERSION = "6.0.15"
FOLDER = ROOT / ".pytest_cache" / f"otree-{VERSION}"
END = "/End/"
TRIALS = (1, 2, 3)
ITEMS = ("likeliness", "loveliness", "general")
_PATIENCE_S = 60


class NoPeerError(RuntimeError):
    """oTree cannot be installed or does not start; the message says why."""


@dataclass(frozen=True, slots=True)
class RunningPeer:
    """A running oTree server.

    Attributes:
        ports: Where its web processes listen.
        pids: These processes.
        project: Its folder, with the database.
        key: The key of its interface for programs.
    """

    ports: tuple[int, ...]
    pids: tuple[int, ...]
    project: Path
    key: str

    def starts(self, num_people: int) -> list[str]:
        """Make a session and return the link of each person."""
        made = self._ask("/api/sessions", session_config_name="load", num_participants=num_people)
        session = self._ask(f"/api/get_session/{made['code']}")
        return [f"/InitializeParticipant/{person['code']}" for person in session["participants"]]

    def _ask(self, path: str, **content: Any) -> Any:  # noqa: ANN401
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.ports[0]}{path}", json.dumps(content).encode(), {"otree-rest-key": self.key}
        )
        with urllib.request.urlopen(request, timeout=_PATIENCE_S) as response:  # noqa: S310 - as above.
            return json.load(response)


def install_peer() -> Path:
    """Return the folder of the programs of the pinned oTree, installed if this is the first time."""
    programs = FOLDER / "bin"
    if not (programs / "otree").exists():
        shutil.rmtree(FOLDER, ignore_errors=True)
        _run(sys.executable, "-m", "venv", str(FOLDER))
        packages = (f"otree=={VERSION}", "psycopg2-binary")
        _run(str(programs / "pip"), "install", "--quiet", "--disable-pip-version-check", *packages)
    return programs


@contextmanager
def serve_peer(
    programs: Path, project: Path, pictures: Path, database_url: str = "", num_processes: int = 1
) -> Iterator[RunningPeer]:
    """Serve our study as an oTree app.

    oTree serves the web with one process; several on ports of their own share a PostgreSQL database, as behind a
    proxy that deals out the people.

    Args:
        programs: What `install_peer` returned.
        project: A folder that is not there yet.
        pictures: A folder of PNG files, of which three are shown.
        database_url: PostgreSQL's; empty for SQLite.
        num_processes: How many processes serve the web.
    """
    shutil.copytree(ROOT / "tests/benchmarks/otree_app", project)
    shown = project / "_static/load"
    shown.mkdir(parents=True, exist_ok=True)
    for trial, picture in zip(TRIALS, sorted(pictures.glob("*.png")), strict=False):
        shutil.copy(picture, shown / f"{trial}.png")
    key = secrets.token_hex(16)
    settings = {
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "OTREE_PRODUCTION": "1",
        "OTREE_AUTH_LEVEL": "STUDY",
        "OTREE_ADMIN_PASSWORD": secrets.token_hex(16),
        "OTREE_SECRET_KEY": secrets.token_hex(16),
        "OTREE_REST_KEY": key,
    } | ({"DATABASE_URL": database_url} if database_url else {})
    environment = {name: value for name, value in os.environ.items() if name != "DATABASE_URL"} | settings
    _run(str(programs / "otree"), "resetdb", "--noinput", cwd=project, env=environment)
    with ExitStack() as stack:
        log = stack.enter_context((project / "server.log").open("w"))
        running = [stack.enter_context(_process(programs, project, environment, log)) for _ in range(num_processes)]
        yield RunningPeer(
            tuple(port for port, _ in running), tuple(process.pid for _, process in running), project, key
        )


@contextmanager
def _process(
    programs: Path, project: Path, environment: Mapping[str, str], log: IO[str]
) -> Iterator[tuple[int, "subprocess.Popen[bytes]"]]:
    port = _free_port()
    process = subprocess.Popen(
        [str(programs / "otree"), "prodserver1of2", f"127.0.0.1:{port}"],
        cwd=project,
        env=environment,
        stdout=log,
        stderr=log,
        start_new_session=True,
    )
    try:
        _wait_for(process, port, project / "server.log")
        yield port, process
    finally:
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def stored_by_peer(project: Path, database_url: str = "") -> Answers:
    """Return what oTree's database holds, once the server has stopped; persons by their code."""
    columns = [f"{item}{trial}" for trial in TRIALS for item in ITEMS]
    query = "SELECT pp.code AS person, p.* FROM load_player p JOIN otree_participant pp ON p.participant_id = pp.id"
    found: dict[str, dict[tuple[str, str], str]] = {}
    if database_url:
        with psycopg.connect(database_url, row_factory=dict_row) as connection:
            rows: Iterable[Mapping[str, Any]] = connection.execute(query).fetchall()
    else:
        with closing(sqlite3.connect(project / "db.sqlite3")) as file:
            file.row_factory = sqlite3.Row
            rows = [dict(row) for row in file.execute(query)]
    for row in rows:
        answered = {name: row[name] for name in columns if row[name] is not None}
        found[row["person"]] = {(name[-1], name[:-1]): str(value) for name, value in answered.items()}
    return found


def told_to_peer(person: Mapping[str, Any]) -> tuple[str, dict[tuple[str, str], str]]:
    """Return who a person is, and what of theirs was acknowledged, in the terms of `stored_by_peer`."""
    ledger = {(name[-1], name[:-1]): value for _, name, value in person["ledger"]}
    return person["start"].rpartition("/")[2], ledger


def _wait_for(process: "subprocess.Popen[bytes]", port: int, log: Path) -> None:
    for _ in range(10 * _PATIENCE_S):
        if process.poll() is not None:
            break
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise NoPeerError(f"oTree does not start: {log.read_text(encoding='utf-8')[-500:]}")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _run(*command: str, **settings: Any) -> None:  # noqa: ANN401
    finished = subprocess.run(command, check=False, capture_output=True, text=True, **settings)
    if finished.returncode != 0:
        raise NoPeerError(f"{' '.join(command)}: {' '.join(finished.stderr.split())[-500:]}")
