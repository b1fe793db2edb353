"""The baton: one thread has it, lays it aside while it waits, and nobody waits for it for long."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from tests.unit.storage.people import NOW, enrol_somebody
from webapp.storage import baton as module
from webapp.storage.baton import Baton
from webapp.storage.database import Database
from webapp.storage.participants import withdraw

PATIENCE_S = 10


def in_a_thread(action: Callable[[], object]) -> "Future[object]":
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(action)


def is_free(baton: Baton) -> bool:
    """Whether another thread gets it at once."""
    return not baton._lock.locked()


def has_it_meanwhile(baton: Baton) -> bool:
    with baton.held():
        return baton.is_mine


def test_one_thread_has_it_at_a_time_until_it_is_through() -> None:
    baton, inside, most = Baton(), 0, 0
    counting = threading.Lock()

    def work() -> None:
        nonlocal inside, most
        for _ in range(50):
            with baton.held():
                with counting:
                    inside += 1
                    most = max(most, inside)
                time.sleep(0.0002)
                with counting:
                    inside -= 1

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
    assert most == 1
    assert is_free(baton)


def test_who_does_not_get_it_goes_on_without(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 0.01)
    baton = Baton()
    with baton.held():
        assert baton.is_mine
        assert in_a_thread(lambda: has_it_meanwhile(baton)).result(PATIENCE_S) is False
        # And leaves it with whoever has it.
        assert not is_free(baton)
    assert is_free(baton)


def test_others_have_it_while_it_is_laid_aside() -> None:
    baton = Baton()
    with baton.held():
        with baton.aside():
            assert not baton.is_mine
            assert in_a_thread(lambda: has_it_meanwhile(baton)).result(PATIENCE_S) is True
        assert baton.is_mine
    with baton.aside():
        assert is_free(baton)
    assert is_free(baton)


def test_it_is_given_back_after_an_error() -> None:
    baton = Baton()
    with pytest.raises(ZeroDivisionError), baton.held():
        raise ZeroDivisionError
    with pytest.raises(ZeroDivisionError), baton.held(), baton.aside():
        raise ZeroDivisionError
    assert is_free(baton)


def test_it_is_laid_aside_while_a_thread_waits_for_its_turn_to_write_and_for_the_disk(database: Database) -> None:
    person, baton = enrol_somebody(database), database.baton
    has_turn, may_end = threading.Event(), threading.Event()

    def take_a_turn() -> None:
        with database.write():
            has_turn.set()
            assert may_end.wait(PATIENCE_S)

    def leave() -> None:
        with baton.held():
            withdraw(database, person, NOW)
            assert baton.is_mine

    threads = [threading.Thread(target=take_a_turn), threading.Thread(target=leave)]
    threads[0].start()
    assert has_turn.wait(PATIENCE_S)
    threads[1].start()
    while not database._turns._waiting:
        time.sleep(0.001)
    deadline = time.monotonic() + PATIENCE_S
    while not is_free(baton):
        assert time.monotonic() < deadline, "whoever waits for a turn keeps the baton"
    may_end.set()
    for thread in threads:
        thread.join(PATIENCE_S)
    assert is_free(baton)


def test_whoever_commits_has_laid_it_aside(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    person, baton = enrol_somebody(database), database.baton
    seen: list[bool] = []
    finish = database._turns._finish

    def _finish() -> None:
        seen.append(is_free(baton))
        finish()

    monkeypatch.setattr(database._turns, "_finish", _finish)
    with baton.held():
        withdraw(database, person, NOW)
    assert seen == [True]
