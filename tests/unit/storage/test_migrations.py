"""A database that was made by an earlier version of the program."""

import csv
import io
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from alembic import command
from alembic.config import Config as AlembicConfig

from tests.unit.storage.people import NOW, count, enrol_somebody, walk
from webapp.storage import revisions
from webapp.storage.database import Database, DatabaseError
from webapp.storage.erasure import erase
from webapp.storage.exports import FileName, write_csv
from webapp.storage.participants import find_participant, find_trials
from webapp.storage.records import told_by
from webapp.storage.replay import replay
from webapp.storage.schema import metadata
from webapp.storage.tables import ratings
from webapp.storage.verification import verify_log

pytestmark = pytest.mark.sqlite_only(reason="its earlier versions are of before there was PostgreSQL")

COLUMNS_OF_0001 = {
    "ratings.csv": (
        *("study", "study_version", "mode", "participant", "experiment", "trial", "layout", "kind", "draw"),
        *("item", "rating", "response_time_ms", "submitted_at"),
    ),
    "participants.csv": (
        *("study", "study_version", "mode", "participant", "consent_version", "consented_at", "last_seen_at"),
        *("completed_at", "withdrawn_at", "num_pages_sent", "num_pages", "assignment"),
    ),
}
"""The columns of the files that the first version wrote."""

PEOPLE = """
INSERT INTO participants VALUES
  (1, '2345678abc', 'hash1', 'live', 'odd', 'v1', '1', 5, '2031-03-01 09:30:00.000017', '2031-03-01 09:35:00.000000',
   '2031-03-01 09:35:00.000000', NULL),
  (2, 'bcdefghjkm', 'hash2', 'test', 'odd', 'v1', '1', 5, '2031-03-01 09:40:00.000000', '2031-03-01 09:47:00.000000',
   NULL, '2031-03-01 09:47:00.000000'),
  (7, 'zzzzzzzzzz', 'hash7', 'live', 'odd', 'v1', 'April, "short"', 5, '2031-03-01 09:50:00.000000',
   '2031-03-01 09:50:00.000000', NULL, NULL);
INSERT INTO arrangements VALUES (1, '1', 0), (2, '1', 1), (7, '1', 1);
INSERT INTO trials VALUES
  (1, 1, '1', 1, 2, 'first', 'random', 9), (1, 2, '1', 2, 2, 'second', 'full', NULL),
  (2, 1, '1', 1, 2, 'first', 'full', NULL), (2, 2, '1', 2, 2, 'second', 'random', 0),
  (7, 1, '1', 1, 2, 'first', 'full', NULL), (7, 2, '1', 2, 2, 'second', 'random', 3);
INSERT INTO pages VALUES
  (1, 1, 'instructions', NULL, 'n11', '2031-03-01 09:31:00.000000'),
  (1, 2, 'situation', 1, 'n12', '2031-03-01 09:32:00.000000'), (1, 3, 'rating', 1, 'n13', '2031-03-01 09:33:00.000000'),
  (1, 4, 'situation', 2, 'n14', '2031-03-01 09:34:00.000000'), (1, 5, 'rating', 2, 'n15', '2031-03-01 09:35:00.000000'),
  (2, 1, 'instructions', NULL, 'n21', '2031-03-01 09:41:00.000000'),
  (2, 2, 'situation', 1, 'n22', '2031-03-01 09:42:00.000000'), (2, 3, 'rating', 1, 'n23', '2031-03-01 09:43:00.000001');
INSERT INTO ratings VALUES
  (1, 3, 'ease', 5, 1200), (1, 3, 'worth', 1, NULL), (1, 5, 'ease', 2, 0), (1, 5, 'worth', 11, 86400000),
  (2, 3, 'ease', 4, NULL), (2, 3, 'worth', 4, 3000);
INSERT INTO researchers VALUES (1, 'researcher', 'hash', '2031-01-01 00:00:00.000000');
INSERT INTO researcher_sessions VALUES ('token', 1, '2031-01-01 00:00:00.000000', '2031-01-01 00:00:00.000000', NULL);
INSERT INTO sign_in_attempts VALUES ('name', 3, '2031-01-01 00:00:00.000000', NULL);
INSERT INTO audit_log VALUES (1, '2031-01-01 00:00:00.000000', 'researcher', 'created', NULL);
"""


@pytest.fixture
def old(tmp_path: Path) -> Iterator[Database]:
    """A database at revision 0001 with rows in every table."""
    database = Database(tmp_path / "xar.sqlite3")
    with database.write() as connection:
        config = AlembicConfig()
        config.set_main_option("script_location", str(revisions._MIGRATIONS))
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        for statement in PEOPLE.strip().split(";\n"):
            connection.exec_driver_sql(statement)
    yield database
    database.close()


def rows(path: Path, table: str, columns: str = "*") -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute(f"SELECT {columns} FROM {table} ORDER BY 1, 2").fetchall()  # noqa: S608


def columns_of(path: Path, table: str) -> list[str]:
    with closing(sqlite3.connect(path)) as connection:
        return [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})")]


def tables_of(path: Path) -> list[str]:
    with closing(sqlite3.connect(path)) as connection:
        found = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table' AND name != 'alembic_version'")
        return [name for (name,) in found]


def exported(database: Database, name: FileName) -> list[dict[str, str]]:
    content = io.BytesIO()
    with database.read() as connection:
        write_csv(connection, name, content)
    return list(csv.DictReader(io.StringIO(content.getvalue().decode("utf-8"), newline="")))


def ratings_as_0001_wrote_them(path: Path) -> list[tuple[str, ...]]:
    """The rows of `ratings.csv` by a query of its own, over the tables of revision 0001."""
    query = """
        SELECT p.study, p.study_version, p.mode, p.code, t.experiment, t.position, t.layout, t.kind, t.draw,
               r.item, r.rating, r.response_time_ms, replace(g.submitted_at, ' ', 'T') || 'Z'
        FROM ratings r, pages g, trials t, participants p
        WHERE g.participant_id = r.participant_id AND g.number = r.page_number AND t.participant_id = r.participant_id
              AND t.number = g.trial_number AND p.id = r.participant_id
        ORDER BY r.participant_id, r.page_number, r.item"""
    with closing(sqlite3.connect(path)) as connection:
        return [tuple("" if cell is None else str(cell) for cell in row) for row in connection.execute(query)]


def test_a_database_of_the_first_version_is_told_apart(old: Database) -> None:
    assert set(tables_of(old.path)) - {"audit_log"} < set(metadata.tables)
    assert all(rows(old.path, table) for table in tables_of(old.path))
    with pytest.raises(DatabaseError, match="another version"):
        old.check_version()


def test_every_row_is_there_after_the_upgrade_as_it_was(old: Database) -> None:
    before = {table: columns_of(old.path, table) for table in tables_of(old.path) if table != "audit_log"}
    before["researcher_sessions"].remove("revealed_at")
    wanted = {table: rows(old.path, table, ", ".join(columns)) for table, columns in before.items()}
    old.upgrade()
    old.check_version()
    assert {table: rows(old.path, table, ", ".join(columns)) for table, columns in before.items()} == wanted
    assert rows(old.path, "participants", "code, language, translation, guardian_agreed, screened_out_at") == [
        (code, "en", "original", None, None) for code in ("2345678abc", "bcdefghjkm", "zzzzzzzzzz")
    ]
    assert rows(old.path, "arrangements", "participant_id, layout_order") == [(1, 0), (2, 0), (7, 0)]


def test_the_files_hold_the_same_as_before_where_their_columns_are_the_same(old: Database) -> None:
    wanted = ratings_as_0001_wrote_them(old.path)
    old.upgrade()
    found = exported(old, "ratings.csv")
    assert tuple(found[0]) == COLUMNS_OF_0001["ratings.csv"]
    assert [tuple(row.values()) for row in found] == wanted
    people = exported(old, "participants.csv")
    assert tuple(people[0])[:12] == COLUMNS_OF_0001["participants.csv"]
    assert [tuple(person.values())[3:12] for person in people] == [
        (
            *("2345678abc", "1", "2031-03-01T09:30:00.000017Z", "2031-03-01T09:35:00.000000Z"),
            *("2031-03-01T09:35:00.000000Z", "", "5", "5", "1/first/random/9 1/second/full"),
        ),
        (
            *("bcdefghjkm", "1", "2031-03-01T09:40:00.000000Z", "2031-03-01T09:47:00.000000Z"),
            *("", "2031-03-01T09:47:00.000000Z", "3", "5", "1/first/full 1/second/random/0"),
        ),
        (
            *("zzzzzzzzzz", 'April, "short"', "2031-03-01T09:50:00.000000Z", "2031-03-01T09:50:00.000000Z"),
            *("", "", "0", "5", "1/first/full 1/second/random/3"),
        ),
    ]
    assert all(exported(old, name) == [] for name in ("answers.csv", "probes.csv", "drives.csv", "events.csv"))


def test_who_began_before_the_upgrade_goes_on_after_it(old: Database) -> None:
    old.upgrade()
    found = find_participant(old, "hash7")
    assert found is not None
    assert (found.code, found.language, found.num_stored, found.is_in_progress) == ("zzzzzzzzzz", "en", 0, True)
    assert [(trial.layout, trial.kind, trial.draw) for trial in find_trials(old, found)] == [
        ("first", "full", None),
        ("second", "random", 3),
    ]
    finished = find_participant(old, "hash1")
    assert finished is not None
    assert finished.completed_at is not None


def test_the_upgraded_database_takes_new_participants_and_keeps_old_rows_as_they_are(old: Database) -> None:
    old.upgrade()
    participant = enrol_somebody(old)
    walk(old, participant, 11)
    assert count(old, ratings) == 6 + 15
    for table in ("ratings", "arrangements", "trials", "pages"):
        with closing(sqlite3.connect(old.path)) as connection, pytest.raises(sqlite3.IntegrityError, match="never"):
            connection.execute(f"UPDATE {table} SET participant_id = participant_id WHERE participant_id = 1")  # noqa: S608


def test_the_earlier_log_and_the_places_given_out_begin_the_chain(old: Database) -> None:
    old.upgrade()
    with old.read() as connection:
        told = [(row[2], row[3], row[-1]) for row in told_by(connection, "created", "allocated")]
    assert told[0] == ("researcher", "created", {"account": "researcher", "role": "owner"})
    assert [content["experiments"][0]["arrangement"] for _, _, content in told[1:]] == [0, 1, 1]
    enrol_somebody(old)
    found = verify_log(old)
    assert (found.problems, found.num_unvouched) == ((), 3)
    assert (replay(old).num_before, replay(old).problems) == (3, ())


def test_who_began_before_the_log_can_be_erased(old: Database) -> None:
    old.upgrade()
    erase(old, "zzzzzzzzzz", "researcher", NOW)
    assert find_participant(old, "hash7") is None
    assert verify_log(old).problems == ()
    assert replay(old).problems == ()


def test_accounts_of_before_are_owners_and_stay_signed_in(old: Database) -> None:
    old.upgrade()
    assert rows(old.path, "researchers", "name, role, disabled_at") == [("researcher", "owner", None)]
    assert rows(old.path, "researcher_sessions", "token_hash, researcher_id") == [("token", 1)]
