import itertools
import sqlite3
import threading
from collections import Counter
from contextlib import closing
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import Table, func, select
from sqlalchemy.exc import IntegrityError

from tests.web.bundles import read_study
from webapp.storage.database import Database
from webapp.storage.participants import (
    Enrolment,
    Mode,
    Participant,
    enrol,
    find_participant,
    find_trials,
    hash_token,
    store_page,
    withdraw,
)
from webapp.storage.tables import arrangements, pages, participants, ratings, trials
from webapp.study.questionnaire import Ratings
from webapp.study.session import NoSuchPageError, Page
from webapp.study.session import pages as all_pages

NOW = datetime(2031, 3, 1, 9, 30, 0, 17, tzinfo=UTC)
STUDY = read_study()
_NUMBERS = itertools.count()


def enrol_somebody(
    database: Database, mode: Mode = "test", version: str = "v1", cookie: str | None = None
) -> Participant:
    token_hash = hash_token(cookie or f"token {next(_NUMBERS)}")
    return enrol(database, Enrolment(STUDY, version, mode, token_hash), NOW)


def send(database: Database, participant: Participant, number: int, rating: int = 3) -> str:
    page = all_pages(find_trials(database, participant))[number - 1]
    return store_page(database, participant, page, f"{participant.id} {number}", answers_to(page, rating), NOW)


def answers_to(page: Page, rating: int = 3) -> Ratings | None:
    items = [item.id for item in STUDY.experiments[0].items]
    return Ratings(dict.fromkeys(items, rating), dict.fromkeys(items)) if page.kind == "rating" else None


def count(database: Database, table: Table) -> int:
    with database.read() as connection:
        return connection.execute(select(func.count()).select_from(table)).scalar_one()


def uses(database: Database, mode: Mode = "test") -> dict[str, Counter[int]]:
    query = select(arrangements.c.experiment, arrangements.c.arrangement).join(participants)
    found = {experiment.id: Counter[int]() for experiment in STUDY.experiments}
    with database.read() as connection:
        for experiment, arrangement in connection.execute(query.where(participants.c.mode == mode)):
            found[experiment][arrangement] += 1
    return found


def test_a_consent_stores_the_participant_with_arrangements_and_trials(database: Database) -> None:
    participant = enrol_somebody(database)
    planned = find_trials(database, participant)
    assert (participant.num_stored, participant.num_pages) == (0, len(all_pages(planned)))
    for experiment in STUDY.experiments:
        own = [trial for trial in planned if trial.experiment == experiment.id]
        assert tuple(trial.layout for trial in own) == experiment.layouts
        assert {trial.kind for trial in own} == set(experiment.kinds)
    assert find_participant(database, participant.token_hash) == participant


def test_every_arrangement_is_used_equally_often_after_every_consent(database: Database) -> None:
    for num_consents in range(1, 14):
        enrol_somebody(database)
        found = uses(database)
        for experiment, num_arrangements in (("1", 6), ("2", 2)):
            counts = [found[experiment][arrangement] for arrangement in range(num_arrangements)]
            assert sum(counts) == num_consents
            assert max(counts) - min(counts) <= 1


def test_test_runs_and_other_versions_use_up_nothing(database: Database) -> None:
    # Three are half of the arrangements: were they counted, the six that follow would hardly ever be all different.
    for _ in range(3):
        enrol_somebody(database, mode="test", version="v1")
        enrol_somebody(database, mode="live", version="v0")
        enrol_somebody(database, mode="bot", version="v2")
    others: tuple[tuple[Mode, str], ...] = (("live", "v1"), ("test", "v0"), ("live", "v2"))
    for mode, version in others:
        own = {enrol_somebody(database, mode=mode, version=version).id for _ in range(6)}
        query = select(arrangements.c.arrangement).where(arrangements.c.participant_id.in_(own))
        with database.read() as connection:
            found = connection.execute(query.where(arrangements.c.experiment == "1")).scalars().all()
        assert sorted(found) == [0, 1, 2, 3, 4, 5]


def test_fifty_simultaneous_consents_stay_balanced(database: Database) -> None:
    barrier = threading.Barrier(50)

    def agree() -> None:
        barrier.wait()
        enrol_somebody(database)

    threads = [threading.Thread(target=agree) for _ in range(50)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for experiment, num_arrangements in (("1", 6), ("2", 2)):
        counts = [uses(database)[experiment][arrangement] for arrangement in range(num_arrangements)]
        assert sum(counts) == 50
        assert max(counts) - min(counts) <= 1


def test_the_same_token_enrols_once(database: Database) -> None:
    assert enrol_somebody(database, cookie="mine") == enrol_somebody(database, cookie="mine")
    assert count(database, participants) == 1
    assert count(database, trials) == 5


def test_draws_belong_to_the_random_kind_and_differ_between_participants(database: Database) -> None:
    draws = set()
    for _ in range(40):
        for trial in find_trials(database, enrol_somebody(database)):
            assert (trial.draw is not None) == (trial.kind == "random")
            draws |= {trial.draw} - {None}
    assert len(draws) > 5
    assert draws <= set(range(10))


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


def test_the_last_page_completes(database: Database) -> None:
    participant = enrol_somebody(database)
    for number in range(1, 11):
        send(database, participant, number)
    before = find_participant(database, participant.token_hash)
    assert before is not None
    assert before.completed_at is None
    send(database, participant, 11)
    after = find_participant(database, participant.token_hash)
    assert after is not None
    assert after.completed_at == NOW


def test_a_page_that_does_not_exist_is_no_page(database: Database) -> None:
    participant = enrol_somebody(database)
    with pytest.raises(NoSuchPageError):
        store_page(database, participant, Page(12, "instructions", None), "n", None, NOW)


def test_a_rating_page_without_ratings_is_refused(database: Database) -> None:
    participant = enrol_somebody(database)
    rating_page = all_pages(find_trials(database, participant))[2]
    with pytest.raises(ValueError, match="ratings belong to rating pages"):
        store_page(database, participant, rating_page, "n", None, NOW)


def test_a_page_is_stored_whole_or_not_at_all(database: Database) -> None:
    participant = enrol_somebody(database)
    send(database, participant, 1)
    send(database, participant, 2)
    page = all_pages(find_trials(database, participant))[2]
    answers = Ratings({"likeliness": 3, "loveliness": 99}, {"likeliness": None, "loveliness": None})
    with pytest.raises(IntegrityError):
        store_page(database, participant, page, "n", answers, NOW)
    assert count(database, pages) == 2
    assert count(database, ratings) == 0
    assert send(database, participant, 3) == "accept"


def test_of_simultaneous_answers_to_one_page_one_is_stored_whole(database: Database) -> None:
    participant = enrol_somebody(database)
    send(database, participant, 1)
    send(database, participant, 2)
    page = all_pages(find_trials(database, participant))[2]
    barrier, outcomes = threading.Barrier(8), Counter[str]()

    def answer(rating: int) -> None:
        barrier.wait()
        outcomes[store_page(database, participant, page, "nonce", answers_to(page, rating), NOW)] += 1

    threads = [threading.Thread(target=answer, args=(1 + number % 5,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes == {"accept": 1, "already_answered": 7}
    with database.read() as connection:
        values = connection.execute(select(ratings.c.rating)).scalars().all()
    assert len(values) == 3
    assert len(set(values)) == 1


def test_whoever_left_stores_nothing_more(database: Database) -> None:
    participant = enrol_somebody(database)
    send(database, participant, 1)
    withdraw(database, participant, NOW)
    withdraw(database, participant, NOW + timedelta(hours=1))
    assert send(database, participant, 2) == "withdrawn"
    gone = find_participant(database, participant.token_hash)
    assert gone is not None
    assert (gone.withdrawn_at, gone.num_stored) == (NOW, 1)


def test_whoever_finished_cannot_leave_any_more(database: Database) -> None:
    participant = enrol_somebody(database)
    for number in range(1, 12):
        send(database, participant, number)
    withdraw(database, participant, NOW)
    stored = find_participant(database, participant.token_hash)
    assert stored is not None
    assert stored.withdrawn_at is None


@pytest.mark.parametrize("table", ["arrangements", "trials", "pages", "ratings"])
def test_what_was_answered_never_changes_and_stays_unless_the_participant_withdrew(
    database: Database, table: str
) -> None:
    staying, leaving = enrol_somebody(database), enrol_somebody(database)
    for participant in (staying, leaving):
        for number in (1, 2, 3):
            send(database, participant, number)
    withdraw(database, leaving, NOW)
    with closing(sqlite3.connect(database.path)) as connection:
        update = f"UPDATE {table} SET participant_id = participant_id WHERE participant_id = ?"  # noqa: S608
        for participant in (staying, leaving):
            with pytest.raises(sqlite3.IntegrityError, match="never change"):
                connection.execute(update, (participant.id,))
        delete = f"DELETE FROM {table} WHERE participant_id = ?"  # noqa: S608
        with pytest.raises(sqlite3.IntegrityError, match="stay"):
            connection.execute(delete, (staying.id,))
        assert connection.execute(delete, (leaving.id,)).rowcount > 0


def test_times_without_a_zone_are_refused(database: Database) -> None:
    enrolment = Enrolment(STUDY, "v1", "test", hash_token("any"))
    with pytest.raises(Exception, match="no time zone"):
        enrol(database, enrolment, datetime(2031, 1, 1))  # noqa: DTZ001 - that is the point
    assert count(database, participants) == 0
