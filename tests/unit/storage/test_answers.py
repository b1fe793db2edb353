import threading

import pytest
from sqlalchemy import select
from sqlalchemy.exc import IntegrityError

from tests.unit.storage.people import (
    DRIVING,
    NOW,
    STUDY,
    at_once,
    content_of,
    count,
    drive,
    enrol_somebody,
    page_of_kind,
    pages_of,
    prediction,
    ratings_of,
    send,
    walk,
    walk_to,
)
from webapp.storage.answers import store_page
from webapp.storage.database import Database
from webapp.storage.participants import Participant, find_participant, withdraw
from webapp.storage.tables import answers, events, pages, predictions, ratings, trials
from webapp.study.answers import Answer, Event, PageContent
from webapp.study.protocol import Study
from webapp.study.session import NoSuchPageError, Page


def stored(database: Database, participant: Participant) -> Participant:
    found = find_participant(database, participant.token_hash)
    assert found is not None
    return found


def test_pages_are_stored_in_order_and_once(database: Database) -> None:
    participant = enrol_somebody(database)
    assert send(database, participant, 2) == "too_early"
    for number in range(1, participant.num_pages + 1):
        assert send(database, participant, number) == "accept"
        assert send(database, participant, number, rating=5) == "already_answered"
    assert count(database, pages) == participant.num_pages == 11
    with database.read() as connection:
        assert set(connection.execute(select(ratings.c.rating)).scalars()) == {3}
    assert count(database, ratings) == 5 * 3


@pytest.mark.parametrize("study", [STUDY, DRIVING], ids=lambda study: study.name)
def test_the_last_page_completes(database: Database, study: Study) -> None:
    participant = enrol_somebody(database, study=study)
    walk(database, participant, participant.num_pages - 1, study=study)
    assert stored(database, participant).completed_at is None
    send(database, participant, participant.num_pages, study=study)
    assert stored(database, participant).completed_at == NOW


def test_each_page_of_a_trial_knows_its_trial_and_no_other_does(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    walk(database, participant, participant.num_pages, study=DRIVING)
    query = (
        select(pages.c.number, trials.c.experiment, trials.c.position)
        .outerjoin(
            trials, (trials.c.participant_id == pages.c.participant_id) & (trials.c.number == pages.c.trial_number)
        )
        .order_by(pages.c.number)
    )
    with database.read() as connection:
        found = [tuple(row) for row in connection.execute(query)]
    expected = [
        (page.number, page.trial and page.trial.experiment, page.trial and page.trial.position)
        for page in pages_of(database, participant, DRIVING)
    ]
    assert found == expected


def test_a_page_that_does_not_exist_is_no_page(database: Database) -> None:
    participant = enrol_somebody(database)
    with pytest.raises(NoSuchPageError):
        store_page(database, participant, Page(12, "instructions", None), "n", PageContent(), NOW)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("instructions", None),
        ("practice", "a drive's result belongs to its page"),
        ("rating", "ratings belong to rating pages"),
        ("probe", "predictions belong to probe pages"),
        ("drive", "a drive's result belongs to its page"),
    ],
)
def test_a_page_without_its_own_content_or_with_that_of_another_is_refused(
    database: Database, kind: str, message: str | None
) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, kind, DRIVING)
    before = count(database, pages)
    if message is not None:
        with pytest.raises(ValueError, match=message):
            store_page(database, participant, page, "n", PageContent(), NOW)
    foreign = (
        PageContent(ratings=ratings_of(["likeliness"], 3)),
        PageContent(predictions=[prediction(1)]),
        PageContent(drive=drive(page_of_kind(database, participant, "drive", DRIVING))),
    )
    for content in foreign:
        of_this_page = {"rating": foreign[0], "probe": foreign[1], "drive": foreign[2], "practice": foreign[2]}
        if content is not of_this_page.get(kind):
            with pytest.raises(ValueError, match="belong"):
                store_page(database, participant, page, "n", content, NOW)
    assert count(database, pages) == before


def test_a_page_is_stored_whole_or_not_at_all(database: Database) -> None:
    participant = enrol_somebody(database)
    page = walk_to(database, participant, "rating")
    impossible = PageContent(
        ratings=ratings_of(["likeliness", "loveliness"], 99),
        answers=[Answer("check", "2", is_correct=True)],
        events=[Event("painted", "", "", 0)],
    )
    with pytest.raises(IntegrityError):
        store_page(database, participant, page, "n", impossible, NOW)
    assert count(database, pages) == 2
    assert count(database, ratings) == count(database, answers) == count(database, events) == 0
    assert send(database, participant, 3) == "accept"


def test_of_simultaneous_answers_to_one_page_one_is_stored_whole(database: Database) -> None:
    participant = enrol_somebody(database)
    page = walk_to(database, participant, "rating")

    def answer(number: int) -> str:
        return store_page(database, participant, page, "nonce", content_of(page, 1 + number % 5), NOW)

    assert sorted(at_once(8, answer)) == ["accept"] + ["already_answered"] * 7
    with database.read() as connection:
        values = connection.execute(select(ratings.c.rating)).scalars().all()
    assert len(values) == 3
    assert len(set(values)) == 1


def test_whoever_left_stores_nothing_more(database: Database) -> None:
    participant = enrol_somebody(database)
    send(database, participant, 1)
    withdraw(database, participant, NOW)
    assert send(database, participant, 2) == "ended"
    gone = stored(database, participant)
    assert (gone.withdrawn_at, gone.num_stored) == (NOW, 1)


def test_answers_say_what_they_were_asked_for(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    said = PageContent(answers=[Answer("age", "44"), Answer("gender", "prefer_not_to_say")])
    assert send(database, participant, 1, study=DRIVING, content=said) == "accept"
    page = walk_from(database, participant, 2, "rating")
    checked = PageContent(
        ratings=content_of(page, study=DRIVING).ratings, answers=[Answer("check-a", "1", is_correct=False)]
    )
    assert send(database, participant, page.number, study=DRIVING, content=checked) == "accept"
    with database.read() as connection:
        rows = connection.execute(select(answers.c.question, answers.c.purpose, answers.c.is_correct)).all()
    assert {tuple(row) for row in rows} == {
        ("age", "background", None),
        ("gender", "background", None),
        ("check-a", "attention", False),
    }
    assert stored(database, participant).num_stored == page.number


def walk_from(database: Database, participant: Participant, first: int, kind: str) -> Page:
    page = page_of_kind(database, participant, kind, DRIVING)
    for number in range(first, page.number):
        assert send(database, participant, number, study=DRIVING) == "accept"
    return page


def test_predictions_are_stored_as_they_were_made(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, participant, "probe", DRIVING)
    made = [prediction(1, "toggle", 5, is_as_good=False), prediction(2, "left", 1)]
    assert store_page(database, participant, page, "n", PageContent(predictions=made), NOW) == "accept"
    columns = ("question", "state", "predicted", "action", "is_correct", "is_as_good", "confidence", "response_time_ms")
    with database.read() as connection:
        rows = connection.execute(select(*(predictions.c[name] for name in columns))).all()
    assert [tuple(row) for row in rows] == [tuple(getattr(entry, name) for name in columns) for entry in made]


def test_events_are_stored_in_their_order_with_any_page(database: Database) -> None:
    participant = enrol_somebody(database)
    log = [
        Event("changed", "rating-general", "4", 900),
        Event("painted", "", "", 0),
        Event("focus_lost", "", "", 86_400_000),
    ]
    assert send(database, participant, 1, content=PageContent(events=log)) == "accept"
    assert send(database, participant, 1, content=PageContent(events=log[:1])) == "already_answered"
    columns = events.c.number, events.c.event, events.c.target, events.c.value, events.c.at_ms
    with database.read() as connection:
        rows = connection.execute(select(*columns).order_by(events.c.number)).all()
    assert [tuple(row) for row in rows] == [
        (number, entry.name, entry.target, entry.value, entry.at_ms) for number, entry in enumerate(log, start=1)
    ]


def test_what_somebody_prefers_not_to_say_is_not_in_the_log_either(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    log = [Event("changed", "answer-gender", "woman", 900), Event("changed", "answer-gender", "prefer_not_to_say", 950)]
    said = PageContent(answers=[Answer("gender", "prefer_not_to_say")], events=log)
    assert send(database, participant, 1, study=DRIVING, content=said) == "accept"
    with database.read() as connection:
        rows = connection.execute(select(events.c.target, events.c.value, events.c.at_ms)).all()
    assert [tuple(row) for row in rows] == [("answer-gender", "", 900), ("answer-gender", "", 950)]


def test_threads_may_share_the_storage_with_participants_of_their_own(database: Database) -> None:
    lock, done = threading.Lock(), []

    def take_part(_: int) -> None:
        participant = enrol_somebody(database)
        walk(database, participant, 11)
        with lock:
            done.append(participant.id)

    at_once(4, take_part)
    assert len(set(done)) == 4
    assert count(database, pages) == 44
