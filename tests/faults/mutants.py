"""The program without one of its protections, as a control: `python -m tests.faults.mutants NAME serve ...`."""

import os
import secrets
import sqlite3
import sqlite3.dbapi2
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from datetime import datetime
from functools import partial
from typing import Any, NoReturn, cast
from unittest import mock

from gunicorn.app import wsgiapp
from sqlalchemy import Connection

from webapp import app
from webapp.cli import main
from webapp.storage import answers, enrolment, helping, ledger, participants, researchers
from webapp.storage.database import Database, UnavailableError
from webapp.storage.group_commit import GroupCommit
from webapp.storage.ledger import Allocation
from webapp.storage.participants import Participant
from webapp.study import session
from webapp.study.draws import Draws
from webapp.study.session import Page
from webapp.views import arrival, forms, participant, visit

_LATE_S = 0.05


@contextmanager
def unlocked() -> Iterator[None]:
    """Draw from what was counted before the transaction that stores the draw."""
    drawn = threading.local()
    real_enrol = enrolment.enrol

    def enrol(database: Database, wanted: enrolment.Enrolment, now: datetime) -> Participant:
        with database.read() as connection:
            draws = Draws(secrets.token_hex(32))
            drawn.allocation = ledger.allocate(connection, wanted.study, wanted.scope, draws)
        return real_enrol(database, wanted, now)

    def allocate(*_given: object) -> Allocation:
        return cast("Allocation", drawn.allocation)

    with mock.patch.object(arrival, "enrol", enrol), mock.patch.object(enrolment, "allocate", allocate):
        yield


@contextmanager
def hasty() -> Iterator[None]:
    """Acknowledge first and commit a moment later."""

    @contextmanager
    def write(self: GroupCommit) -> Iterator[Connection]:
        self._take_turn()
        try:
            group = self._join()
            with group.part():
                yield group.connection
        except BaseException:
            self._end_turn()
            raise
        threading.Timer(_LATE_S, self._end_turn).start()

    with mock.patch.object(GroupCommit, "write", write):
        yield


@contextmanager
def naive() -> Iterator[None]:
    """Insert whatever comes into tables without keys, and take a moment to answer."""

    real_upgrade, real_store = Database.upgrade, answers.store_page

    def upgrade(database: Database) -> None:
        real_upgrade(database)
        with database._turns.alone(), database.edition.writing() as connection:
            for table in ("ratings", "predictions", "drives", "events", "pages"):
                connection.exec_driver_sql(f"CREATE TABLE plain AS SELECT * FROM {table}")  # noqa: S608
                connection.exec_driver_sql(f"DROP TABLE {table}" + (" CASCADE" if database.url else ""))
                connection.exec_driver_sql(f"ALTER TABLE plain RENAME TO {table}")

    def store(*given: Any) -> object:  # noqa: ANN401
        outcome = real_store(*given)
        time.sleep(_LATE_S)
        return outcome

    with (
        mock.patch.object(Database, "upgrade", upgrade),
        mock.patch.object(answers, "decide", return_value="accept"),
        mock.patch.object(forms, "decide", return_value="accept"),
        mock.patch.object(participant, "store_page", store),
    ):
        yield


class _Unsynced(sqlite3.Connection):
    def execute(self, sql: str, *given: Any) -> sqlite3.Cursor:  # noqa: ANN401
        return super().execute(sql.replace("synchronous=EXTRA", "synchronous=OFF"), *given)


@contextmanager
def unsynced() -> Iterator[None]:
    """Leave it to the system when anything is on disk."""
    with mock.patch.object(sqlite3.dbapi2, "connect", partial(sqlite3.connect, factory=_Unsynced)):
        yield


@contextmanager
def cached() -> Iterator[None]:
    """Decide by what was known of a participant before it was their turn."""

    def decide(_connection: Connection, before: Participant, page: Page) -> tuple[Participant, answers.Outcome]:
        return before, session.decide(page.number, before.num_stored, before.num_pages)

    with mock.patch.object(answers, "_decide", decide):
        yield


@contextmanager
def own_key() -> Iterator[None]:
    """Let what browsers show mean something to this process alone, as a cookie does that a key of its own signs."""
    key = secrets.token_bytes(32)

    def own_hash(token: str) -> str:
        return participants.hash_token(f"{key.hex()} {token}")

    with ExitStack() as stack:
        for module in (arrival, helping, researchers, visit):
            stack.enter_context(mock.patch.object(module, "hash_token", own_hash))
        stack.enter_context(mock.patch.object(app, "secret_key", return_value=key))
        yield


@contextmanager
def careless() -> Iterator[None]:
    """Acknowledge a page whatever became of it."""
    real_store = answers.store_page

    def store(*given: Any) -> object:  # noqa: ANN401
        try:
            return real_store(*given)
        except UnavailableError:
            return "accept"

    with mock.patch.object(participant, "store_page", store):
        yield


@contextmanager
def open_gates() -> Iterator[None]:
    """Start beside another server, with debugging, and on tables of any version."""
    with (
        mock.patch.object(app, "only_server", return_value=nullcontext()),
        mock.patch.object(app, "refuse_debugging"),
        mock.patch.object(Database, "check_version"),
    ):
        yield


MUTANTS = {
    "unlocked": unlocked,
    "hasty": hasty,
    "naive": naive,
    "unsynced": unsynced,
    "cached": cached,
    "own_key": own_key,
    "careless": careless,
    "open_gates": open_gates,
}


def _run(name: str) -> None:
    real_execve = os.execve

    def execve(path: str, command: list[str], environment: Mapping[str, str]) -> NoReturn:
        """Become this program again where `xar serve --workers` becomes gunicorn, whose processes then inherit it."""
        module = command.index("-m") + 1
        real_execve(path, [*command[:module], "tests.faults.mutants", name, *command[module:]], environment)

    with MUTANTS[name](), mock.patch.object(os, "execve", execve):
        if sys.argv[1] == "gunicorn":
            del sys.argv[1]
            wsgiapp.run()
        else:
            main(prog_name="xar")


if __name__ == "__main__":
    _run(sys.argv.pop(1))
