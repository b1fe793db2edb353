"""A page that is stored without another look at its participant: only where nothing changed since the first look."""

from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta

import pytest
from sqlalchemy import event, select, update

from tests.unit.storage.people import (
    DRIVING,
    NOW,
    content_of,
    count,
    drive,
    enrol_somebody,
    page_of_kind,
    pages_of,
    send,
    walk,
)
from webapp.storage.answers import store_page
from webapp.storage.contents import as_stored
from webapp.storage.database import Database, UnavailableError
from webapp.storage.enrolment import Enrolment, enrol
from webapp.storage.erasure import erase
from webapp.storage.helping import release_page, restart_page
from webapp.storage.participants import Participant, find_participant, withdraw
from webapp.storage.tables import answers, pages, participants, ratings, records
from webapp.storage.verification import verify_log
from webapp.study.answers import Answer, Event, PageContent
from webapp.study.recruitment import Recruit
from webapp.study.session import Page

LATER = NOW + timedelta(minutes=3)


def anew(database: Database, person: Participant) -> Participant:
    found = find_participant(database, person.token_hash)
    assert found is not None
    return found


def at_a_plain_page(database: Database) -> tuple[Participant, Page]:
    """Somebody as read just now, and the page they are at."""
    person = enrol_somebody(database)
    walk(database, person, 2)
    fresh = anew(database, person)
    return fresh, pages_of(database, person)[fresh.num_stored]


def walk_on_to(database: Database, person: Participant, kind: str) -> Page:
    """Send all pages that are due before the first one of a kind, and return that page."""
    page = page_of_kind(database, person, kind, DRIVING)
    for number in range(anew(database, person).num_stored + 1, page.number):
        assert send(database, person, number, study=DRIVING) == "accept"
    return page


def store(database: Database, person: Participant, page: Page, nonce: str = "a nonce") -> str:
    return store_page(database, person, page, nonce, content_of(page), LATER)


def test_somebody_as_far_as_when_they_were_read_is_not_read_again(database: Database) -> None:
    person, page = at_a_plain_page(database)
    asked: list[str] = []
    with database.write() as connection:
        engine = connection.engine
    event.listen(engine, "before_cursor_execute", lambda _c, _cursor, statement, *_: asked.append(statement))
    assert store(database, person, page) == "accept"
    assert not [statement for statement in asked if "participants.token_hash" in statement]
    assert [statement for statement in asked if statement.startswith("UPDATE participants")]
    after = anew(database, person)
    assert after.num_stored == person.num_stored + 1
    with database.read() as connection:
        seen = connection.execute(select(participants.c.last_seen_at).where(participants.c.id == person.id)).scalar()
    assert seen == LATER


def _another_window(database: Database, person: Participant) -> str:
    page = pages_of(database, person)[person.num_stored]
    assert store(database, person, page, "another nonce") == "accept"
    return "already_answered"


def _leaves(database: Database, person: Participant) -> str:
    withdraw(database, person, NOW)
    return "ended"


def _is_screened_out(database: Database, person: Participant) -> str:
    with database.write() as connection:
        connection.execute(update(participants).where(participants.c.id == person.id).values(screened_out_at=NOW))
    return "ended"


def _is_erased(database: Database, person: Participant) -> str:
    erase(database, person.code, "researcher", NOW)
    return "ended"


def _is_erased_and_somebody_has_the_number(database: Database, person: Participant) -> str:
    """SQLite gives the number of the last row again once that is gone."""
    erase(database, person.code, "researcher", NOW)
    other = enrol_somebody(database)
    walk(database, other, person.num_stored)
    object.__setattr__(person, "id", other.id)
    return "ended"


def _is_released(database: Database, person: Participant) -> str:
    page = pages_of(database, person)[person.num_stored]
    release_page(database, person.code, page, "stuck", "researcher", NOW)
    return "already_answered"


@pytest.mark.parametrize(
    "happens",
    [
        _another_window,
        _leaves,
        _is_screened_out,
        _is_erased,
        _is_erased_and_somebody_has_the_number,
        _is_released,
    ],
)
def test_what_happened_since_they_were_read_counts(
    database: Database, happens: Callable[[Database, Participant], str]
) -> None:
    person, page = at_a_plain_page(database)
    expected = happens(database, person)
    before = count(database, pages), count(database, ratings), count(database, records)
    assert store(database, person, page) == expected
    assert (count(database, pages), count(database, ratings), count(database, records)) == before


def test_a_page_begun_anew_meanwhile_is_stored_as_such(database: Database) -> None:
    person, page = at_a_plain_page(database)
    restart_page(database, person.code, page.number, "stuck", "researcher", NOW)
    assert store(database, person, page) == "accept"
    assert anew(database, person).has_restarts
    assert verify_log(database).problems == ()


def test_the_place_of_somebody_given_back_meanwhile_counts_again(database: Database) -> None:
    person, page = at_a_plain_page(database)
    with database.write() as connection:
        connection.execute(update(participants).where(participants.c.id == person.id).values(slot_released_at=NOW))
    assert store(database, person, page) == "accept"
    assert anew(database, person).slot_released_at is None


def test_pages_that_are_counted_within_are_looked_at_closely(database: Database) -> None:
    """What is right for the page before it is stored, and what another window did on it, matters for these."""
    person = enrol_somebody(database, study=DRIVING)
    for kind in ("background", "quiz", "first_drive"):
        page = walk_on_to(database, person, kind)
        fresh = anew(database, person)
        if kind == "first_drive":
            taken = replace(content_of(page, study=DRIVING), drive=drive(page, num_steps=2))
            assert store_page(database, fresh, page, f"nonce {kind}", taken, LATER) == "already_answered"
            continue
        early = PageContent(answers=[Answer("goal", "key", is_correct=False)], attempt=2)
        assert store_page(database, fresh, page, f"nonce {kind}", early, LATER) == "already_answered"
        first = replace(early, attempt=1, is_final=False)
        assert store_page(database, fresh, page, f"nonce {kind}", first, LATER) == "accept"
        assert anew(database, person).num_stored == fresh.num_stored
        assert store_page(database, fresh, page, f"nonce {kind}", early, LATER) == "accept"
    assert count(database, answers) == 4
    assert verify_log(database).problems == ()


def test_only_the_page_they_are_at_is_stored(database: Database) -> None:
    person, page = at_a_plain_page(database)
    before, after = (pages_of(database, person)[page.number - 1 + step] for step in (-1, 1))
    assert store(database, person, before) == "already_answered"
    assert store(database, person, after) == "too_early"
    assert store_page(database, person, page, "a nonce", replace(content_of(page), is_final=False), LATER) == "accept"
    assert anew(database, person).num_stored == person.num_stored


def test_the_last_page_completes_without_another_look(database: Database) -> None:
    person = enrol_somebody(database)
    walk(database, person, person.num_pages - 1)
    fresh = anew(database, person)
    assert store(database, fresh, pages_of(database, person)[-1]) == "accept"
    assert anew(database, person).completed_at == LATER


def test_everything_is_recorded_as_it_stands_in_the_tables(database: Database) -> None:
    """On every kind of page, with whatever can stand on it: rows as they were inserted and as they are read."""
    recruit = Recruit("prolific", "5f7c6b1a2e3d4c5b6a798081", "study", "session")
    person = enrol(database, Enrolment(DRIVING, "v1", "test", "hash", "en", recruit=recruit), NOW)
    log = [Event("focus", "item-ü", "", 5), Event("blur", "item", "7", 3)]
    for page in pages_of(database, person, DRIVING):
        content = replace(content_of(page, study=DRIVING), events=log)
        fresh = anew(database, person)
        assert store_page(database, fresh, page, f"nonce {page.number}", content, LATER) == "accept"
    assert verify_log(database).problems == ()


def test_rows_are_told_whole_and_in_order() -> None:
    told = as_stored(ratings, [{"page_number": 3, "item": name, "rating": 2} for name in ("b", "é", "Z", "a")])
    assert [row["item"] for row in told] == ["Z", "a", "b", "é"]
    assert {tuple(row) for row in told} == {("page_number", "item", "rating", "response_time_ms")}


@pytest.mark.sqlite_only(reason="PostgreSQL has a test of its own")
def test_nobody_is_told_that_something_is_stored_after_the_transaction_has_ended(database: Database) -> None:
    """SQLite undoes a transaction by itself after some errors, such as those of a full disk."""
    person, page = at_a_plain_page(database)

    def go_on_after_the_end() -> None:
        with database.write() as connection:
            driver = connection.connection.driver_connection
            assert driver is not None
            driver.rollback()

    with pytest.raises(UnavailableError):
        go_on_after_the_end()
    assert store(database, person, page) == "accept"
