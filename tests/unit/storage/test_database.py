import shutil
import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import create_engine, inspect
from sqlalchemy.exc import IntegrityError, OperationalError

from webapp.storage import database as database_module
from webapp.storage.database import Database, DatabaseError, journal_mode, open_database
from webapp.storage.schema import metadata


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
    expected = create_engine("sqlite://")
    metadata.create_all(expected)
    with database.read() as connection:
        for table in metadata.tables:
            checks = inspect(connection).get_check_constraints(table)
            assert checks == inspect(expected).get_check_constraints(table)
    expected.dispose()


def test_upgrading_twice_changes_nothing(database: Database) -> None:
    before = _schema(database.path)
    database.upgrade()
    assert _schema(database.path) == before
    database.check_version()


def test_a_database_of_a_later_version_is_refused(database: Database) -> None:
    with database.write() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(DatabaseError, match="later version"):
        database.upgrade()
    with pytest.raises(DatabaseError, match="another version"):
        database.check_version()


def test_a_migration_that_fails_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "migrations"
    shutil.copytree(database_module._MIGRATIONS, broken)
    step = 'revision = "9999"\ndown_revision = "0003"\n\ndef upgrade():\n    raise RuntimeError("power cut")\n'
    (broken / "versions" / "9999_broken.py").write_text(step)
    monkeypatch.setattr(database_module, "_MIGRATIONS", broken)
    with closing(Database(tmp_path / "xar.sqlite3")) as database:
        with pytest.raises(RuntimeError, match="power cut"):
            database.upgrade()
        assert _schema(database.path) == []


def test_what_is_no_database_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "xar.sqlite3"
    path.write_bytes(b"This is a letter, not a database. " * 100)
    with pytest.raises(DatabaseError, match="not a database"):
        Database(path)
    with pytest.raises(DatabaseError, match="cannot be opened"):
        Database(tmp_path / "missing" / "xar.sqlite3")


def test_only_the_owner_may_read_the_database(database: Database) -> None:
    assert database.path.stat().st_mode & 0o777 == 0o600


def test_every_connection_syncs_fully_and_checks_foreign_keys(database: Database) -> None:
    for transaction in (database.write, database.read):
        with transaction() as connection:
            assert connection.exec_driver_sql("PRAGMA synchronous").scalar_one() == 2
            assert connection.exec_driver_sql("PRAGMA foreign_keys").scalar_one() == 1
            journal = connection.exec_driver_sql("PRAGMA journal_mode").scalar_one()
            assert journal == journal_mode(sqlite3.sqlite_version_info)


def test_a_transaction_is_on_disk_when_it_ends_and_undone_when_it_fails(database: Database) -> None:
    with database.write() as connection:
        connection.exec_driver_sql(_ATTEMPT, ("kept",))
    with pytest.raises(IntegrityError):
        _insert_twice(database, "undone")
    assert _names(database.path) == ["kept"]


def test_readers_cannot_write(database: Database) -> None:
    with pytest.raises(OperationalError, match="readonly"), database.read() as connection:
        connection.exec_driver_sql(_ATTEMPT, ("sneaked in",))
    assert _names(database.path) == []


@pytest.mark.parametrize("num_programs", [1, 3])
def test_simultaneous_writers_take_turns(database: Database, num_programs: int) -> None:
    programs = [Database(database.path) for _ in range(num_programs)]
    barrier = threading.Barrier(12)

    def count_up(program: Database) -> None:
        barrier.wait()
        with program.write() as connection:
            (number,) = connection.exec_driver_sql("SELECT count(*) FROM sign_in_attempts").one()
            connection.exec_driver_sql(_ATTEMPT, (str(number),))

    threads = [threading.Thread(target=count_up, args=(programs[number % num_programs],)) for number in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for program in programs:
        program.close()
    assert sorted(_names(database.path), key=int) == [str(number) for number in range(12)]


def test_a_commit_that_another_program_prevents_is_undone_and_the_next_one_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database_module, "BUSY_TIMEOUT_S", 0.05)
    with open_database(tmp_path / "xar.sqlite3") as database, closing(sqlite3.connect(database.path)) as other:
        other.isolation_level = None
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(OperationalError, match="locked"), database.write() as connection:
            connection.exec_driver_sql(_ATTEMPT, ("refused",))
        with pytest.raises(OperationalError, match="locked"):
            database.check_writable()
        other.execute("ROLLBACK")
        other.execute("BEGIN")
        other.execute("SELECT * FROM participants").fetchall()
        if journal_mode(sqlite3.sqlite_version_info) == "delete":
            with pytest.raises(OperationalError, match="locked"), database.write() as connection:
                connection.exec_driver_sql(_ATTEMPT, ("held up",))
        other.execute("ROLLBACK")
        database.check_writable()
        with database.write() as connection:
            connection.exec_driver_sql(_ATTEMPT, ("stored",))
    assert _names(tmp_path / "xar.sqlite3") == ["stored"]


def test_a_database_that_must_be_there_is_not_made(tmp_path: Path) -> None:
    path = tmp_path / "instance" / "xar.sqlite3"
    with pytest.raises(DatabaseError, match="there is no database"), open_database(path, make=False):
        pass
    assert not path.parent.exists()
    with open_database(path):
        pass
    with open_database(path, make=False) as database:
        database.check_version()


_ATTEMPT = "INSERT INTO sign_in_attempts VALUES (?, 1, '2031-01-01 00:00:00.000000', NULL)"


def _insert_twice(database: Database, name: str) -> None:
    with database.write() as connection:
        connection.exec_driver_sql(_ATTEMPT, (name,))
        connection.exec_driver_sql(_ATTEMPT, (name,))


def _names(path: Path) -> list[str]:
    with closing(sqlite3.connect(path)) as connection:
        return [name for (name,) in connection.execute("SELECT name_hash FROM sign_in_attempts")]


def _schema(path: Path) -> list[tuple[str, str]]:
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute("SELECT name, sql FROM sqlite_schema ORDER BY name").fetchall()
