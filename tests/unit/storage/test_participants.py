from dataclasses import replace
from datetime import timedelta

import pytest

from tests.unit.storage.people import DRIVING, NOW, enrol_somebody, send, walk, walk_to
from webapp.storage.database import Database
from webapp.storage.participants import Participant, find_participant, find_trials, hash_token, withdraw
from webapp.study.answers import Answer, PageContent

SCREENED_OUT = PageContent(answers=[Answer("goal", "key", is_correct=False)], failed=True, screens_out=True)


def stored(database: Database, participant: Participant) -> Participant:
    found = find_participant(database, participant.token_hash)
    assert found is not None
    return found


def screen_out(database: Database, participant: Participant) -> None:
    page = walk_to(database, participant, "quiz", DRIVING)
    assert send(database, participant, page.number, study=DRIVING, content=SCREENED_OUT) == "accept"


def test_nobody_is_found_by_a_token_that_was_never_given_out(database: Database) -> None:
    enrol_somebody(database)
    assert find_participant(database, hash_token("another")) is None


def test_a_participant_is_found_with_everything_that_is_stored(database: Database) -> None:
    participant = enrol_somebody(database, "bot", "v7", study=DRIVING, language="ja")
    assert (participant.mode, participant.study, participant.study_version) == ("bot", "understanding", "v7")
    assert (participant.language, participant.num_stored) == ("ja", 0)
    walk(database, participant, 2, study=DRIVING)
    assert stored(database, participant) == replace(participant, num_stored=2)


def test_trials_are_each_participants_own(database: Database) -> None:
    first, second = enrol_somebody(database), enrol_somebody(database, study=DRIVING)
    assert [len(find_trials(database, participant)) for participant in (first, second)] == [5, 3]


def test_whoever_begins_is_in_progress_until_the_end(database: Database) -> None:
    finishing, leaving, failing = (
        enrol_somebody(database),
        enrol_somebody(database),
        enrol_somebody(database, study=DRIVING),
    )
    people = (finishing, leaving, failing)
    assert all(participant.is_in_progress and not participant.was_ended_early for participant in people)
    walk(database, finishing, 11)
    withdraw(database, leaving, NOW)
    screen_out(database, failing)
    after = [stored(database, participant) for participant in people]
    assert [participant.is_in_progress for participant in after] == [False, False, False]
    assert [participant.was_ended_early for participant in after] == [False, True, True]
    times = [(participant.completed_at, participant.withdrawn_at, participant.screened_out_at) for participant in after]
    assert times == [(NOW, None, None), (None, NOW, None), (None, None, NOW)]


def test_leaving_twice_keeps_the_first_time(database: Database) -> None:
    participant = enrol_somebody(database)
    withdraw(database, participant, NOW)
    withdraw(database, participant, NOW + timedelta(hours=1))
    assert stored(database, participant).withdrawn_at == NOW


@pytest.mark.parametrize("ending", ["completed", "screened out"])
def test_for_whom_the_study_is_over_nothing_is_left_to_leave(database: Database, ending: str) -> None:
    if ending == "completed":
        participant = enrol_somebody(database)
        walk(database, participant, 11)
    else:
        participant = enrol_somebody(database, study=DRIVING)
        screen_out(database, participant)
    before = stored(database, participant)
    withdraw(database, participant, NOW + timedelta(hours=1))
    assert stored(database, participant) == before
