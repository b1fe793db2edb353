"""`/healthz`: whether anything can be stored, asked as often as anybody likes."""

import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from flask import Flask
from sqlalchemy.exc import OperationalError

from webapp.config import Config
from webapp.storage import sqlite_edition
from webapp.views.health import CHECK_INTERVAL_S, SharedCheck
from webapp.views.services import services_of


class Disk:
    """A disk to check, with a clock of its own.

    Attributes:
        num_checks: How often it was written to.
        is_full: Whether it refuses.
        now_s: The time.
    """

    def __init__(self) -> None:
        self.num_checks = 0
        self.is_full = False
        self.now_s = 0.0
        self.shared = SharedCheck(self.check, lambda: self.now_s)

    def check(self) -> None:
        self.num_checks += 1
        if self.is_full:
            raise OperationalError("INSERT", None, OSError("disk full"))


def test_however_many_ask_the_disk_is_written_to_once_a_second() -> None:
    disk = Disk()
    for step in range(1000):
        disk.now_s = step * 0.01
        assert disk.shared.is_well()
    assert disk.num_checks == 10


def test_what_changed_is_seen_a_second_later() -> None:
    disk = Disk()
    assert disk.shared.is_well()
    disk.is_full = True
    assert disk.shared.is_well()
    disk.now_s += CHECK_INTERVAL_S
    assert not disk.shared.is_well()
    disk.is_full = False
    assert not disk.shared.is_well()
    disk.now_s += CHECK_INTERVAL_S
    assert disk.shared.is_well()


def test_a_check_that_hangs_keeps_nobody_else_waiting_and_counts_as_failed() -> None:
    disk = Disk()
    has_begun, may_end = threading.Event(), threading.Event()

    def hang() -> None:
        has_begun.set()
        may_end.wait(30)

    shared = SharedCheck(hang, lambda: disk.now_s)
    first = threading.Thread(target=shared.is_well)
    first.start()
    assert has_begun.wait(30)
    assert shared.is_well()
    disk.now_s += 3
    assert not shared.is_well()
    may_end.set()
    first.join()
    assert shared.is_well()


def test_an_error_of_the_program_itself_is_no_health_and_blocks_nothing() -> None:
    disk = Disk()

    def fail() -> None:
        raise ZeroDivisionError

    shared = SharedCheck(fail, lambda: disk.now_s)
    with pytest.raises(ZeroDivisionError):
        shared.is_well()
    assert not shared.is_well()
    disk.now_s += CHECK_INTERVAL_S
    with pytest.raises(ZeroDivisionError):
        shared.is_well()


@pytest.mark.parametrize(
    ("accept", "kind", "text"),
    [
        (None, "text/plain", "ok\n"),
        ("*/*", "text/plain", "ok\n"),
        ("application/json", "application/json", '{"status":"ok"}\n'),
        ("text/html, */*", "text/plain", "ok\n"),
    ],
)
def test_people_and_machines_are_told_in_their_way(app: Flask, accept: str | None, kind: str, text: str) -> None:
    answer = app.test_client().get("/healthz", headers={} if accept is None else {"Accept": accept})
    assert (answer.status_code, answer.mimetype, answer.text) == (200, kind, text)
    assert answer.headers["Cache-Control"] == "no-store"
    assert "Set-Cookie" not in answer.headers


def test_a_hundred_requests_are_one_write(app: Flask, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = Disk()
    monkeypatch.setitem(app.extensions, "xar-health", disk.shared)
    client = app.test_client()
    assert [client.get("/healthz").status_code for _ in range(100)] == [200] * 100
    assert disk.num_checks == 1


@pytest.mark.sqlite_only(reason="it locks SQLite's file")
def test_when_nothing_can_be_written_the_answer_is_503_until_it_can(
    instance: Path, start_app: Callable[[Config], Flask], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_edition, "BUSY_TIMEOUT_S", 0.05)
    app = start_app(Config(instance))
    disk = Disk()
    shared = SharedCheck(services_of(app).database.check_writable, lambda: disk.now_s)
    monkeypatch.setitem(app.extensions, "xar-health", shared)
    client = app.test_client()
    with closing(sqlite3.connect(instance / "xar.sqlite3", isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        answer = client.get("/healthz", headers={"Accept": "application/json"})
        assert (answer.status_code, answer.json) == (503, {"status": "unavailable"})
        assert (answer.headers["Retry-After"], answer.headers["Cache-Control"]) == ("5", "no-store")
        other.execute("ROLLBACK")
    disk.now_s += CHECK_INTERVAL_S
    assert client.get("/healthz").text == "ok\n"
