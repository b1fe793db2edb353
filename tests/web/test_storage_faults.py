"""The disk is full, read-only or slow, or somebody else holds the database."""

import os
import random
import shutil
import subprocess
import time
from contextlib import closing
from pathlib import Path

import pytest

from tests.faults.client import Browser, send_page, take_part
from tests.faults.disk_full import limited
from tests.faults.flushes import watch
from tests.faults.lock import race
from tests.faults.oracle import Ledger, judge, stored_sheets
from tests.faults.program import running
from tests.web.bundles import read_study, write_bundle
from tests.web.people import filled
from tests.web.servers import XAR, environment
from webapp.storage.database import Database
from webapp.storage.verification import verify_log


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    folder = tmp_path / "instance"
    write_bundle(folder, read_study())
    return folder


@pytest.mark.sqlite_only(reason="the program itself writes SQLite's file")
def test_on_a_full_disk_people_are_asked_to_try_again_and_nothing_is_lost(instance: Path) -> None:
    ledger, rng = Ledger(), random.Random(1)
    with running(instance) as program:
        browsers = [Browser(program.port) for _ in range(4)]
        for browser in browsers:
            take_part(browser, ledger, rng, last=2)
        with limited(program):
            for browser in browsers:
                form = filled(3, browser.nonce_of("/study/3"))
                for _ in range(2):
                    status, headers, text = browser.ask_once("/study/3", form)
                    assert (status, headers["Retry-After"]) == (503, "5")
                    assert "Everything that you sent before is safe." in text
        began = time.monotonic()
        for browser in browsers:
            send_page(browser, ledger, rng, 3)
            browser.close()
        assert time.monotonic() - began < 5
    with closing(Database(instance / "xar.sqlite3")) as database:
        with database.read() as connection:
            assert judge(ledger.acknowledged, ledger.sent, stored_sheets(connection)).is_clean
        assert verify_log(database).problems == ()


def test_a_read_only_folder_is_refused_at_the_start_in_one_line(instance: Path) -> None:
    with running(instance):
        pass
    command = [*XAR, "serve", "--port", "0"]
    if os.geteuid() == 0:  # Root may write anywhere but to what is mounted read-only.
        unshare = shutil.which("unshare")
        assert unshare is not None, "unshare was not found: apt-get install util-linux"
        mounted = 'mount --bind "$0" "$0" && mount -o remount,ro,bind "$0" && exec "$@"'
        command = [unshare, "-m", "sh", "-c", mounted, str(instance), *command]
    else:
        for path in (*instance.glob("xar.*"), instance):
            path.chmod(0o500 if path.is_dir() else 0o400)
    finished = subprocess.run(
        command, env=environment(instance), capture_output=True, text=True, timeout=60, check=False
    )
    instance.chmod(0o700)
    assert finished.returncode == 2, finished.stderr
    assert str(instance) in finished.stderr
    assert "Traceback" not in finished.stderr


def test_two_requests_that_wait_for_the_same_lock_make_one_step(tmp_path: Path) -> None:
    outcome = race(tmp_path / "instance", 2, url=os.environ.get("DATABASE_URL"))
    assert outcome.is_clean, outcome


def test_a_program_that_decides_by_what_it_knew_before_the_lock_is_found_out(tmp_path: Path) -> None:
    outcome = race(tmp_path / "instance", 1, mutant="cached", url=os.environ.get("DATABASE_URL"))
    assert 500 in outcome.statuses


@pytest.mark.sqlite_only(reason="the program itself flushes SQLite's file")
def test_every_page_is_flushed_to_disk_before_it_is_answered(tmp_path: Path) -> None:
    assert watch(tmp_path / "real", 2) == (22, 22)
    assert watch(tmp_path / "unsynced", 2, mutant="unsynced") == (22, 0)
