"""What exactly is stored of a page, an attempt and an action, and what is told of it; and whose it is."""

from datetime import timedelta

import pytest
from sqlalchemy import select

from tests.unit.storage.people import (
    DRIVING,
    NOW,
    content_of,
    drive,
    enrol_somebody,
    pages_of,
    prediction,
    send,
    walk_to,
)
from webapp.storage.answers import (
    drive_actions,
    last_answers,
    num_attempts,
    store_last_step,
    store_page,
    store_step,
)
from webapp.storage.database import Database
from webapp.storage.helping import restart_page
from webapp.storage.participants import Participant, find_participant
from webapp.storage.records import Action, told_by
from webapp.storage.restarts import Restart, latest_restart, read_restarts
from webapp.storage.tables import answers, drive_steps, drives, pages, participants, ratings, record_contents, records
from webapp.study.answers import Answer, DriveResult, DriveStep, PageContent
from webapp.study.questionnaire import Ratings
from webapp.study.session import Page

LATER = NOW + timedelta(minutes=3)


@pytest.fixture
def person(database: Database) -> Participant:
    return enrol_somebody(database, study=DRIVING)


def rows(database: Database, table: object, *columns: str) -> list[tuple[object, ...]]:
    query = select(*(table.c[name] for name in columns))  # type: ignore[attr-defined]
    with database.read() as connection:
        return [tuple(row) for row in connection.execute(query)]


def told(database: Database, *actions: Action) -> list[tuple[object, ...]]:
    """Action, time, actor, participant, page and part of each record, and the data it belongs to."""
    about, head = record_contents.c, records.c
    query = (
        select(head.action, head.at, head.actor, about.participant_id, about.page_number, about.part, head.mode)
        .join(record_contents, about.number == head.number)
        .where(head.action.in_(actions))
        .order_by(head.number)
    )
    with database.read() as connection:
        return [tuple(row) for row in connection.execute(query)]


def anew(database: Database, person: Participant) -> Participant:
    found = find_participant(database, person.token_hash)
    assert found is not None
    return found


def attempt(number: int, answer: str = "key", *, is_final: bool = False) -> PageContent:
    return PageContent(answers=[Answer("goal", answer, is_correct=False)], attempt=number, is_final=is_final)


def test_a_page_is_stored_with_its_nonce_its_time_and_its_place(database: Database, person: Participant) -> None:
    page = walk_to(database, person, "rating", DRIVING)
    content = content_of(page, study=DRIVING)
    assert store_page(database, person, page, "the nonce", content, LATER) == "accept"
    found = rows(database, pages, "participant_id", "number", "kind", "trial_number", "nonce", "submitted_at")
    assert found[-1] == (person.id, page.number, "rating", 1, "the nonce", LATER)
    assert told(database, "sent")[-1] == ("sent", LATER, "participant", person.id, page.number, None, "test")
    assert rows(database, participants, "last_seen_at", "completed_at", "screened_out_at") == [(LATER, None, None)]


def test_ratings_are_stored_each_with_its_own_time(database: Database, person: Participant) -> None:
    page = walk_to(database, person, "rating", DRIVING)
    content = content_of(page, study=DRIVING)
    assert content.ratings is not None
    items = list(content.ratings.values)
    times = (None, 700, 900, 1100)
    given = Ratings({item: 5 - place for place, item in enumerate(items)}, dict(zip(items, times, strict=False)))
    assert store_page(database, person, page, "n", PageContent(ratings=given), LATER) == "accept"
    found = rows(database, ratings, "participant_id", "page_number", "item", "rating", "response_time_ms")
    expected = [(person.id, page.number, item, given.values[item], given.response_times[item]) for item in items]
    assert sorted(found, key=str) == sorted(expected, key=str)


def test_an_attempt_is_stored_with_its_number_and_its_time(database: Database, person: Participant) -> None:
    page = walk_to(database, person, "quiz", DRIVING)
    assert store_page(database, person, page, "n", attempt(1), LATER) == "accept"
    columns = ("participant_id", "page_number", "attempt", "question", "purpose", "answer", "submitted_at")
    assert rows(database, answers, *columns) == [(person.id, page.number, 1, "goal", "quiz", "key", LATER)]
    assert told(database, "attempted") == [("attempted", LATER, "participant", person.id, page.number, 1, "test")]
    assert rows(database, participants, "last_seen_at") == [(LATER,)]
    final = LATER + timedelta(minutes=1)
    assert store_page(database, person, page, "n", attempt(2, "flag", is_final=True), final) == "accept"
    assert told(database, "sent")[-1] == ("sent", final, "participant", person.id, page.number, 2, "test")


def test_an_attempt_without_answers_and_without_end_leaves_nothing(database: Database, person: Participant) -> None:
    page = walk_to(database, person, "quiz", DRIVING)
    before = told(database, "attempted", "sent")
    assert store_page(database, person, page, "n", PageContent(is_final=False), LATER) == "accept"
    assert told(database, "attempted", "sent") == before
    assert rows(database, answers, "attempt") == []


def test_an_action_is_stored_with_its_page_its_trial_and_its_time(database: Database, person: Participant) -> None:
    page = walk_to(database, person, "drive", DRIVING)
    for number, elapsed_ms in ((1, 350), (2, None)):
        step = DriveStep(number, f"action {number}", elapsed_ms)
        assert store_step(database, person, page, step, LATER) == "accept"
    columns = ("participant_id", "page_number", "page_kind", "trial_number", "number", "action", "elapsed_ms")
    trial = rows(database, pages, "number", "trial_number")[-1][1]
    assert rows(database, drive_steps, *columns, "received_at") == [
        (person.id, page.number, "drive", trial, 1, "action 1", 350, LATER),
        (person.id, page.number, "drive", trial, 2, "action 2", None, LATER),
    ]
    assert told(database, "acted") == [
        ("acted", LATER, "participant", person.id, page.number, number, "test") for number in (1, 2)
    ]
    assert rows(database, participants, "last_seen_at") == [(LATER,)]


def test_a_drive_ends_with_its_result_and_the_page_in_one(database: Database, person: Participant) -> None:
    page = walk_to(database, person, "drive", DRIVING)
    assert page.trial is not None
    result = DriveResult("after", page.trial.layout, "reached", 1, 7, 21, (1, 5), ())
    last = store_last_step(
        database, person, page, "nonce", DriveStep(1, "forward", 9), PageContent(drive=result), LATER
    )
    assert last == "accept"
    columns = ("page_number", "phase", "layout", "end", "num_steps", "optimum", "step_limit")
    assert rows(database, drives, *columns, "subgoals_passed", "key_points")[-1] == (
        *(page.number, "after", page.trial.layout, "reached", 1, 7, 21),
        *("1 5", ""),
    )
    assert [row[0] for row in told(database, "acted", "sent")][-2:] == ["acted", "sent"]
    assert rows(database, pages, "number", "nonce")[-1] == (page.number, "nonce")


def test_a_result_must_fit_with_the_actions_that_are_stored(database: Database, person: Participant) -> None:
    page = walk_to(database, person, "drive", DRIVING)
    assert store_step(database, person, page, DriveStep(1, "left", None), NOW) == "accept"
    for num_steps, outcome in ((0, "already_answered"), (2, "already_answered"), (1, "accept")):
        content = PageContent(drive=drive(page, num_steps=num_steps))
        assert store_page(database, person, page, "n", content, NOW) == outcome


def test_what_one_participant_does_counts_for_no_other(database: Database, person: Participant) -> None:
    other = enrol_somebody(database, study=DRIVING)
    quiz = walk_to(database, person, "quiz", DRIVING)
    walk_to(database, other, "quiz", DRIVING)
    assert store_page(database, person, quiz, "n", attempt(1), NOW) == "accept"
    assert (num_attempts(database, other, quiz.number), last_answers(database, other, quiz.number)) == (0, {})
    assert store_page(database, other, quiz, "n", attempt(1, "flag"), NOW) == "accept"
    assert last_answers(database, person, quiz.number)["goal"].answer == "key"
    for somebody in (person, other):
        assert store_page(database, somebody, quiz, f"n {somebody.id}", attempt(2, is_final=True), NOW) == "accept"
    mine, theirs = (walk_on(database, somebody, "drive") for somebody in (person, other))
    assert store_step(database, person, mine, DriveStep(1, "left", None), LATER) == "accept"
    assert drive_actions(database, other, theirs.number) == ()
    assert store_step(database, other, theirs, DriveStep(2, "left", None), LATER) == "too_early"
    assert store_step(database, other, theirs, DriveStep(1, "right", None), LATER) == "accept"
    assert drive_actions(database, person, mine.number) == ("left",)


def walk_on(database: Database, person: Participant, kind: str) -> Page:
    """Go on to the first page of a kind."""
    page = next(page for page in pages_from(database, person) if page.kind == kind)
    for number in range(anew(database, person).num_stored + 1, page.number):
        assert send(database, person, number, study=DRIVING) == "accept"
    return page


def pages_from(database: Database, person: Participant) -> list[Page]:
    return [page for page in pages_of(database, person, DRIVING) if page.number > anew(database, person).num_stored]


def test_what_was_done_on_one_page_counts_on_no_other(database: Database, person: Participant) -> None:
    practice = walk_to(database, person, "practice", DRIVING)
    for number in (1, 2):
        assert store_step(database, person, practice, DriveStep(number, "left", None), NOW) == "accept"
    ended = PageContent(drive=drive(practice, num_steps=2))
    assert store_page(database, person, practice, "n", ended, NOW) == "accept"
    page = walk_on(database, person, "drive")
    assert drive_actions(database, person, page.number) == ()
    assert store_step(database, person, page, DriveStep(1, "right", None), NOW) == "accept"
    assert drive_actions(database, person, practice.number) == ("left", "left")


def test_the_last_answers_of_a_page_are_those_of_no_other(database: Database, person: Participant) -> None:
    about = PageContent(answers=[Answer("age", "44")])
    assert send(database, person, 1, study=DRIVING, content=about) == "accept"
    quiz = walk_on(database, person, "quiz")
    assert store_page(database, person, quiz, "n", attempt(1), NOW) == "accept"
    assert last_answers(database, person, 1) == {"age": Answer("age", "44")}
    assert last_answers(database, person, quiz.number) == {"goal": Answer("goal", "key", is_correct=False)}


def test_a_page_begun_anew_is_known_by_its_latest_beginning(database: Database, person: Participant) -> None:
    page = walk_to(database, person, "quiz", DRIVING)
    with database.read() as connection:
        assert latest_restart(connection, person.id, page.number) == Restart(person.id, page.number, 0, 0, 0)
        assert read_restarts(connection, anew(database, person)) == {}
    for number in (1, 2, 3):
        assert store_page(database, person, page, "n", attempt(1), NOW) == "accept"
        restart_page(database, person.code, page.number, "a reason", "boss", NOW)
        with database.read() as connection:
            latest = latest_restart(connection, person.id, page.number)
            assert read_restarts(connection, anew(database, person)) == {page.number: number}
        assert latest == Restart(person.id, page.number, number, 0, number)
    other = enrol_somebody(database, study=DRIVING)
    with database.read() as connection:
        assert latest_restart(connection, other.id, page.number) == Restart(other.id, page.number, 0, 0, 0)
        assert latest_restart(connection, person.id, page.number + 1) == Restart(person.id, page.number + 1, 0, 0, 0)
        assert read_restarts(connection, anew(database, other)) == {}


@pytest.mark.parametrize(
    ("kind", "content", "words"),
    [
        ("rating", PageContent(), "^ratings belong to rating pages and to no others, and this is 'rating'$"),
        ("drive", PageContent(), "^a drive's result belongs to its page and to no other, and this is 'drive'$"),
        ("probe", PageContent(), "^predictions belong to probe pages and to no others, and this is 'probe'$"),
        ("quiz", PageContent(predictions=[prediction(1)]), "predictions belong .* and this is 'quiz'$"),
    ],
)
def test_content_of_another_kind_of_page_is_refused_in_words(
    database: Database, person: Participant, kind: str, content: PageContent, words: str
) -> None:
    page = walk_to(database, person, kind, DRIVING)
    with pytest.raises(ValueError, match=words):
        store_page(database, person, page, "n", content, NOW)


def test_who_comes_back_late_is_on_record_once_with_the_place(database: Database, person: Participant) -> None:
    late = NOW + timedelta(minutes=DRIVING.lease_minutes + 1)
    with database.write() as connection:
        connection.execute(participants.update().values(slot_released_at=LATER))
    assert send(database, anew(database, person), 1, study=DRIVING, now=late) == "accept"
    assert send(database, anew(database, person), 2, study=DRIVING, now=late) == "accept"
    with database.read() as connection:
        (allocated,) = told_by(connection, "allocated")
        (resumed,) = told_by(connection, "slot_resumed")
    assert (resumed[1], resumed[2], resumed[4], resumed[-1]) == (late, "system", person.id, {"slot": allocated[0]})
    assert rows(database, participants, "slot_released_at", "returned_late_at") == [(None, late)]
