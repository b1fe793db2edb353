"""Attempts at the quiz: those that fail leave the page due, or end the study."""

from datetime import timedelta

from sqlalchemy import select

from tests.unit.storage.people import DRIVING, NOW, at_once, count, enrol_somebody, send, walk_to
from webapp.storage.answers import last_answers, num_attempts, store_page
from webapp.storage.database import Database
from webapp.storage.participants import Participant, find_participant
from webapp.storage.tables import answers, events, pages, participants
from webapp.study.answers import Answer, Event, PageContent

WRONG = PageContent(answers=[Answer("goal", "key", is_correct=False)], attempt=1, is_final=False)
RIGHT = PageContent(answers=[Answer("goal", "flag", is_correct=True)], attempt=2)


def stored(database: Database, participant: Participant) -> Participant:
    found = find_participant(database, participant.token_hash)
    assert found is not None
    return found


def test_a_failed_attempt_is_stored_and_leaves_the_page_due(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "quiz", DRIVING)
    assert num_attempts(database, participant, page.number) == 0
    assert last_answers(database, participant, page.number) == {}
    later = NOW + timedelta(minutes=5)
    assert store_page(database, participant, page, "first", WRONG, later) == "accept"
    assert num_attempts(database, participant, page.number) == 1
    assert last_answers(database, participant, page.number) == {"goal": WRONG.answers[0]}
    assert stored(database, participant).num_stored == page.number - 1
    with database.read() as connection:
        assert connection.execute(select(pages.c.number).where(pages.c.kind == "quiz")).all() == []
    assert send(database, participant, page.number + 1, study=DRIVING) == "too_early"
    assert store_page(database, participant, page, "second", RIGHT, NOW) == "accept"
    assert last_answers(database, participant, page.number) == {"goal": RIGHT.answers[0]}
    assert send(database, participant, page.number + 1, study=DRIVING) == "accept"


def test_attempts_keep_their_order_and_what_was_right_in_them(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "quiz", DRIVING)
    for content in (WRONG, RIGHT):
        store_page(database, participant, page, "n", content, NOW)
    columns = answers.c.attempt, answers.c.purpose, answers.c.question, answers.c.answer, answers.c.is_correct
    with database.read() as connection:
        rows = connection.execute(select(*columns).order_by(answers.c.attempt)).all()
    assert [tuple(row) for row in rows] == [(1, "quiz", "goal", "key", False), (2, "quiz", "goal", "flag", True)]


def test_an_attempt_that_is_sent_twice_is_stored_once(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "quiz", DRIVING)
    other = PageContent(answers=[Answer("goal", "door", is_correct=False)], attempt=1, is_final=False)
    outcomes = [store_page(database, participant, page, "n", content, NOW) for content in (WRONG, WRONG, other)]
    assert outcomes == ["accept", "already_answered", "already_answered"]
    assert last_answers(database, participant, page.number) == {"goal": WRONG.answers[0]}
    assert count(database, answers) == 1


def test_of_simultaneous_attempts_one_is_stored(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "quiz", DRIVING)
    outcomes = at_once(8, lambda _: store_page(database, participant, page, "n", WRONG, NOW))
    assert sorted(outcomes) == ["accept"] + ["already_answered"] * 7
    assert num_attempts(database, participant, page.number) == 1


def test_an_attempt_that_is_not_due_yet_is_not_stored(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "quiz", DRIVING)
    assert store_page(database, participant, page, "n", RIGHT, NOW) == "already_answered"
    assert count(database, answers) == 0


def test_a_failed_attempt_has_no_events(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "quiz", DRIVING)
    content = PageContent(answers=WRONG.answers, is_final=False, events=[Event("painted", "", "", 0)])
    assert store_page(database, participant, page, "n", content, NOW) == "accept"
    assert count(database, events) == 0


def test_screening_out_stores_the_page_and_ends_the_study_without_completing_it(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "quiz", DRIVING)
    failed = PageContent(answers=WRONG.answers, failed=True, screens_out=True)
    assert send(database, participant, page.number, study=DRIVING, content=failed) == "accept"
    gone = stored(database, participant)
    assert (gone.screened_out_at, gone.completed_at, gone.withdrawn_at) == (NOW, None, None)
    assert gone.num_stored == page.number
    for number in (page.number, page.number + 1):
        assert send(database, participant, number, study=DRIVING) == "ended"
    assert stored(database, participant) == gone


def test_whoever_sent_something_was_seen_then(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "quiz", DRIVING)
    later = NOW + timedelta(hours=2)
    store_page(database, participant, page, "n", WRONG, later)
    with database.read() as connection:
        assert connection.execute(select(participants.c.last_seen_at)).scalar_one() == later
