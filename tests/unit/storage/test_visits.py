"""What a request of a participant knows of them, and what of it is read only once."""

from dataclasses import replace

import pytest

from tests.unit.storage.people import DRIVING, NOW, enrol_somebody, send, walk
from webapp.storage import visits
from webapp.storage.database import Database
from webapp.storage.helping import restart_page
from webapp.storage.participants import Participant, find_trials, read_trials, withdraw
from webapp.storage.visits import RecentTrials, find_visit


def visit(database: Database, participant: Participant, recent: RecentTrials) -> visits.StoredVisit:
    found = find_visit(database, participant.token_hash, recent)
    assert found is not None
    return found


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Whose trials were read from the database, by id."""
    whose: list[int] = []

    def _read(connection: object, participant: Participant) -> object:
        whose.append(participant.id)
        return read_trials(connection, participant)  # type: ignore[arg-type]

    monkeypatch.setattr(visits, "read_trials", _read)
    return whose


def test_trials_are_read_once_and_how_far_somebody_is_every_time(database: Database, read: list[int]) -> None:
    one, other, recent = enrol_somebody(database), enrol_somebody(database, study=DRIVING), RecentTrials()
    for num_pages in (0, 1, 2):
        if num_pages:
            assert send(database, one, num_pages) == "accept"
        for participant in (one, other):
            assert visit(database, participant, recent).trials == find_trials(database, participant)
        assert visit(database, one, recent).participant == replace(one, num_stored=num_pages)
    assert read == [one.id, other.id]
    withdraw(database, one, NOW)
    assert visit(database, one, recent).participant.withdrawn_at == NOW


def test_those_who_asked_longest_ago_are_forgotten_first(database: Database, read: list[int]) -> None:
    first, second, third = (enrol_somebody(database) for _ in range(3))
    recent = RecentTrials(2)
    for participant in (first, second, first, third, first, second):
        visit(database, participant, recent)
    assert read == [person.id for person in (first, second, third, second)]


def test_a_page_that_was_begun_anew_is_known_at_once(database: Database) -> None:
    participant, recent = enrol_somebody(database), RecentTrials()
    walk(database, participant, 1)
    assert visit(database, participant, recent).restarts == {}
    for number in (1, 2):
        restart_page(database, participant.code, 2, "the phone rang", "ayla", NOW)
        found = visit(database, participant, recent)
        assert (found.participant.has_restarts, found.restarts) == (True, {2: number})


def test_nobody_is_found_by_an_unknown_token(database: Database) -> None:
    enrol_somebody(database)
    assert find_visit(database, "0" * 64, RecentTrials()) is None
