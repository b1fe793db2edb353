"""What exactly is drawn and stored at a consent, whose places count, and what the ledger says of them."""

import hashlib
import re
from datetime import timedelta

import pytest
from sqlalchemy import select

from tests.unit.storage.people import DRIVING, NOW, STUDY, enrol_somebody, walk
from tests.unit.study.test_counterbalancing import Sketch, letters, sketch
from webapp.storage.database import Database
from webapp.storage.enrolment import AlreadyTookPartError, Enrolment, StudyFullError, enrol
from webapp.storage.participants import hash_token, withdraw
from webapp.storage.records import Action, told_by
from webapp.storage.scope import Scope
from webapp.storage.tables import participants, records, trials
from webapp.study import counterbalancing
from webapp.study.counterbalancing import arrangements, choose_least_used
from webapp.study.draws import Draws
from webapp.study.experiments import BUILT_IN_KINDS
from webapp.study.protocol import Study
from webapp.study.recruitment import Recruit

LATER = NOW + timedelta(minutes=STUDY.lease_minutes + 1)
CODE = re.compile(r"[2-9a-hjkmnp-tv-z]{10}")


def by_the_book(word: str, number: int, stop: int) -> int:
    """The number that a word gives, as the documentation defines it."""
    return int.from_bytes(hashlib.sha256(f"{word} {number}".encode()).digest(), "big") % stop


def arrive(database: Database, name: str, study: Study, version: str = "v1") -> None:
    enrol(database, Enrolment(study, version, "live", hash_token(name), "en"), NOW)


def test_draws_are_those_that_the_documentation_defines() -> None:
    draws = Draws("a word")
    assert [draws.randrange(1000) for _ in range(9)] == [by_the_book("a word", number, 1000) for number in range(9)]
    again, letters_of = Draws("a word"), "abcdefg"
    assert [again.choice(letters_of) for _ in range(9)] == [letters_of[by_the_book("a word", n, 7)] for n in range(9)]


def test_of_nothing_nothing_can_be_drawn_and_of_one_thing_that_one() -> None:
    with pytest.raises(ValueError, match=r"^there are no arrangements to choose from$"):
        choose_least_used([], Draws("a word"))
    with pytest.raises(IndexError):
        Draws("a word").choice(())
    assert Draws("a word").choice(("it",)) == "it"
    assert Draws("a word").randrange(1) == 0


def test_what_an_index_in_the_data_means_never_changes() -> None:
    """Stored are indices; another order of the same rows would give every stored participant another arrangement."""
    counterbalancing._patterns.cache_clear()
    assert letters(sketch(5, 5)).split()[:3] == ["abecd", "bcade", "cdbea"]
    assert letters(sketch(3, 2)) == "ab ac ba bc ca cb"


def test_up_to_twenty_four_arrangements_are_all_listed_and_more_are_rows_of_a_square() -> None:
    for num_kinds, num_arrangements in ((23, 23), (24, 24), (25, 50)):
        kinds = tuple(f"kind-{number}" for number in range(num_kinds))
        assert len(arrangements(Sketch(kinds, ("one",)))) == num_arrangements


def test_a_design_of_any_size_has_its_arrangements() -> None:
    large = Sketch(BUILT_IN_KINDS[:3], tuple(map(str, range(900))))
    assert {len(arrangement) for arrangement in arrangements(large)} == {900}


def test_codes_and_salts_are_as_random_as_they_have_to_be(database: Database) -> None:
    for _ in range(20):
        enrol_somebody(database)
    with database.read() as connection:
        rows = connection.execute(select(participants.c.code, participants.c.salt)).all()
        words = [row[-1]["word"] for row in told_by(connection, "allocated")]
    assert [code for code, _ in rows if not CODE.fullmatch(code)] == []
    assert [salt for _, salt in rows if not re.fullmatch(r"[0-9a-f]{32}", salt)] == []
    assert [word for word in words if not re.fullmatch(r"[0-9a-f]{64}", word)] == []
    assert [len({*column}) for column in (*zip(*rows, strict=True), words)] == [20, 20, 20]


@pytest.mark.parametrize("study", [STUDY, DRIVING], ids=lambda study: study.name)
def test_trials_are_numbered_from_one(database: Database, study: Study) -> None:
    enrol_somebody(database, study=study)
    with database.read() as connection:
        numbers = connection.execute(select(trials.c.number).order_by(trials.c.number)).scalars().all()
    assert list(numbers) == list(range(1, len(numbers) + 1))


def test_recruits_of_one_service_are_told_apart_by_their_ids(database: Database) -> None:
    for number in range(3):
        enrol_somebody(database, recruit=Recruit("prolific", f"{number:024x}"))
    with pytest.raises(AlreadyTookPartError, match=r"^whom the recruiter sent takes part already$"):
        enrol_somebody(database, recruit=Recruit("prolific", f"{1:024x}"))


def test_a_full_study_says_how_many_places_there_are(database: Database) -> None:
    one = STUDY.model_copy(update={"quota": 1})
    arrive(database, "first", one)
    with pytest.raises(StudyFullError, match=r"^1 places are taken, as many as there are$"):
        arrive(database, "second", one)


def test_those_who_left_were_screened_out_or_are_of_another_study_take_no_place(database: Database) -> None:
    one = STUDY.model_copy(update={"quota": 1})
    arrive(database, "another study", DRIVING)
    arrive(database, "screened out", one)
    with database.write() as connection:
        connection.execute(participants.update().where(participants.c.study == one.name).values(screened_out_at=NOW))
    arrive(database, "leaver", one, "v2")
    withdraw(database, enrol(database, Enrolment(one, "v2", "live", hash_token("leaver"), "en"), NOW), NOW)
    arrive(database, "third", one, "v3")
    with pytest.raises(StudyFullError):
        arrive(database, "fourth", one, "v4")


def test_the_place_of_somebody_who_finished_counts_for_ever(database: Database) -> None:
    one = STUDY.model_copy(update={"quota": 1})
    done = enrol(database, Enrolment(one, "v1", "live", hash_token("done"), "en"), NOW)
    walk(database, done, done.num_pages)
    with pytest.raises(StudyFullError):
        enrol(database, Enrolment(one, "v1", "live", hash_token("late"), "en"), NOW + timedelta(days=300))


def test_only_places_of_the_same_version_and_mode_are_given_back(database: Database) -> None:
    other = enrol_somebody(database, mode="live", version="v2")
    test = enrol_somebody(database, mode="test", version="v1")
    own = enrol_somebody(database, mode="live", version="v1")
    enrol(database, Enrolment(STUDY, "v1", "live", hash_token("next"), "en"), LATER)
    with database.read() as connection:
        released = [row[4] for row in told_by(connection, "slot_released")]
        still = connection.execute(select(participants.c.id).where(participants.c.slot_released_at.is_(None))).scalars()
        assert released == [own.id]
        assert {other.id, test.id} < set(still)


def test_every_record_of_an_arrival_says_of_whom_and_of_which_data(database: Database) -> None:
    person = enrol_somebody(database, mode="live")
    enrol(database, Enrolment(STUDY, "v1", "live", hash_token("next"), "en"), LATER)
    actions: tuple[Action, ...] = ("allocated", "consented", "slot_released")
    scope = Scope(STUDY.name, "v1", "live")
    with database.read() as connection:
        about = [(row[3], row[4]) for row in told_by(connection, *actions, scope=scope) if row[4] == person.id]
        query = select(records.c.subject).where(records.c.action == "slot_released")
        assert connection.execute(query).scalar_one() == person.subject.digest
    assert about == [(action, person.id) for action in actions]
