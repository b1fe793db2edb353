"""What the overview tells admins about the server: the last answer, the disk, the newest backup."""

import re
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from datetime import timedelta
from pathlib import Path
from typing import NamedTuple

import pytest
from flask import Flask
from sqlalchemy import event

from tests.web.bundles import FILLED_IN, read_study, write_bundle
from tests.web.people import Clock, Visitor
from tests.web.researchers import researcher_of
from webapp.config import Config, read_config
from webapp.storage import backup_manifests
from webapp.storage.backup_manifests import Manifest, manifest_path, newest_backup
from webapp.storage.backups import back_up
from webapp.storage.condition import condition
from webapp.views.services import services_of


class Usage(NamedTuple):
    free: int


pytestmark = pytest.mark.sqlite_only(reason="backups of SQLite's file")


@pytest.fixture
def live(tmp_path: Path, start_app: Callable[[Config], Flask]) -> Flask:
    write_bundle(tmp_path / "live", read_study(**FILLED_IN))
    return start_app(Config(tmp_path / "live", live=True))


def panel(visitor: Visitor) -> str:
    """What stands in the panel, without tags; empty where there is none."""
    found = re.search(r'<section class="panel" id="server".*?</section>', visitor.get("/researcher/").text, re.DOTALL)
    return "" if found is None else " ".join(re.sub("<[^>]+>", " ", found[0]).split())


def made(app: Flask, clock: Clock, **ago: float) -> Path:
    """Make a backup where the settings have it, and return it."""
    config = services_of(app).config
    return back_up(config.database_path, config.backup_folder, clock.time - timedelta(**ago))[0]


def test_admins_see_it_and_nobody_else(app: Flask) -> None:
    told = {role: panel(researcher_of(app, role, role)) for role in ("viewer", "owner", "admin")}
    assert told["viewer"] == told["owner"] == ""
    assert told["admin"].startswith("The server Last answer none yet Disk ")
    assert told["admin"].endswith("MB free Newest backup none")


def test_the_last_answer_is_that_of_anybody_and_no_consent(app: Flask, clock: Clock) -> None:
    admin, visitor = researcher_of(app, "admin"), Visitor(app)
    visitor.agree()
    assert "Last answer none yet" in panel(admin)
    for number in (1, 2, 3):
        assert visitor.answer(number).status_code == 303
        stored_at = clock.time
        clock.wait(minutes=5)
        assert f"Last answer {stored_at:%Y-%m-%d %H:%M}" in panel(admin)
    visitor.post("/leave")
    assert f"Last answer {stored_at:%Y-%m-%d %H:%M}" in panel(admin)


def test_real_data_without_a_young_backup_are_a_problem(live: Flask, clock: Clock) -> None:
    admin = researcher_of(live, "admin")
    assert "Newest backup none Problem : run xar backup" in panel(admin)
    made(live, clock, days=2)
    assert "Warning : run xar backup" in panel(admin)
    made(live, clock, hours=3)
    told = panel(admin)
    assert f"Newest backup {clock.time - timedelta(hours=3):%Y-%m-%d %H}" in told
    assert "Warning" not in told
    clock.wait(hours=20)
    assert "Warning" not in panel(researcher_of(live, "admin", "another"))
    clock.wait(hours=4)
    assert "Warning" in panel(researcher_of(live, "admin", "third"))


def test_of_a_test_run_no_backup_is_asked_for(app: Flask, clock: Clock) -> None:
    made(app, clock, days=9)
    told = panel(researcher_of(app, "admin"))
    assert f"Newest backup {clock.time - timedelta(days=9):%Y-%m-%d}" in told
    assert "Warning" not in told


@pytest.mark.parametrize(("free_mb", "word"), [(400, "Problem : make room"), (900, "Warning : make room"), (9_000, "")])
def test_little_room_is_told(app: Flask, monkeypatch: pytest.MonkeyPatch, free_mb: int, word: str) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(free_mb * 10**6))
    told = panel(researcher_of(app, "admin"))
    assert f"Disk {free_mb:,} MB free" in told
    assert word in told
    assert ("make room" in told) == bool(word)


def test_the_newest_that_is_whole_and_of_this_database_counts(app: Flask, clock: Clock, tmp_path: Path) -> None:
    config = services_of(app).config
    name, folder = str(config.database_path.absolute()), config.backup_folder
    assert newest_backup(folder, name) is None
    good, torn, gone = (made(app, clock, hours=hours) for hours in (9, 5, 3))
    manifest_path(torn).write_text("{", encoding="utf-8")
    gone.unlink()
    shutil.copy(config.database_path, tmp_path / "xar.sqlite3")
    back_up(tmp_path / "xar.sqlite3", folder, clock.time)
    found = newest_backup(folder, name)
    assert found is not None
    assert found.made_at == clock.time - timedelta(hours=9)
    assert good.exists()


def test_a_look_reads_one_manifest_and_the_end_of_the_log(
    app: Flask, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = services_of(app)
    read: list[Path] = []
    asked: list[tuple[str, tuple[object, ...]]] = []
    for hours in range(1, 30):
        made(app, clock, hours=hours)
    kept = backup_manifests.read_manifest

    def counted(path: Path) -> Manifest:
        read.append(path)
        return kept(path)

    monkeypatch.setattr(backup_manifests, "read_manifest", counted)
    with here.database.read() as connection:
        engine = connection.engine
    event.listen(engine, "before_cursor_execute", lambda *told: asked.append((told[2], told[3])))
    condition(here.database, here.config.backup_folder, clock.time, is_live=True)
    assert len(read) == 1
    asked = [question for question in asked if question[0].startswith("SELECT")]
    ((statement, values),) = asked
    with closing(sqlite3.connect(here.config.database_path)) as other:
        plan = other.execute(f"EXPLAIN QUERY PLAN {statement}", values).fetchall()
    # By number, of which the last ones come first: no step that would have to read all of them to sort them.
    assert [step for *_, step in plan] == ["SCAN records"]


def test_backups_are_looked_for_where_the_settings_say(tmp_path: Path) -> None:
    assert read_config({"XAR_INSTANCE": str(tmp_path)}).backup_folder == tmp_path / "backups"
    assert read_config({"XAR_BACKUPS": str(tmp_path / "x")}).backup_folder == tmp_path / "x"
