"""Places in the study: given out evenly, given back when they are abandoned, and drawn again from the ledger alone."""

from collections import Counter
from datetime import datetime, timedelta

import pytest
from sqlalchemy import select

from tests.outside import outside
from tests.unit.storage.people import DRIVING, NOW, STUDY, at_once, enrol_somebody, pages_of, send, walk
from tests.unit.storage.test_records import tamper
from webapp.storage.database import Database
from webapp.storage.enrolment import Enrolment, StudyFullError, enrol
from webapp.storage.erasure import erase
from webapp.storage.helping import release_page
from webapp.storage.participants import Participant, find_participant, find_trials, hash_token, withdraw
from webapp.storage.records import told_by
from webapp.storage.replay import allocation_rows, replay
from webapp.storage.scope import Mode
from webapp.storage.tables import arrangements, participants
from webapp.storage.verification import verify_log
from webapp.study.draws import Draws
from webapp.study.protocol import Study

LEASE = timedelta(minutes=STUDY.lease_minutes)


def arrive(
    database: Database, name: str, now: datetime = NOW, *, mode: Mode = "live", study: Study = STUDY
) -> Participant:
    return enrol(database, Enrolment(study, "v1", mode, hash_token(name), "en"), now)


def anew(database: Database, participant: Participant) -> Participant:
    found = find_participant(database, participant.token_hash)
    assert found is not None
    return found


def held(database: Database, experiment: str = "1") -> Counter[int]:
    """How often each arrangement is held by somebody whose place counts."""
    query = (
        select(arrangements.c.arrangement)
        .join(participants)
        .where(arrangements.c.experiment == experiment, participants.c.slot_released_at.is_(None))
    )
    with database.read() as connection:
        return Counter(connection.execute(query).scalars())


def arrangement_of(database: Database, participant: Participant) -> int:
    query = select(arrangements.c.arrangement).where(
        arrangements.c.participant_id == participant.id, arrangements.c.experiment == "1"
    )
    with database.read() as connection:
        return int(connection.execute(query).scalar_one())


def told(database: Database, *actions: str) -> list[tuple[str, dict[str, object]]]:
    with database.read() as connection:
        return [(row[3], row[-1]) for row in told_by(connection, *actions)]  # type: ignore[arg-type]


def test_an_abandoned_place_is_given_to_the_next_one_within_its_allocation(database: Database) -> None:
    gone = [arrive(database, f"gone {number}") for number in range(6)]
    later = NOW + LEASE + timedelta(seconds=1)
    send(database, gone[0], 1, now=later)
    new = {arrangement_of(database, arrive(database, f"new {number}", later)) for number in range(5)}
    assert new == {arrangement_of(database, person) for person in gone[1:]}
    assert set(held(database).values()) == {1}
    assert [content["why"] for _, content in told(database, "slot_released")] == ["expired"] * 5


def test_nobody_loses_a_place_within_the_lease_or_after_finishing(database: Database) -> None:
    done, slow = arrive(database, "done"), arrive(database, "slow")
    walk(database, done, 11)
    arrive(database, "next", NOW + LEASE)
    assert told(database, "slot_released") == []
    arrive(database, "and next", NOW + timedelta(days=9))
    assert anew(database, done).slot_released_at is None
    assert anew(database, slow).slot_released_at == NOW + timedelta(days=9)


@pytest.mark.parametrize("why", ["withdrawn", "screened_out"])
def test_those_who_left_or_were_screened_out_hold_no_place(database: Database, why: str) -> None:
    person = arrive(database, "somebody")
    if why == "withdrawn":
        withdraw(database, person, NOW)
    else:
        tamper(database, "UPDATE participants SET screened_out_at = consented_at")
    arrive(database, "next")
    assert [content["why"] for _, content in told(database, "slot_released")] == [why]


def test_who_returns_late_keeps_the_assignment_and_the_place_counts_again(database: Database) -> None:
    person = arrive(database, "late")
    before = find_trials(database, person)
    later = NOW + LEASE * 2
    arrive(database, "next", later)
    assert anew(database, person).slot_released_at == later
    assert send(database, anew(database, person), 1, now=later + timedelta(minutes=1)) == "accept"
    assert anew(database, person).slot_released_at is None
    assert find_trials(database, person) == before
    with database.read() as connection:
        row = connection.execute(select(participants).where(participants.c.id == person.id)).one()
    assert row.returned_late_at == later + timedelta(minutes=1)
    assert [action for action, _ in told(database, "slot_released", "slot_resumed")] == [
        "slot_released",
        "slot_resumed",
    ]


def test_places_stay_within_one_of_each_other_through_drop_outs(database: Database) -> None:
    now = NOW
    for number in range(60):
        now += timedelta(minutes=7)
        person = arrive(database, str(number), now)
        if number % 3 == 0:
            withdraw(database, person, now)
        elif number % 3 == 1:
            walk(database, person, 11)
    arrive(database, "last", now)
    counts = [held(database)[arrangement] for arrangement in range(6)]
    # Whoever left since the last allocation still counts there; nobody gets more than one ahead of who stays.
    assert max(counts) - min(counts) <= 2
    assert replay(database).problems == ()


def test_each_mode_has_a_ledger_of_its_own(database: Database) -> None:
    for number in range(3):
        arrive(database, f"test {number}", mode="test")
        arrive(database, f"bot {number}", mode="bot")
    live = {arrangement_of(database, arrive(database, f"live {number}")) for number in range(6)}
    assert live == set(range(6))
    assert replay(database).problems == ()


def test_a_quota_closes_the_study_until_a_place_is_given_back(database: Database) -> None:
    small = STUDY.model_copy(update={"quota": 2})
    first, second = arrive(database, "first", study=small), arrive(database, "second", study=small)
    walk(database, first, 11)
    with pytest.raises(StudyFullError):
        arrive(database, "third", study=small)
    arrive(database, "bot", mode="bot", study=small)
    withdraw(database, second, NOW)
    arrive(database, "third", study=small)
    assert arrive(database, "third", study=small) is not None


def test_a_quota_counts_all_versions_and_those_only_who_may_still_finish(database: Database) -> None:
    small = STUDY.model_copy(update={"quota": 2})
    done = arrive(database, "done", study=small)
    walk(database, done, 11)
    arrive(database, "silent", study=small)

    def arrive_later(name: str, now: datetime) -> None:
        enrol(database, Enrolment(small, "v2", "live", hash_token(name), "en"), now)

    with pytest.raises(StudyFullError):
        arrive_later("third", NOW + LEASE)
    arrive_later("third", NOW + LEASE + timedelta(seconds=1))
    with pytest.raises(StudyFullError):
        arrive_later("fourth", NOW + LEASE + timedelta(seconds=2))


def test_whoever_finishes_after_the_place_was_given_back_holds_it_again(database: Database) -> None:
    person = arrive(database, "late")
    walk(database, person, 10)
    later = NOW + LEASE * 2
    arrive(database, "next", later)
    release_page(database, person.code, pages_of(database, person)[10], "the bus came", "boss", later)
    assert anew(database, person).slot_released_at is None
    assert sum(held(database).values()) == 2
    assert (replay(database).problems, verify_log(database).problems) == ((), ())


def test_simultaneous_arrivals_do_not_get_past_the_quota(database: Database) -> None:
    small = STUDY.model_copy(update={"quota": 5})

    def try_to_arrive(number: int) -> bool:
        try:
            arrive(database, str(number), study=small)
        except StudyFullError:
            return False
        return True

    assert sum(at_once(12, try_to_arrive)) == 5


def test_every_assignment_follows_from_the_ledger(database: Database) -> None:
    people = [enrol_somebody(database, study=DRIVING) for _ in range(9)]
    people += [enrol_somebody(database) for _ in range(9)]
    found = replay(database)
    assert (found.num_allocations, found.num_before, found.problems) == (18, 0, ())
    drawn = {content["word"]: content for _, content in told(database, "allocated")}
    assert len(drawn) == len(people)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"arrangement":', '"arrangement":1', "its word gives"),
        ('"uses":{', '"uses":{"0/7":1,', "other counts"),
        ('"draws":[', '"draws":[9,', "draws"),
    ],
)
def test_a_ledger_that_was_changed_does_not_add_up(database: Database, old: str, new: str, problem: str) -> None:
    for _ in range(4):
        enrol_somebody(database)
    change = f"content = replace(content, '{old}', '{new}')"
    tamper(database, f"UPDATE record_contents SET {change} WHERE number = 7")  # noqa: S608
    assert problem in " ".join(replay(database).problems)


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE arrangements SET arrangement = (arrangement + 1) % 2 WHERE participant_id = 3 AND experiment = '2'",
        "UPDATE trials SET draw = draw + 1 WHERE participant_id = 3",
    ],
)
def test_an_assignment_that_is_not_the_drawn_one_is_found(database: Database, statement: str) -> None:
    for _ in range(4):
        enrol_somebody(database)
    tamper(database, statement)
    (problem,) = replay(database).problems
    assert "and the participant has" in problem


def test_the_ledger_outlasts_the_erased(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(7)]
    for person in people[::2]:
        erase(database, person.code, "boss", NOW)
    for _ in range(7):
        enrol_somebody(database)
    assert replay(database).problems == ()
    with database.read() as connection:
        rows = list(allocation_rows(connection))
    assert len(rows) == 14 * 2
    assert [row[3] is None for row in rows[:14]] == [number % 2 == 0 for number in range(7) for _ in range(2)]
    assert {row[-2] for row in rows if row[3] is None} == {"erased"}


def test_numbers_follow_from_the_word_alone_and_are_even() -> None:
    one, other = Draws("word"), Draws("word")
    assert [one.randrange(6) for _ in range(20)] == [other.randrange(6) for _ in range(20)]
    draws = Draws("another")
    counts = Counter(draws.choice("abcdef") for _ in range(6000))
    # Chi-square with 5 degrees of freedom: above 20.5 in one of a thousand words.
    assert sum((count - 1000) ** 2 / 1000 for count in counts.values()) < 20.5
    with pytest.raises(ValueError, match="not 0 numbers"):
        draws.randrange(0)


def test_places_from_before_the_ledger_count(database: Database) -> None:
    person = enrol_somebody(database)
    with outside(database) as connection:
        ((content,),) = connection.ask("SELECT content FROM record_contents WHERE number = 1")
    word = content[content.index('"word":') :]
    change = f"content = replace(content, '{word}', '\"word\":null}}')"
    tamper(database, f"UPDATE record_contents SET {change} WHERE number = 1")  # noqa: S608
    for _ in range(6):
        enrol_somebody(database)
    found = replay(database)
    assert (found.num_before, found.problems) == (1, ())
    assert person.num_pages == 11
