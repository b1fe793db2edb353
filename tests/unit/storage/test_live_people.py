import random
from datetime import timedelta

import pytest

from tests.unit.storage.histories import EVERYTHING, History
from tests.unit.storage.people import NOW, STUDY, content_of, enrol_somebody, pages_of, ratings_of, send, walk
from webapp.storage.database import Database
from webapp.storage.ledger import release_abandoned
from webapp.storage.live import LiveNumbers
from webapp.storage.live_numbers import State
from webapp.storage.live_person_numbers import PersonNumbers
from webapp.storage.participants import Participant, find_trials, withdraw
from webapp.storage.people import Exclusion, exclude
from webapp.storage.scope import Scope
from webapp.study.answers import Event, PageContent
from webapp.study.protocol import Study
from webapp.study.quality import Flag
from webapp.study.questionnaire import Ratings
from webapp.study.sections import Quality

HERE = Scope(STUDY.name, "v1", "test")
FAST = STUDY.model_copy(update={"quality": Quality(min_total_minutes=5, incomplete=True)})
LEASE = timedelta(minutes=STUDY.lease_minutes)


def details(database: Database, person: Participant, study: Study = STUDY, *, blind: bool = False) -> PersonNumbers:
    scope = Scope(study.name, "v1", "test")
    found = LiveNumbers(database).person(study, scope, person.code, NOW, blind=blind)
    assert found is not None
    return found


def test_the_list_says_where_everybody_is_the_latest_arrival_first(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(5)]
    for person, last in zip(people, (0, 1, 4, 11, 2), strict=True):
        for number in range(1, last + 1):
            send(database, person, number, now=NOW + timedelta(minutes=number))
    withdraw(database, people[4], NOW + timedelta(minutes=20))
    found = LiveNumbers(database).people(STUDY, HERE, NOW)
    assert [line.code for line in found.lines] == [person.code for person in reversed(people)]
    lines = {line.code: line for line in found.lines}
    told = [(lines[person.code].state, lines[person.code].progress) for person in people]
    assert told == [("consented", 0), ("in_progress", 1), ("in_progress", 4), ("completed", 11), ("withdrawn", 2)]
    third = lines[people[2].code]
    assert (third.consented_at, third.last_seen, third.minutes) == (NOW, NOW + timedelta(minutes=4), 4)
    assert (third.num_pages, third.flags, third.excluded, third.is_late) == (11, (), None, False)


@pytest.mark.parametrize(("state", "codes"), [("consented", [0]), ("stalled", []), ("completed", [1]), (None, [1, 0])])
def test_the_list_can_be_narrowed_to_a_state(database: Database, state: State | None, codes: list[int]) -> None:
    people = [enrol_somebody(database) for _ in range(2)]
    walk(database, people[1], 11)
    found = LiveNumbers(database).people(STUDY, HERE, NOW, state=state)
    assert [line.code for line in found.lines] == [people[number].code for number in codes]


def test_the_list_can_be_narrowed_to_those_whom_a_rule_flags_which_time_alone_can_do(database: Database) -> None:
    fast, open_still = (enrol_somebody(database, study=FAST) for _ in range(2))
    walk(database, fast, 11)
    numbers = LiveNumbers(database)
    (line,) = numbers.people(FAST, HERE, NOW, flagged=True).lines
    assert (line.code, line.flags) == (fast.code, ("min_total_minutes",))
    (other,) = numbers.people(FAST, HERE, NOW, flagged=False).lines
    assert (other.code, other.flags) == (open_still.code, ())
    later = numbers.people(FAST, HERE, NOW + LEASE * 2, flagged=True)
    assert [line.flags for line in later.lines] == [("incomplete",), ("min_total_minutes",)]


def test_a_part_of_a_code_finds_it_whatever_its_case(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(3)]
    found = LiveNumbers(database).people(STUDY, HERE, NOW, search=f"  {people[1].code[2:9].upper()} ")
    assert [line.code for line in found.lines] == [people[1].code]
    assert LiveNumbers(database).people(STUDY, HERE, NOW, search="nobody").num_found == 0


@pytest.mark.parametrize(("page", "expected", "number"), [(1, 3, 1), (3, 1, 3), (9, 1, 3), (0, 3, 1)])
def test_the_list_comes_in_pages_and_beyond_the_last_is_the_last(
    database: Database, page: int, expected: int, number: int
) -> None:
    for _ in range(7):
        enrol_somebody(database)
    found = LiveNumbers(database).people(STUDY, HERE, NOW, page=page, per_page=3)
    assert (len(found.lines), found.num_found, found.page, found.num_pages) == (expected, 7, number, 3)
    nobody = LiveNumbers(database).people(STUDY, HERE, NOW, state="withdrawn")
    assert (nobody.lines, nobody.num_found, nobody.page, nobody.num_pages) == ((), 0, 1, 1)


def test_an_exclusion_stands_in_the_list_with_who_when_and_why(database: Database) -> None:
    person = enrol_somebody(database)
    exclude(database, person.code, "spoke of cheating", "ada", NOW)
    (line,) = LiveNumbers(database).people(STUDY, HERE, NOW).lines
    assert line.excluded == Exclusion("spoke of cheating", "ada", NOW)


def test_whoever_came_back_after_the_place_was_given_away_is_late(database: Database) -> None:
    person = enrol_somebody(database)
    with database.write() as connection:
        release_abandoned(connection, HERE, STUDY.lease_minutes, NOW + LEASE * 2)
    numbers = LiveNumbers(database)
    assert [line.is_late for line in numbers.people(STUDY, HERE, NOW).lines] == [False]
    send(database, person, 1, now=NOW + LEASE * 2)
    assert [line.is_late for line in numbers.people(STUDY, HERE, NOW).lines] == [True]


def test_a_person_has_pages_with_times_and_how_often_and_how_long_the_window_was_left(database: Database) -> None:
    person = enrol_somebody(database)
    left = [
        Event("focus_lost", "", "", 1000),
        Event("focus_regained", "", "", 3500),
        Event("focus_lost", "", "", 9000),
    ]
    send(database, person, 1, content=PageContent(events=left), now=NOW + timedelta(seconds=30))
    reloaded = [
        Event("focus_regained", "", "", 9500),
        Event("focus_lost", "", "", 90),
        Event("focus_regained", "", "", 8),
    ]
    send(database, person, 2, content=PageContent(events=reloaded), now=NOW + timedelta(seconds=30) + LEASE * 2)
    found = details(database, person)
    first, second = found.pages
    assert (first.number, first.kind, first.trial, first.seconds, first.was_away) == (
        1,
        "instructions",
        None,
        30,
        False,
    )
    assert (first.num_left_window, first.away_s) == (2, 2.5)
    assert (second.kind, second.trial, second.was_away) == ("situation", 1, True)
    assert (second.num_left_window, second.away_s) == (1, 0)
    assert (found.num_left_window, found.away_s) == (3, 2.5)


def test_a_person_has_answers_of_every_sort_as_they_were_given(database: Database) -> None:
    history = History(database, random.Random(4), mode="test")
    person = enrol_somebody(database, study=EVERYTHING)
    sent = []
    for page in pages_of(database, person, EVERYTHING):
        content = history.content(page)
        if page.kind == "quiz":
            content = PageContent(answers=[*content.answers], failed=False)
        send(database, person, page.number, study=EVERYTHING, content=content, now=NOW)
        sent.append((page, content))
    found = details(database, person, EVERYTHING)
    ratings = {(page.number, item): value for page, c in sent if c.ratings for item, value in c.ratings.values.items()}
    assert {(rating.page, rating.item): rating.rating for rating in found.ratings} == ratings
    assert [(p.page, p.predicted, p.confidence) for p in found.predictions] == [
        (page.number, made.predicted, made.confidence) for page, content in sent for made in content.predictions
    ]
    assert [(driven.page, driven.end) for driven in found.drives] == [
        (page.number, content.drive.end) for page, content in sent if content.drive
    ]
    assert sorted((a.page, a.question, a.answer, a.is_correct) for a in found.answers) == sorted(
        (page.number, a.question, a.answer, a.is_correct) for page, content in sent for a in content.answers
    )
    assert found.completed_at == NOW
    assert all(trial.is_done for trial in found.trials)
    assert [rating.trial for rating in found.ratings] == sorted(rating.trial for rating in found.ratings)


def test_response_times_stand_with_ratings(database: Database) -> None:
    person = enrol_somebody(database)
    walk(database, person, 2)
    content = content_of(pages_of(database, person)[2])
    assert content.ratings is not None
    items = list(content.ratings.values)
    timed = Ratings(content.ratings.values, dict.fromkeys(items, 1234) | {items[0]: None})
    send(database, person, 3, content=PageContent(ratings=timed))
    assert ratings_of(items, 3).values == timed.values
    times = {rating.item: rating.response_time_ms for rating in details(database, person).ratings}
    assert times == {items[0]: None, items[1]: 1234, items[2]: 1234}


def test_flags_of_a_person_come_with_value_and_limit(database: Database) -> None:
    person = enrol_somebody(database, study=FAST)
    for number in range(1, 12):
        send(database, person, number, now=NOW + timedelta(seconds=number))
    assert details(database, person, FAST).flags == (Flag("min_total_minutes", 11 / 60, 5.0),)


def test_a_person_looked_at_blind_has_trials_without_kinds(database: Database) -> None:
    person = enrol_somebody(database, study=EVERYTHING)
    shown, hidden = (details(database, person, EVERYTHING, blind=blind) for blind in (False, True))
    kinds = [trial.kind for trial in find_trials(database, person)]
    assert [trial.kind for trial in shown.trials] == kinds
    for trial in hidden.trials:
        assert (trial.kind, trial.draw, trial.first_page) == (None, None, None)
        assert trial.layout
    assert not any(kind in repr(hidden) for kind in kinds if kind != "none")


def test_nobody_is_found_in_another_scope_or_under_another_code(database: Database) -> None:
    person = enrol_somebody(database)
    numbers = LiveNumbers(database)
    assert numbers.person(STUDY, Scope(STUDY.name, "v1", "live"), person.code, NOW) is None
    assert numbers.person(STUDY, HERE, "nobody", NOW) is None
