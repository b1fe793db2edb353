"""Copies of the database: nothing of them stays, whatever happens to who made them, and nothing of the erased."""

import fcntl
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from tests.unit.storage.people import NOW, enrol_somebody
from webapp.storage import snapshot as snapshot_module
from webapp.storage import sqlite_edition
from webapp.storage.database import Database, UnavailableError, open_database
from webapp.storage.erasure import erase
from webapp.storage.snapshot import remove_stale, snapshot

pytestmark = pytest.mark.sqlite_only(reason="only of SQLite's file a copy is made")

COPIES = ".snapshot-*"

_KILLED = """
import os, sys
from pathlib import Path
from webapp.storage import snapshot
from webapp.storage.database import Database

snapshot._copy = lambda database, copy: (copy.execute("CREATE TABLE half (made)"), os._exit(9))
with snapshot.snapshot(Database(Path(sys.argv[1]))):
    pass
"""


def test_a_copy_has_no_name_once_it_is_made(database: Database) -> None:
    with snapshot(database) as connection:
        assert list(database.path.parent.glob(COPIES)) == []
        assert connection.exec_driver_sql("SELECT count(*) FROM participants").scalar_one() == 0


def test_what_a_killed_process_left_is_removed_before_somebody_is_erased(database: Database) -> None:
    person = enrol_somebody(database)
    killed = subprocess.run([sys.executable, "-c", _KILLED, str(database.path)], check=False, timeout=60)
    assert killed.returncode == 9
    assert len(list(database.path.parent.glob(COPIES))) == 1
    assert erase(database, person.code, "boss", NOW)
    assert list(database.path.parent.glob(COPIES)) == []


def test_a_copy_in_the_making_is_left_alone(database: Database, tmp_path: Path) -> None:
    path = tmp_path / ".snapshot-others"
    handle = os.open(path, os.O_CREAT | os.O_RDWR)
    fcntl.flock(handle, fcntl.LOCK_EX)
    remove_stale(database)
    assert path.exists()
    os.close(handle)
    remove_stale(database)
    assert not path.exists()


def test_it_is_told_whether_the_last_traces_are_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sqlite_edition, "journal_mode", lambda _: "wal")
    database = Database(tmp_path / "xar.sqlite3")
    database.upgrade()
    person = enrol_somebody(database)
    with database.read() as connection:
        connection.exec_driver_sql("SELECT * FROM participants").fetchall()
        assert not database.forget(tries=1)
    assert erase(database, person.code, "boss", NOW)
    content = b"".join(file.read_bytes() for file in tmp_path.iterdir())
    assert person.code.encode() not in content
    database.close()


def test_another_program_that_holds_the_database_is_not_waited_for_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(snapshot_module, "BUSY_TIMEOUT_S", 0.3)
    path = tmp_path / "xar.sqlite3"
    with open_database(path) as database, closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(UnavailableError, match="another program holds the database"), snapshot(database):
            pass
        other.execute("ROLLBACK")
        with snapshot(database) as connection:
            assert connection.exec_driver_sql("SELECT count(*) FROM participants").scalar_one() == 0
    assert not list(tmp_path.glob(".snapshot-*"))
