import random
import signal
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError, OperationalError

from tests.unit.storage.group_turns import Deed, Turns, insert
from tests.unit.storage.people import at_once
from webapp.storage.group_commit import GroupCommit

pytestmark = pytest.mark.sqlite_only(reason="it opens a file of its own")


@pytest.fixture
def turns(tmp_path: Path) -> Iterator[Turns]:
    opened = Turns(tmp_path / "numbers.sqlite3")
    yield opened
    opened.database.close()


def test_those_who_wait_share_one_commit_and_see_what_was_done_before_them(turns: Turns) -> None:
    futures = turns.while_held(lambda: turns.add("second"), lambda: turns.add("third"), lambda: turns.add("fourth"))
    assert [future.result() for future in futures] == [2, 3, 4]
    assert turns.stored() == {1: "first", 2: "second", 3: "third", 4: "fourth"}
    assert turns.group.num_commits == 1


def test_who_is_alone_waits_for_nobody(turns: Turns) -> None:
    for number in range(1, 4):
        assert turns.add(f"name {number}") == number
        assert len(turns.stored()) == turns.group.num_commits == number


def test_nobody_goes_on_and_nobody_sees_anything_before_the_commit(turns: Turns) -> None:
    seen: list[tuple[bool, dict[int, str]]] = []

    def look_from_the_last_turn() -> None:
        with turns.group.write() as connection:
            insert(connection, "third")
            seen.append((second[0].done(), turns.stored()))

    second: list[Future[object]] = []
    with ThreadPoolExecutor(2) as pool, turns.group.write() as connection:
        second.append(pool.submit(turns.add, "second"))
        while len(turns.group._waiting) < 1:
            pass
        last = pool.submit(look_from_the_last_turn)
        while len(turns.group._waiting) < 2:
            pass
        insert(connection, "first")
    last.result()
    assert seen == [(False, {})]
    assert turns.stored() == {1: "first", 2: "second", 3: "third"}


def test_a_group_has_no_more_members_than_it_may(tmp_path: Path) -> None:
    turns = Turns(tmp_path / "numbers.sqlite3", max_members=5)
    turns.while_held(*(lambda name=f"name {number}": turns.add(name) for number in range(12)))
    assert len(turns.stored()) == 13
    assert turns.group.num_commits == 3
    turns.database.close()


def test_who_fails_undoes_nothing_of_the_others(turns: Turns) -> None:
    good, bad, last = turns.while_held(
        lambda: turns.add("second"), lambda: turns.add("bad", "fail"), lambda: turns.add("third")
    )
    assert (good.result(), last.result()) == (2, 3)
    with pytest.raises(ValueError, match="bad"):
        bad.result()
    assert turns.stored() == {1: "first", 2: "second", 3: "third"}
    with pytest.raises(ValueError, match="alone"):
        turns.add("alone", "fail")
    assert turns.add("fourth") == 4


def test_a_commit_that_fails_is_told_to_everybody_by_an_error_of_their_own_and_stores_nothing(turns: Turns) -> None:
    told: list[OperationalError] = []

    def refused(action: Callable[[], object]) -> Callable[[], None]:
        def run() -> None:
            with pytest.raises(OperationalError, match="FOREIGN KEY") as caught:
                action()
            told.append(caught.value)

        return run

    with pytest.raises(OperationalError, match="FOREIGN KEY") as caught:
        turns.while_held(
            refused(lambda: turns.add("second")),
            refused(lambda: turns.owe("nobody")),
            refused(lambda: turns.add("bad", "fail")),
        )
    assert len({id(error) for error in (caught.value, *told)}) == 4
    assert turns.stored() == {}
    assert turns.add("later") == 1


def test_a_member_whose_transaction_breaks_costs_the_group_and_nobody_after_it(turns: Turns) -> None:
    later = []

    def add_later() -> None:
        later.append(turns.add("later"))

    with pytest.raises(OperationalError, match="UNIQUE"):
        turns.while_held(lambda: _told(turns, "broken", "break"), add_later)
    assert later == [1]
    assert turns.stored() == {1: "later"}


def test_a_turn_alone_comes_after_everything_before_it_is_on_disk(turns: Turns) -> None:
    def alone() -> dict[int, str]:
        with turns.group.alone():
            return turns.stored()

    second, between, third = turns.while_held(lambda: turns.add("second"), alone, lambda: turns.add("third"))
    assert (second.result(), third.result()) == (2, 3)
    assert between.result() == {1: "first", 2: "second"}
    assert turns.group.num_commits == 2


def test_a_transaction_that_cannot_begin_is_told_to_whoever_wanted_it_alone(tmp_path: Path) -> None:
    turns = Turns(tmp_path / "numbers.sqlite3")
    refusals = iter([True, False])

    @contextmanager
    def begin() -> Iterator[Connection]:
        if next(refusals):
            raise OperationalError("BEGIN", None, sqlite3.OperationalError("database is locked"))
        with turns.database.edition.writing() as connection:
            yield connection

    turns.group = GroupCommit(begin)
    with pytest.raises(OperationalError, match="locked"):
        turns.add("refused")
    assert turns.add("first") == 1
    turns.database.close()


class Interrupted(BaseException):
    """What Ctrl-C raises, but for these tests alone."""


def test_who_is_interrupted_within_a_turn_leaves_the_others_to_their_commit(turns: Turns) -> None:
    def interrupted() -> None:
        with turns.group.write() as connection:
            insert(connection, "interrupted")
            raise Interrupted

    second, broken = turns.while_held(lambda: turns.add("second"), interrupted)
    assert second.result() == 2
    with pytest.raises(Interrupted):
        broken.result()
    assert turns.stored() == {1: "first", 2: "second"}


def test_who_is_interrupted_while_waiting_leaves_the_queue(turns: Turns) -> None:
    def interrupt(_number: int, _frame: FrameType | None) -> None:
        if not interrupted:
            interrupted.append(True)
            raise Interrupted

    def hold() -> None:
        with turns.group.write() as connection:
            holds.set()
            while not turns.group._waiting:
                pass
            while turns.group._waiting:  # A signal just before the wait begins does not end it.
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1)
                time.sleep(0.01)
            insert(connection, "first")

    holds, interrupted = threading.Event(), list[bool]()
    before = signal.signal(signal.SIGUSR1, interrupt)
    try:
        with ThreadPoolExecutor(1) as pool:
            holder = pool.submit(hold)
            holds.wait()
            with pytest.raises(Interrupted):
                turns.add("never")
            holder.result()
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert turns.add("second") == 2
    assert turns.stored() == {1: "first", 2: "second"}


@settings(max_examples=25)
@given(
    deeds=st.lists(
        st.lists(st.sampled_from(["store", "store", "store", "fail", "break"]), min_size=1, max_size=6),
        min_size=1,
        max_size=8,
    ),
    max_members=st.integers(1, 9),
)
def test_what_is_stored_is_what_was_acknowledged_in_the_order_of_the_turns(
    tmp_path_factory: pytest.TempPathFactory, deeds: list[list[Deed]], max_members: int
) -> None:
    turns = Turns(tmp_path_factory.mktemp("turns") / "numbers.sqlite3", max_members)
    acknowledged: dict[int, str] = {}

    def act(thread: int) -> None:
        for place, deed in enumerate(deeds[thread]):
            name = f"{thread} {place}"
            number = _told(turns, name, deed)
            if number is not None:
                acknowledged[number] = name

    at_once(len(deeds), act)
    assert turns.stored() == dict(sorted(acknowledged.items()))
    assert list(turns.stored()) == list(range(1, len(acknowledged) + 1))
    num_breaks = sum(row.count("break") for row in deeds)
    wanted = sum(row.count("store") for row in deeds)
    assert wanted - num_breaks * (max_members - 1) <= len(acknowledged) <= wanted
    turns.database.close()


def test_the_data_of_a_study_are_the_same_however_commits_are_shared(turns: Turns) -> None:
    """Sixteen threads in a hurry: fewer commits than turns, and no number is given twice."""
    chooser = random.Random(1)
    names = [f"{chooser.random()}" for _ in range(160)]
    at_once(16, lambda thread: [turns.add(name) for name in names[thread::16]])
    assert sorted(turns.stored().values()) == sorted(names)
    assert turns.group.num_commits < len(names)


def _told(turns: Turns, name: str, deed: Deed) -> int | None:
    """Return the number that was acknowledged, or None where an error told that nothing was stored."""
    try:
        return turns.add(name, deed)
    except (ValueError, IntegrityError, OperationalError):
        return None
