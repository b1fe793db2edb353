"""What a backup is checked for, and what comes back from it."""

import shutil
import subprocess
import sys
from contextlib import closing
from datetime import timedelta
from pathlib import Path

import pytest

from tests.unit.storage.backed_up import changed, dump
from tests.unit.storage.people import NOW, enrol_somebody, pages_of, send, walk
from webapp.storage.backup_manifests import BackupError, manifest_path, read_manifest
from webapp.storage.database import Database
from webapp.storage.instance import InstanceError, only_server
from webapp.storage.participants import find_participant, hash_token
from webapp.storage.restoring import holds_data, restore, verify
from webapp.storage.verification import verify_log

pytestmark = pytest.mark.sqlite_only(reason="backups of SQLite's file; test_postgres_dumps has the others")


LATER = NOW + timedelta(hours=1)


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """The database's file of another instance, which does not exist yet."""
    return tmp_path / "elsewhere" / "xar.sqlite3"


def test_a_good_backup_passes_and_is_not_touched(backup: Path, tmp_path: Path) -> None:
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in backup.parent.iterdir()}
    manifest, problems = verify(backup, tmp_path / "elsewhere")
    assert (manifest, problems) == (read_manifest(backup), [])
    assert {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in backup.parent.iterdir()} == before
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_change_of_any_byte_is_found(backup: Path, tmp_path: Path) -> None:
    whole = backup.read_bytes()
    for place in (0, 100, len(whole) // 2, len(whole) - 1):
        content = bytearray(whole)
        content[place] ^= 1
        backup.write_bytes(content)
        assert "is not the file that was backed up" in verify(backup, tmp_path / "elsewhere")[1][0]
    backup.write_bytes(whole[:-4096])
    assert "is not the file that was backed up" in verify(backup, tmp_path / "elsewhere")[1][0]


@pytest.mark.parametrize(
    ("statement", "told"),
    [
        ("UPDATE ratings SET rating = 1 WHERE page_number = 3 AND participant_id = 2", "what it tells was changed"),
        ("DELETE FROM ratings WHERE participant_id = 2", "the table ratings has"),
        (
            "DELETE FROM record_contents WHERE number > 15; DELETE FROM records WHERE number > 15",
            "the chain ends with record 15",
        ),
        ("UPDATE alembic_version SET version_num = '9999'", "is of a later version of xar"),
        ("UPDATE pages SET participant_id = 99 WHERE participant_id = 2 AND number = 1", "refers to nothing"),
    ],
)
def test_what_somebody_changed_is_found_even_with_a_new_digest(
    backup: Path, tmp_path: Path, statement: str, told: str
) -> None:
    with changed(backup) as connection:
        connection.executescript(statement)
    _, problems = verify(backup, tmp_path / "elsewhere")
    assert any(told in problem for problem in problems), problems
    with pytest.raises(BackupError, match="was not restored"):
        restore(backup, tmp_path / "elsewhere" / "xar.sqlite3", LATER)
    assert not (tmp_path / "elsewhere" / "xar.sqlite3").exists()


@pytest.mark.parametrize("content", ["", "{}", "[]", '{"format": 2}', "not JSON", '{"format": 1, "head": 3}'])
def test_a_manifest_that_is_none_is_refused_in_words(backup: Path, tmp_path: Path, content: str) -> None:
    manifest_path(backup).write_text(content)
    _, (problem,) = verify(backup, tmp_path / "elsewhere")
    assert "is no manifest of a backup" in problem


def test_after_a_restore_everybody_goes_on_where_they_were(people: Database, backup: Path, elsewhere: Path) -> None:
    walk_on = find_participant(people, hash_token("half way"))
    assert walk_on is not None
    send(people, walk_on, 4)
    done = restore(backup, elsewhere, LATER)
    assert (done.kept, done.has_key, done.is_same_key) == (None, False, None)
    with closing(Database(elsewhere)) as restored:
        found = {cookie: find_participant(restored, hash_token(cookie)) for cookie in ("done", "half way", "begun")}
        num_stored = {cookie: person.num_stored for cookie, person in found.items() if person is not None}
        assert num_stored == {"done": 11, "half way": 3, "begun": 0}
        # The page that was answered after the backup is asked again, and taken once.
        person = found["half way"]
        assert person is not None
        page = pages_of(restored, person)[3]
        assert page == pages_of(people, walk_on)[3]
        assert send(restored, person, 4) == "accept"
        assert send(restored, person, 4) == "already_answered"
        walk(restored, enrol_somebody(restored, "live"), 11)
        assert verify_log(restored).problems == ()
    assert elsewhere.stat().st_mode & 0o777 == 0o600


def test_data_are_not_overwritten_unless_told_so_and_then_kept(people: Database, backup: Path) -> None:
    send(people, enrol_somebody(people), 1)
    people.close()
    before = dump(people.path)
    with pytest.raises(BackupError, match="holds data; with --replace"):
        restore(backup, people.path, LATER)
    assert dump(people.path) == before
    done = restore(backup, people.path, LATER, replace=True)
    assert done.kept is not None
    assert dump(done.kept) == before
    assert dump(people.path) == dump(backup)


def test_a_database_without_data_may_be_replaced(backup: Path, empty_database: Path, elsewhere: Path) -> None:
    elsewhere.parent.mkdir()
    shutil.copy(empty_database, elsewhere)
    assert not holds_data(elsewhere)
    restore(backup, elsewhere, LATER)
    assert holds_data(elsewhere)


def test_a_damaged_database_can_be_replaced_and_is_kept_with_its_journal(backup: Path, elsewhere: Path) -> None:
    elsewhere.parent.mkdir()
    elsewhere.write_bytes(b"not a database " * 1000)
    journal = elsewhere.with_name("xar.sqlite3-journal")
    journal.write_bytes(b"of the damaged one")
    with pytest.raises(BackupError, match="holds data"):
        restore(backup, elsewhere, LATER)
    done = restore(backup, elsewhere, LATER, replace=True)
    assert done.kept is not None
    assert done.kept.read_bytes().startswith(b"not a database")
    assert done.kept.with_name(f"{done.kept.name}-journal").read_bytes() == b"of the damaged one"
    assert not journal.exists()
    assert dump(elsewhere) == dump(backup)


def test_nothing_is_restored_while_a_server_runs(backup: Path, elsewhere: Path) -> None:
    elsewhere.parent.mkdir()
    with only_server(elsewhere.parent), pytest.raises(InstanceError, match="another server is running"):
        restore(backup, elsewhere, LATER)
    assert not elsewhere.exists()


def test_a_database_that_another_program_uses_is_not_replaced(people: Database, backup: Path) -> None:
    people.close()
    script = (
        "import sqlite3, sys; connection = sqlite3.connect(sys.argv[1], isolation_level=None)\n"
        "connection.execute('BEGIN IMMEDIATE'); print('begun', flush=True); sys.stdin.read()"
    )
    before = dump(people.path)
    with subprocess.Popen(
        [sys.executable, "-c", script, people.path], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"begun\n"
        with pytest.raises(BackupError, match="in use by another program"):
            restore(backup, people.path, LATER, replace=True)
        other.communicate()
    assert dump(people.path) == before
