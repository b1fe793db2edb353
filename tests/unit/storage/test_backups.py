"""Backups while people take part, and which of them are kept."""

import json
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.faults.backups import acknowledged, chain, stored, torn_copy, writing
from tests.unit.storage.backed_up import dump
from tests.unit.storage.people import NOW, enrol_somebody, send
from webapp.stimuli.bundle_files import bundle_version
from webapp.stimuli.publication import lock, point_at, published_bundle, unlock
from webapp.storage.backup_manifests import BackupError, Manifest, digest, manifest_path, read_manifest, write_manifest
from webapp.storage.backups import back_up, contents, expendable, remove_expendable
from webapp.storage.database import Database
from webapp.storage.records import Head
from webapp.storage.restoring import restore, verify
from webapp.storage.verification import verify_log

pytestmark = pytest.mark.sqlite_only(reason="backups of SQLite's file; test_postgres_dumps has the others")
LATER = NOW + timedelta(hours=1)


def test_a_backup_holds_every_row_and_its_manifest_says_so(people: Database, backup: Path) -> None:
    assert dump(backup) == dump(people.path)
    manifest = read_manifest(backup)
    assert manifest.sha256 == digest(backup)
    assert manifest.num_bytes == backup.stat().st_size
    assert manifest.head == verify_log(people).head
    assert (manifest.num_rows["participants"], manifest.num_rows["pages"]) == (3, 14)
    assert manifest.made_at == NOW
    assert Manifest.from_json(manifest.to_json()) == manifest


def test_a_backup_is_one_file_for_its_owner_alone(backup: Path) -> None:
    assert sorted(path.suffix for path in backup.parent.iterdir()) == [".json", ".sqlite3"]
    assert all(path.stat().st_mode & 0o777 == 0o600 for path in backup.parent.iterdir())
    assert backup.parent.stat().st_mode & 0o777 == 0o700


def test_nothing_is_overwritten(people: Database, backup: Path) -> None:
    before = backup.read_bytes()
    send(people, enrol_somebody(people), 1)
    with pytest.raises(BackupError, match="nothing is overwritten"):
        back_up(people.path, backup.parent, NOW)
    assert backup.read_bytes() == before
    assert len(list(backup.parent.iterdir())) == 2
    assert back_up(people.path, backup.parent, NOW + timedelta(microseconds=1))[0] != backup


def test_what_cannot_be_backed_up_is_told_in_one_line(people: Database, tmp_path: Path) -> None:
    with pytest.raises(BackupError, match="there is no database"):
        back_up(tmp_path / "nowhere" / "xar.sqlite3", tmp_path / "kept", NOW)
    (tmp_path / "a file").write_text("")
    with pytest.raises(BackupError, match="cannot hold a backup: File exists"):
        back_up(people.path, tmp_path / "a file", NOW)
    with pytest.raises(BackupError, match="there is no backup"):
        verify(tmp_path / "nothing.sqlite3", tmp_path)


def test_a_damaged_database_is_not_backed_up(people: Database, tmp_path: Path) -> None:
    people.close()
    content = bytearray(people.path.read_bytes())
    content[4096:8192] = bytes(4096)
    people.path.write_bytes(content)
    with pytest.raises(BackupError, match="damaged"):
        back_up(people.path, tmp_path / "kept", NOW)
    assert list((tmp_path / "kept").iterdir()) == []


def test_what_a_killed_backup_left_is_no_backup_and_goes_with_the_next(people: Database, tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    script = (
        "import os, signal, sys; from datetime import UTC, datetime; from pathlib import Path\n"
        "from webapp.storage import backups\n"
        "backups.digest = lambda path: os.kill(os.getpid(), signal.SIGKILL)\n"
        "backups.back_up(Path(sys.argv[1]), Path(sys.argv[2]), datetime.now(UTC))"
    )
    killed = subprocess.run([sys.executable, "-c", script, people.path, kept], check=False, timeout=60)
    assert killed.returncode == -9
    (left,) = kept.iterdir()
    assert left.name.startswith(".backup-")
    path, _ = back_up(people.path, kept, NOW)
    assert sorted(kept.iterdir()) == [manifest_path(path), path]


def test_every_backup_under_load_is_a_prefix_of_what_was_acknowledged(database: Database, tmp_path: Path) -> None:
    """Fault F16. The chain is one order of all transactions, so a backup whose head is in it is a prefix."""
    found = []
    with writing(database.path, tmp_path / "ledger") as wait:
        wait()
        for number in range(20):
            before = acknowledged(tmp_path / "ledger")
            found.append((before, back_up(database.path, tmp_path / "kept", NOW + timedelta(seconds=number))))
    final, at_the_end = chain(database.path), stored(database.path)
    heads = [manifest.head for _, (_, manifest) in found]
    assert len({head.number for head in heads}) >= 5, "people went on while the backups were made"
    assert all(final[head.number] == head.hash for head in heads)
    assert all(before <= stored(path) <= at_the_end for before, (path, _) in found)
    for _, (path, _) in found[::5]:
        assert verify(path, tmp_path / "elsewhere")[1] == []


def test_a_file_that_was_copied_under_load_is_refused_even_with_a_manifest(database: Database, tmp_path: Path) -> None:
    """The control of F16: half of the file is of one state and half of another."""
    copy = tmp_path / "copy" / "xar-copy.sqlite3"
    with writing(database.path, tmp_path / "ledger") as wait:
        wait()
        torn_copy(database.path, copy, wait)
    _, problems = verify(copy, tmp_path / "elsewhere")
    assert len(problems) == 1
    assert "no manifest" in problems[0]
    found = contents(copy)
    write_manifest(copy, a_manifest(sha256=digest(copy), num_rows=found.num_rows, head=found.head))
    assert verify(copy, tmp_path / "elsewhere")[1] != []


def test_the_secret_key_is_kept_apart_and_comes_back_where_there_is_none(people: Database, tmp_path: Path) -> None:
    key = people.path.with_name("secret_key")
    key.write_bytes(bytes(range(32)))
    path, manifest = back_up(people.path, tmp_path / "kept", NOW, with_secret_key=True)
    kept = path.with_suffix(".secret_key")
    assert manifest.has_secret_key
    assert kept.stat().st_mode & 0o777 == 0o600
    empty, other = tmp_path / "empty", tmp_path / "other"
    done = restore(path, empty / "xar.sqlite3", LATER)
    assert (done.has_key, done.is_same_key) == (True, True)
    assert (empty / "secret_key").read_bytes() == bytes(range(32))
    other.mkdir()
    (other / "secret_key").write_bytes(bytes(32))
    assert restore(path, other / "xar.sqlite3", LATER).is_same_key is False
    assert (other / "secret_key").read_bytes() == bytes(32)


def test_bundles_in_use_go_with_the_backup_and_are_published_again(database: Database, tmp_path: Path) -> None:
    version = write_small_bundle(database.path.parent)
    enrol_somebody(database, "live", version)
    enrol_somebody(database, "test", "gone")
    path, manifest = back_up(database.path, tmp_path / "kept", NOW)
    assert (manifest.bundles, manifest.missing_bundles) == ((version,), ("gone",))
    assert bundle_version(path.parent / "bundles" / version) == version
    restore(path, tmp_path / "elsewhere" / "xar.sqlite3", LATER)
    assert published_bundle(tmp_path / "elsewhere", "odd").name == version
    assert bundle_version(tmp_path / "elsewhere" / "bundles" / version) == version
    (path.parent / "bundles" / version / "catalogue.json").write_text("changed")
    _, problems = verify(path, tmp_path / "third")
    assert problems == [f"the bundle {path.parent / 'bundles' / version} was changed"]
    unlock(database.path.parent / "bundles" / version)
    unlock(tmp_path / "elsewhere" / "bundles" / version)


def write_small_bundle(instance: Path) -> str:
    draft = instance / "bundles" / "draft"
    draft.mkdir(parents=True)
    (draft / "catalogue.json").write_text("{}")
    version = bundle_version(draft)
    draft.rename(instance / "bundles" / version)
    lock(instance / "bundles" / version)
    point_at(instance, "odd", version)
    return version


def test_the_newest_of_each_day_and_week_is_kept() -> None:
    made = [a_backup(datetime(2031, 3, day, hour, tzinfo=UTC)) for day in range(1, 29) for hour in (6, 18)]
    gone = {path for path, _ in expendable(made, 3, 2)}
    kept = [manifest.made_at for path, manifest in made if path not in gone]
    # 2031-03-28 is a Friday: the last three days, and the end of the week before.
    assert [(time.day, time.hour) for time in kept] == [(23, 18), (26, 18), (27, 18), (28, 18)]


@given(
    st.lists(st.datetimes(datetime(2031, 1, 1), datetime(2031, 12, 31)), unique=True, max_size=40),  # noqa: DTZ001
    st.integers(0, 9),
    st.integers(0, 9),
)
def test_retention_keeps_the_newest_and_never_more_than_asked_for(
    times: list[datetime], keep_daily: int, keep_weekly: int
) -> None:
    made = [a_backup(time.replace(tzinfo=UTC)) for time in sorted(times)]
    gone = {path for path, _ in expendable(made, keep_daily, keep_weekly)}
    kept = [time for time in sorted(times) if a_backup(time.replace(tzinfo=UTC))[0] not in gone]
    assert kept[-1:] == sorted(times)[-1:]
    days = sorted({time.date() for time in times})
    assert {time.date() for time in kept} >= set(days[len(days) - keep_daily :] if keep_daily else [])
    assert len(kept) <= max(1, keep_daily + keep_weekly)


def test_only_what_we_made_of_this_database_is_removed(people: Database, tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    made = [back_up(people.path, kept, NOW + timedelta(days=day)) for day in range(5)]
    (kept / "xar-mine.sqlite3").write_text("a copy of somebody's")
    (kept / "notes.txt").write_text("notes")
    foreign, _ = back_up(people.path, kept, NOW - timedelta(days=1))
    write_manifest(foreign, replace(read_manifest(foreign), database="/another/xar.sqlite3"))
    removed = remove_expendable(kept, made[0][1].database, 2, 0)
    assert removed == [path for path, _ in made[:3]]
    left = {path.name for path in kept.iterdir()}
    assert left >= {"xar-mine.sqlite3", "notes.txt", foreign.name, made[3][0].name, made[4][0].name}
    assert len(left) == 2 + 3 * 2


def test_a_manifest_is_plain_json(backup: Path) -> None:
    content = json.loads(manifest_path(backup).read_text(encoding="utf-8"))
    assert content["format"] == 1
    assert content["made_at"] == "2031-03-01T09:30:00.000017+00:00"
    assert set(content["head"]) == {"number", "hash"}


def a_manifest(**fields: object) -> Manifest:
    empty = Manifest(NOW, "0", "there", "0003", 0, "", Head(0, ""), {}, (), (), {}, has_secret_key=False)
    return replace(empty, **fields)  # type: ignore[arg-type]


def a_backup(time: datetime) -> tuple[Path, Manifest]:
    return Path(f"{time:%Y%m%dT%H%M%S.%f}"), a_manifest(made_at=time)
