"""`xar migrate`, and what is there if it is cut short (fault F17)."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.faults.migrations import EARLIER, NEWEST, make_at, run, state
from tests.unit.storage.people import NOW
from tests.unit.storage.test_migrations import PEOPLE
from webapp.storage.backup_manifests import BackupError, complete_backups
from webapp.storage.database import Database, DatabaseError
from webapp.storage.instance import InstanceError, only_server
from webapp.storage.migrating import Migrated, migrate
from webapp.storage.restoring import restore, verify
from webapp.storage.verification import verify_log

pytestmark = pytest.mark.sqlite_only(reason="it begins with SQLite's files of earlier versions")


@pytest.fixture(params=EARLIER)
def old(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A database of each earlier revision."""
    path = tmp_path / "instance" / "xar.sqlite3"
    make_at(path, request.param, PEOPLE)
    return path


def test_an_old_database_is_backed_up_and_brought_up_to_date(old: Path, tmp_path: Path) -> None:
    before = state(old)
    done = migrate(old, tmp_path / "kept", NOW)
    assert (done.before, done.after) == (before.rows["alembic_version"][0][0], NEWEST)
    assert done.backup is not None
    assert state(done.backup) == before
    with closing(Database(old)) as database:
        database.check_version()
        assert verify_log(database).problems == ()


def test_a_backup_of_an_earlier_revision_is_checked_and_restored_to_this_one(old: Path, tmp_path: Path) -> None:
    done = migrate(old, tmp_path / "kept", NOW)
    assert done.backup is not None
    assert verify(done.backup, tmp_path / "check")[1] == []
    restored = tmp_path / "elsewhere" / "xar.sqlite3"
    restore(done.backup, restored, NOW)
    assert state(restored).shared_rows(state(done.backup)) == state(old).shared_rows(state(done.backup))


def test_what_is_up_to_date_is_left_alone_and_not_backed_up(tmp_path: Path) -> None:
    path = tmp_path / "instance" / "xar.sqlite3"
    assert migrate(path, tmp_path / "kept", NOW) == Migrated(None, NEWEST, None)
    before = state(path)
    assert migrate(path, tmp_path / "kept", NOW) == Migrated(NEWEST, NEWEST, None)
    assert state(path) == before
    assert list(complete_backups(tmp_path / "kept")) == []


def test_without_a_backup_nothing_is_changed(old: Path, tmp_path: Path) -> None:
    before = state(old)
    (tmp_path / "kept").write_text("a file, not a folder")
    with pytest.raises(BackupError, match="cannot hold a backup"):
        migrate(old, tmp_path / "kept", NOW)
    assert state(old) == before


def test_nothing_is_migrated_while_a_server_runs(old: Path) -> None:
    with only_server(old.parent), pytest.raises(InstanceError, match="another server is running"):
        migrate(old, None, NOW)


def test_a_database_of_a_later_version_is_left_alone(old: Path, tmp_path: Path) -> None:
    with closing(sqlite3.connect(old)) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
        connection.commit()
    before = state(old)
    with pytest.raises(DatabaseError, match="later version"):
        migrate(old, tmp_path / "kept", NOW)
    assert state(old) == before


@pytest.mark.parametrize("revision", EARLIER)
def test_a_migration_that_is_killed_leaves_the_old_or_the_new_tables(tmp_path: Path, revision: str) -> None:
    found = run(tmp_path / "killed", revision, PEOPLE, 6)
    assert found == ["old"] * 5 + ["new"]


def test_a_migration_that_commits_each_statement_is_found_between(tmp_path: Path) -> None:
    """The control."""
    assert "between" in run(tmp_path / "killed", EARLIER[-1], PEOPLE, 4, is_naive=True)
