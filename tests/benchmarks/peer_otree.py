"""oTree, the peer of the load tests: installed at a pinned version in an environment of its own, and served.

It is served as its documentation says for experiments: `otree prodserver` in production mode, with a link for each
person. Its session is made, with a row for every person, before the clock starts.
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
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
        port: Where it listens.
        pid: Its process.
        project: Its folder, with the database.
        key: The key of its interface for programs.
    """

    port: int
    pid: int
    project: Path
    key: str

    def starts(self, num_people: int) -> list[str]:
        """Make a session and return the link of each person."""
        made = self._ask("/api/sessions", session_config_name="load", num_participants=num_people)
        session = self._ask(f"/api/get_session/{made['code']}")
        return [f"/InitializeParticipant/{person['code']}" for person in session["participants"]]

    def _ask(self, path: str, **content: Any) -> Any:  # noqa: ANN401
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.port}{path}", json.dumps(content).encode(), {"otree-rest-key": self.key}
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
def serve_peer(programs: Path, project: Path, pictures: Path, database_url: str = "") -> Iterator[RunningPeer]:
    """Serve our study as an oTree app.

    Args:
        programs: What `install_peer` returned.
        project: A folder that is not there yet.
        pictures: A folder of PNG files, of which three are shown.
        database_url: PostgreSQL's; empty for SQLite.
    """
    shutil.copytree(ROOT / "tests/benchmarks/otree_app", project)
    shown = project / "_static/load"
    shown.mkdir(parents=True, exist_ok=True)
    for trial, picture in zip(TRIALS, sorted(pictures.glob("*.png")), strict=False):
        shutil.copy(picture, shown / f"{trial}.png")
    port, key = _free_port(), secrets.token_hex(16)
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
    with (project / "server.log").open("w") as log:
        process = subprocess.Popen(
            [str(programs / "otree"), "prodserver", f"127.0.0.1:{port}"],
            cwd=project,
            env=environment,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
        try:
            _wait_for(process, port, project / "server.log")
            yield RunningPeer(port, process.pid, project, key)
        finally:
            os.killpg(process.pid, signal.SIGINT)
            try:
                process.wait(_PATIENCE_S)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def stored_by_peer(project: Path) -> Answers:
    """Return what oTree's SQLite file holds, once the server has stopped; persons by their code."""
    columns = [f"{item}{trial}" for trial in TRIALS for item in ITEMS]
    query = "SELECT pp.code AS person, p.* FROM load_player p JOIN otree_participant pp ON p.participant_id = pp.id"
    found: dict[str, dict[tuple[str, str], str]] = {}
    with closing(sqlite3.connect(project / "db.sqlite3")) as connection:
        connection.row_factory = sqlite3.Row
        for row in connection.execute(query):
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
