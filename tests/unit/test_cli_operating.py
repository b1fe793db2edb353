"""`xar backup`, `xar restore`, `xar migrate` and `xar doctor`, as somebody at a terminal meets them."""

import json
import os
import shutil
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from tests import postgres
from tests.faults.migrations import make_at
from tests.unit.storage.people import enrol_somebody, walk
from tests.unit.storage.test_migrations import PEOPLE
from tests.web.bundles import read_study, write_bundle
from tests.web.servers import run as run_xar
from tests.web.servers import serving
from webapp.cli import main
from webapp.storage import surroundings
from webapp.storage.database import Database, open_database
from webapp.storage.instance import only_server, secret_key
from webapp.storage.records import SYSTEM, Entry, append
from webapp.storage.surroundings import holders, left_behind

Xar = Callable[..., Result]
pytestmark = pytest.mark.sqlite_only(reason="it looks into SQLite's file")


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    """An instance whose study is built, with a key, tables and no participants."""
    folder = tmp_path / "instance"
    folder.mkdir(mode=0o700)
    write_bundle(folder, read_study())
    secret_key(folder)
    with open_database(folder / "xar.sqlite3"):
        pass
    return folder


@pytest.fixture
def xar(instance: Path, monkeypatch: pytest.MonkeyPatch) -> Xar:
    """Run the command in this process."""
    for name in [name for name in os.environ if name.startswith("XAR_")]:
        monkeypatch.delenv(name)
    monkeypatch.delenv("DATABASE_URL", raising=False)
    monkeypatch.setenv("XAR_INSTANCE", str(instance))
    # The folder of a test may lie anywhere.
    monkeypatch.setattr(surroundings, "place", lambda _instance: [])
    return lambda *words: CliRunner().invoke(main, [*words], prog_name="xar")


def version_of(instance: Path) -> str:
    return next(path.name for path in (instance / "bundles").iterdir() if path.is_dir())


def let_somebody_begin(instance: Path, mode: Any = "live", version: str | None = None) -> None:  # noqa: ANN401
    with closing(Database(instance / "xar.sqlite3")) as database:
        walk(database, enrol_somebody(database, mode, version or version_of(instance)), 2)


def findings(result: Result) -> Mapping[str, list[tuple[str, str]]]:
    found: dict[str, list[tuple[str, str]]] = {}
    for one in json.loads(result.stdout)["findings"]:
        found.setdefault(one["check"], []).append((one["status"], one["told"]))
    return found


def only_backup(instance: Path) -> Path:
    (path,) = (instance / "backups").glob("xar-*.sqlite3")
    return path


def test_a_backup_is_made_checked_and_restored(xar: Xar, instance: Path) -> None:
    let_somebody_begin(instance)
    made = xar("backup", "--with-secret-key")
    assert made.exit_code == 0
    path = only_backup(instance)
    assert f"Backup: {path} (" in made.stdout
    assert "1 participant)" in made.stdout
    checked = xar("restore", str(path), "--verify")
    assert (checked.exit_code, checked.stderr) == (0, "")
    assert "all is as it was" in checked.stdout
    refused = xar("restore", str(path))
    assert refused.exit_code == 2
    assert refused.stderr == f"xar: {instance}/xar.sqlite3 holds data; with --replace it is kept under another name\n"
    replaced = xar("restore", str(path), "--replace")
    assert replaced.exit_code == 0
    assert "The database that was there is kept: " in replaced.stdout
    assert json.loads(xar("restore", str(path), "--verify", "--json").stdout)["problems"] == []


def test_every_failure_of_a_check_is_a_line_and_status_1(xar: Xar, instance: Path) -> None:
    xar("backup")
    path = only_backup(instance)
    path.write_bytes(path.read_bytes()[:-1])
    failed = xar("restore", str(path), "--verify")
    assert failed.exit_code == 1
    assert "is not the file that was backed up" in failed.stderr
    assert json.loads(xar("restore", str(path), "--verify", "--json").stdout)["problems"] != []
    shutil.copy(instance / "xar.sqlite3", instance / "backups" / "copy.sqlite3")
    copied = xar("restore", str(instance / "backups" / "copy.sqlite3"), "--verify")
    assert copied.exit_code == 1
    assert "has no manifest" in copied.stderr
    assert xar("restore", str(instance / "nothing"), "--verify").exit_code == 2


def test_a_key_that_is_not_there_is_missed_before_anything_is_copied(xar: Xar, instance: Path, tmp_path: Path) -> None:
    (instance / "secret_key").unlink()
    refused = xar("backup", "--to", str(tmp_path / "kept"), "--with-secret-key")
    assert refused.exit_code == 2
    assert f"there is no secret key {instance / 'secret_key'} to keep" in refused.stderr
    assert not (tmp_path / "kept").exists()


def test_earlier_backups_go_only_if_that_is_wanted(xar: Xar, instance: Path) -> None:
    for _ in range(3):
        assert xar("backup").exit_code == 0
    assert len(list((instance / "backups").glob("*.sqlite3"))) == 3
    kept = xar("backup", "--keep-daily", "1", "--json")
    assert len(json.loads(kept.stdout)["removed"]) == 3
    assert json.loads(kept.stdout)["file"] == str(only_backup(instance))


def test_migrating_says_from_where_to_where(xar: Xar, instance: Path) -> None:
    assert "Nothing was done" in xar("migrate").stdout
    (instance / "xar.sqlite3").unlink()
    assert xar("migrate").stdout.startswith("Made the tables")
    (instance / "xar.sqlite3").unlink()
    make_at(instance / "xar.sqlite3", "0001", PEOPLE)
    done = xar("migrate")
    assert "Brought the tables from revision 0001 to " in done.stdout
    assert f"Backup: {only_backup(instance)}" in done.stdout
    with only_server(instance):
        assert xar("migrate").exit_code == 2


def test_all_is_well_with_and_without_a_server(xar: Xar, instance: Path) -> None:
    found = xar("doctor")
    assert (found.exit_code, found.stdout.splitlines()[-1]) == (0, "All is well.")
    assert all(len(line.rstrip()) <= 80 for line in found.stdout.splitlines())
    with serving(instance) as server:
        let_somebody_begin(instance)
        done = run_xar(instance, "backup")
        assert done.returncode == 0, done.stderr
        found_now = findings(xar("doctor", "--json"))
        assert found_now["server"] == [("ok", f"runs at http://127.0.0.1:{server.port}")]
        assert found_now["integrity"][0][0] == found_now["pragmas"][0][0] == found_now["backups"][0][0] == "ok"
        assert xar("restore", str(only_backup(instance)), "--replace").exit_code == 2
        assert server.stop()[0] == 0


def test_every_trouble_has_its_line(xar: Xar, instance: Path) -> None:
    """One instance with a whole list of troubles, each of which the doctor must name."""
    let_somebody_begin(instance, version="gone")
    (instance / "secret_key").write_bytes(b"short")
    (instance / "notes.txt").write_text("notes")
    (instance / "notes.txt").chmod(0o644)
    (instance / ".snapshot-left").touch(mode=0o600)
    shutil.copy(instance / "xar.sqlite3", instance / "copy-of-monday.sqlite3")
    with closing(Database(instance / "xar.sqlite3")) as database, database.write() as connection:
        append(connection, Entry(datetime.now(UTC) + timedelta(days=1), SYSTEM, "served"))
    with closing(sqlite3.connect(instance / "xar.sqlite3")) as connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'trigger'").fetchall():
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute("UPDATE pages SET kind = 'changed' WHERE number = 1")
        connection.commit()
    result = xar("doctor", "--json")
    found = {
        check: "; ".join(told for status, told in all_ if status != "ok") for check, all_ in findings(result).items()
    }
    assert result.exit_code == 1
    assert "holds 5 bytes, not 32" in found["secret key"]
    assert "notes.txt can be read by others (mode 0644)" in found["permissions"]
    assert ".snapshot-left is half-made" in found["left behind"]
    assert "copy-of-monday.sqlite3 is a copy of a database" in found["left behind"]
    assert "what it tells was changed" in found["record chain"]
    assert "a record is of" in found["clock"]
    assert "the bundle gone is missing" in found["bundles"]
    assert "there are live data and no backup" in found["backups"]
    assert "Problems:" in xar("doctor").stdout


def test_damage_and_what_is_no_database_are_told(xar: Xar, instance: Path) -> None:
    let_somebody_begin(instance)
    content = bytearray((instance / "xar.sqlite3").read_bytes())
    with closing(sqlite3.connect(instance / "xar.sqlite3")) as connection:
        query = "SELECT rootpage FROM sqlite_schema WHERE name = 'ratings'"
        (page,) = connection.execute(query).fetchone()
    content[(page - 1) * 4096 : page * 4096] = bytes(4096)
    (instance / "xar.sqlite3").write_bytes(content)
    damaged = xar("doctor", "--json")
    assert damaged.exit_code == 1
    assert findings(damaged)["integrity"][0][0] == "problem"
    (instance / "xar.sqlite3").write_bytes(b"no database " * 1000)
    assert "cannot be used" in findings(xar("doctor", "--json"))["database"][0][1]


def test_an_old_backup_is_warned_of(xar: Xar, instance: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    let_somebody_begin(instance)
    xar("backup")
    (manifest,) = (instance / "backups").glob("*.json")
    told = json.loads(manifest.read_text())
    told["made_at"] = (datetime.now(UTC) - timedelta(days=3)).isoformat()
    manifest.write_text(json.dumps(told))
    assert findings(xar("doctor", "--json"))["backups"] == [
        ("warning", f"1 in {instance}/backups, the newest 3 days old")
    ]
    monkeypatch.setenv("XAR_BACKUPS", str(instance / "elsewhere"))
    assert "no backup in" in findings(xar("doctor", "--json"))["backups"][0][1]


def test_a_folder_that_is_not_there_is_told(xar: Xar, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XAR_INSTANCE", str(tmp_path / "nowhere"))
    assert findings(xar("doctor", "--json"))["instance"][0][0] == "problem"
    assert not (tmp_path / "nowhere").exists()


def test_a_journal_without_a_server_and_other_programs_are_told(instance: Path, tmp_path: Path) -> None:
    database = instance / "xar.sqlite3"
    database.with_name("xar.sqlite3-journal").write_bytes(b"of a killed program")
    assert [finding.status for finding in left_behind(database, is_served=False)] == ["warning"]
    assert [finding.status for finding in left_behind(database, is_served=True)] == ["ok"]
    process = tmp_path / "processes" / "4711"
    (process / "fd").mkdir(parents=True)
    (process / "fd" / "3").symlink_to(database)
    (process / "cmdline").write_bytes(b"a-browser-of-databases\0xyz\0")
    assert holders(database, process.parent).told == "open in other programs: 4711 (a-browser-of-databases xyz)"
    (process / "cmdline").write_bytes(b"/opt/bin/xar\0serve\0")
    assert holders(database, process.parent).status == "ok"


@pytest.fixture
def address(postgres_server: postgres.Server, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The address of a PostgreSQL database with empty tables."""
    monkeypatch.setenv("PATH", f"{postgres.binaries()}{os.pathsep}{os.environ['PATH']}")
    name = postgres_server.make()
    yield postgres_server.url(name)
    postgres_server.drop(name)


def test_the_verbs_take_the_database_of_the_settings(xar: Xar, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DATABASE_URL", address)
    made = xar("backup", "--json")
    assert made.exit_code == 0, made.stderr
    path = Path(json.loads(made.stdout)["file"])
    assert xar("restore", str(path), "--verify").exit_code == 0
    assert xar("restore", str(path)).exit_code == 0
    found = findings(xar("doctor", "--json"))
    assert "fsync=on" in found["PostgreSQL"][0][1]
    assert found["schema"][0][0] == found["record chain"][0][0] == "ok"
    assert "Nothing was done" in xar("migrate").stdout
    monkeypatch.delenv("DATABASE_URL")
    assert "set DATABASE_URL" in xar("restore", str(path), "--verify").stderr


def test_with_postgresql_the_doctor_speaks_of_nothing_that_only_sqlite_has(
    xar: Xar, instance: Path, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (instance / "xar.sqlite3-journal").write_bytes(b"of the file that was used before")
    monkeypatch.setattr(surroundings, "MIN_FREE_MB", 10**9)
    of_sqlite = ("SQLite", "journal", "commits with a log", "other programs", "no answer can be stored")
    told = " ".join(xar("doctor").stdout.split())
    assert [words for words in of_sqlite if words in told] == [*of_sqlite]
    monkeypatch.setenv("DATABASE_URL", address)
    told = " ".join(xar("doctor").stdout.split())
    assert [words for words in of_sqlite if words in told] == []
    assert "server_version=" in told
    assert "nothing half-made" in told
