"""Dumps of a PostgreSQL database, and what comes back from them."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import closing
from datetime import timedelta
from pathlib import Path

import pytest

from tests import postgres
from tests.unit.storage.people import NOW, enrol_somebody, walk
from webapp.storage import postgres_dumps
from webapp.storage.backup_manifests import BackupError, digest, manifest_path
from webapp.storage.database import Database
from webapp.storage.participants import find_participant, hash_token
from webapp.storage.postgres_dumps import dump, restore_dump, told, verify_dump
from webapp.storage.verification import verify_log


@pytest.fixture
def database(tmp_path: Path, postgres_server: postgres.Server, monkeypatch: pytest.MonkeyPatch) -> Iterator[Database]:
    monkeypatch.setenv("PATH", f"{postgres.binaries()}{os.pathsep}{os.environ['PATH']}")
    name = postgres_server.make()
    with closing(Database(tmp_path / "xar.sqlite3", postgres_server.url(name))) as opened:
        walk(opened, enrol_somebody(opened, "live", cookie="half way"), 3)
        yield opened
    postgres_server.drop(name)


@pytest.fixture
def empty(postgres_server: postgres.Server) -> Iterator[str]:
    """The address of a database with empty tables."""
    name = postgres_server.make()
    yield postgres_server.url(name)
    postgres_server.drop(name)


def test_a_dump_passes_its_check_and_people_go_on_from_it(database: Database, empty: str, tmp_path: Path) -> None:
    path, manifest = dump(database, tmp_path / "kept", NOW)
    assert manifest.head == verify_log(database).head
    assert (manifest.sha256, manifest.num_rows["pages"]) == (digest(path), 3)
    assert path.stat().st_mode & 0o777 == 0o600
    assert verify_dump(path, empty) == (manifest, [])
    restore_dump(path, tmp_path / "elsewhere" / "xar.sqlite3", empty)
    with closing(Database(tmp_path / "elsewhere" / "xar.sqlite3", empty)) as restored:
        person = find_participant(restored, hash_token("half way"))
        assert person is not None
        assert person.num_stored == 3
        assert verify_log(restored).head == manifest.head
        walk(restored, enrol_somebody(restored, "live"), 11)
        assert verify_log(restored).problems == ()


def test_the_manifest_is_of_the_state_that_was_dumped(
    database: Database, empty: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody answers after the rows were counted and before `pg_dump` begins: the backup is of before."""
    run = postgres_dumps._run

    def answer_first(address: object, program: str, *arguments: str, **settings: bool) -> None:
        if program == "pg_dump":
            walk(database, enrol_somebody(database, "live"), 2)
        run(address, program, *arguments, **settings)  # type: ignore[arg-type]

    monkeypatch.setattr(postgres_dumps, "_run", answer_first)
    path, manifest = dump(database, tmp_path / "kept", NOW)
    assert manifest.num_rows["participants"] == 1
    assert verify_dump(path, empty)[1] == []


def test_a_database_with_data_is_never_overwritten(database: Database, tmp_path: Path) -> None:
    path, _ = dump(database, tmp_path / "kept", NOW)
    assert database.url is not None
    with pytest.raises(BackupError, match="holds data; make an empty one"):
        restore_dump(path, database.path, database.url)


def test_a_dump_that_is_not_as_it_was_is_refused(database: Database, empty: str, tmp_path: Path) -> None:
    path, _ = dump(database, tmp_path / "kept", NOW)
    whole = path.read_bytes()
    path.write_bytes(whole[:-10])
    assert "is not the file that was backed up" in verify_dump(path, empty)[1][0]
    path.write_bytes(whole)
    later, _ = dump(database, tmp_path / "kept", NOW + timedelta(hours=1))
    walk(database, enrol_somebody(database, "live"), 2)
    last, _ = dump(database, tmp_path / "kept", NOW + timedelta(hours=2))
    text = manifest_path(later).read_text().replace(digest(later), digest(last))
    manifest_path(last).write_text(text)
    problems = verify_dump(last, empty)[1]
    assert any("the table participants has 2 rows, not 1" in problem for problem in problems)
    manifest_path(last).unlink()
    assert "has no manifest" in verify_dump(last, empty)[1][0]


def test_passwords_stand_on_no_command_line_and_in_no_manifest(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[list[str]] = []
    run = subprocess.run

    def note(command: list[str], **settings: object) -> object:
        seen.append(command)
        return run(command, **settings)  # type: ignore[call-overload]

    monkeypatch.setattr(subprocess, "run", note)
    assert database.url is not None
    database.url = database.url.replace("xar@", "xar:Hush%409@")
    path, _ = dump(database, tmp_path / "kept", NOW)
    assert seen
    assert not any("Hush" in word for command in seen for word in command)
    assert "Hush" not in manifest_path(path).read_text()


def test_what_fails_is_told_in_one_line(database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert told("postgresql://me:secret@db.example/study") == "postgresql://db.example:5432/study"
    with pytest.raises(BackupError, match="set DATABASE_URL"):
        told(None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BackupError, match="pg_dump was not found"):
        dump(database, tmp_path / "kept", NOW)
