import re
import shutil
import sqlite3
import threading
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection, insert, inspect
from sqlalchemy.engine.interfaces import ReflectedCheckConstraint
from sqlalchemy.exc import IntegrityError, OperationalError

from tests.outside import outside
from webapp.storage import revisions, sqlite_edition
from webapp.storage.database import Database, DatabaseError, journal_mode, open_database
from webapp.storage.schema import metadata
from webapp.storage.tables import sign_in_attempts


@pytest.mark.parametrize(
    ("version", "journal"),
    [
        ((3, 7, 17), "delete"),
        ((3, 40, 1), "delete"),
        ((3, 44, 5), "delete"),
        ((3, 44, 6), "wal"),
        ((3, 45, 0), "delete"),
        ((3, 50, 6), "delete"),
        ((3, 50, 7), "wal"),
        ((3, 51, 2), "delete"),
        ((3, 51, 3), "wal"),
        ((3, 54, 0), "wal"),
    ],
)
def test_versions_that_may_lose_commits_in_wal_mode_get_the_rollback_journal(
    version: tuple[int, int, int], journal: str
) -> None:
    assert journal_mode(version) == journal


def test_the_migrations_make_the_tables_that_the_program_expects(database: Database) -> None:
    with database.read() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []
        assert set(inspect(connection).get_table_names()) == {*metadata.tables, "alembic_version"}


def test_the_migrations_make_the_checks_that_the_program_expects(database: Database) -> None:
    found = {table: _checks(inspect_database(database, table)) for table in metadata.tables}
    with outside(database) as connection:
        connection.drop_tables()
        connection.commit()
    with database.write() as connection:
        metadata.create_all(connection)
    assert found == {table: _checks(inspect_database(database, table)) for table in metadata.tables}
    assert any(found.values())


def test_upgrading_twice_changes_nothing(database: Database) -> None:
    before = _schema(database)
    database.upgrade()
    assert _schema(database) == before
    database.check_version()


def test_a_database_of_a_later_version_is_refused(database: Database) -> None:
    with database.write() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(DatabaseError, match="later version"):
        database.upgrade()
    with pytest.raises(DatabaseError, match="later version"):
        database.check_version()
    with pytest.raises(DatabaseError, match="later version"):
        database.prepare()


def test_tables_of_an_earlier_version_are_refused_and_left_as_they_are(database: Database) -> None:
    with database.write() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '0001'")
    before = _schema(database)
    with pytest.raises(DatabaseError, match="run `xar migrate`"):
        database.prepare()
    assert _schema(database) == before


@pytest.mark.sqlite_only(reason="the broken step is run on a file of its own")
def test_a_migration_that_fails_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "migrations"
    shutil.copytree(revisions._MIGRATIONS, broken)
    step = 'revision = "9999"\ndown_revision = "0003"\n\ndef upgrade():\n    raise RuntimeError("power cut")\n'
    (broken / "versions" / "9999_broken.py").write_text(step)
    monkeypatch.setattr(revisions, "_MIGRATIONS", broken)
    with closing(Database(tmp_path / "xar.sqlite3")) as database:
        with pytest.raises(RuntimeError, match="power cut"):
            database.upgrade()
        assert _schema(database) == []


@pytest.mark.sqlite_only(reason="a file that is no database")
def test_what_is_no_database_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "xar.sqlite3"
    path.write_bytes(b"This is a letter, not a database. " * 100)
    with pytest.raises(DatabaseError, match="not a database"):
        Database(path)
    with pytest.raises(DatabaseError, match="cannot be opened"):
        Database(tmp_path / "missing" / "xar.sqlite3")


@pytest.mark.sqlite_only(reason="the mode of the file")
def test_only_the_owner_may_read_the_database(database: Database) -> None:
    assert database.path.stat().st_mode & 0o777 == 0o600


@pytest.mark.sqlite_only(reason="SQLite's pragmas")
def test_every_connection_syncs_fully_and_checks_foreign_keys(database: Database) -> None:
    for transaction in (database.write, database.read):
        with transaction() as connection:
            assert connection.exec_driver_sql("PRAGMA synchronous").scalar_one() == 3
            assert connection.exec_driver_sql("PRAGMA foreign_keys").scalar_one() == 1
            journal = connection.exec_driver_sql("PRAGMA journal_mode").scalar_one()
            assert journal == journal_mode(sqlite3.sqlite_version_info)


def test_a_transaction_is_on_disk_when_it_ends_and_undone_when_it_fails(database: Database) -> None:
    with database.write() as connection:
        _attempt(connection, "kept")
    with pytest.raises(IntegrityError):
        _insert_twice(database, "undone")
    assert _names(database) == ["kept"]


def test_readers_cannot_write(database: Database) -> None:
    with pytest.raises(OperationalError, match=r"read-?only"), database.read() as connection:
        _attempt(connection, "sneaked in")
    assert _names(database) == []


@pytest.mark.parametrize("num_programs", [1, 3])
def test_simultaneous_writers_take_turns(database: Database, num_programs: int) -> None:
    programs = [Database(database.path, database.url) for _ in range(num_programs)]
    barrier = threading.Barrier(12)

    def count_up(program: Database) -> None:
        barrier.wait()
        with program.write() as connection:
            (number,) = connection.exec_driver_sql("SELECT count(*) FROM sign_in_attempts").one()
            _attempt(connection, str(number))

    threads = [threading.Thread(target=count_up, args=(programs[number % num_programs],)) for number in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for program in programs:
        program.close()
    assert sorted(_names(database), key=int) == [str(number) for number in range(12)]


@pytest.mark.sqlite_only(reason="locks of SQLite's file")
def test_a_commit_that_another_program_prevents_is_undone_and_the_next_one_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_edition, "BUSY_TIMEOUT_S", 0.05)
    with open_database(tmp_path / "xar.sqlite3") as database, closing(sqlite3.connect(database.path)) as other:
        other.isolation_level = None
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(OperationalError, match="locked"), database.write() as connection:
            _attempt(connection, "refused")
        with pytest.raises(OperationalError, match="locked"):
            database.check_writable()
        other.execute("ROLLBACK")
        other.execute("BEGIN")
        other.execute("SELECT * FROM participants").fetchall()
        if journal_mode(sqlite3.sqlite_version_info) == "delete":
            with pytest.raises(OperationalError, match="locked"), database.write() as connection:
                _attempt(connection, "held up")
        other.execute("ROLLBACK")
        database.check_writable()
        with database.write() as connection:
            _attempt(connection, "stored")
        assert _names(database) == ["stored"]


def test_a_database_that_must_be_there_is_not_made(tmp_path: Path) -> None:
    path = tmp_path / "instance" / "xar.sqlite3"
    with pytest.raises(DatabaseError, match="there is no database"), open_database(path, make=False):
        pass
    assert not path.parent.exists()
    with open_database(path):
        pass
    with open_database(path, make=False) as database:
        database.check_version()


def _attempt(connection: Connection, name: str) -> None:
    values = {"name_hash": name, "num_failures": 1, "last_attempt_at": datetime(2031, 1, 1, tzinfo=UTC)}
    connection.execute(insert(sign_in_attempts).values(values))


def _insert_twice(database: Database, name: str) -> None:
    with database.write() as connection:
        _attempt(connection, name)
        _attempt(connection, name)


def _names(database: Database) -> list[str]:
    with outside(database) as connection:
        return [name for (name,) in connection.ask("SELECT name_hash FROM sign_in_attempts")]


def _schema(database: Database) -> list[tuple[str, ...]]:
    with outside(database) as connection:
        return connection.schema()


def inspect_database(database: Database, table: str) -> list[ReflectedCheckConstraint]:
    with database.read() as connection:
        return inspect(connection).get_check_constraints(table)


def _checks(found: list[ReflectedCheckConstraint]) -> list[tuple[str | None, list[str]]]:
    # PostgreSQL writes `IN` as `ANY` of an array, with more casts the second time.
    return sorted((check["name"], re.findall(r"'\w+'|\d+|BETWEEN|[<>]=", check["sqltext"])) for check in found)
