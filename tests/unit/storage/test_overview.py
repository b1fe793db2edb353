import math
import statistics
from datetime import UTC, datetime, timedelta

from tests.unit.storage.test_participants import STUDY, answers_to, enrol_somebody
from webapp.storage.database import Database
from webapp.storage.overview import Overview, read_overview
from webapp.storage.participants import Participant, find_trials, store_page, withdraw
from webapp.study.session import pages as all_pages

NOW = datetime(2031, 3, 1, 10, tzinfo=UTC)


def overview(database: Database, *, revealed: bool = True) -> Overview:
    return read_overview(database, STUDY, "v1", "test", revealed=revealed)


def walk(database: Database, participant: Participant, last: int, rating: int = 3) -> None:
    for page in all_pages(find_trials(database, participant))[:last]:
        later = NOW + timedelta(minutes=page.number)
        store_page(database, participant, page, f"{participant.id} {page.number}", answers_to(page, rating), later)


def test_an_empty_study_has_all_its_cells_and_no_ratings(database: Database) -> None:
    empty = overview(database)
    assert (empty.counts.arrived, empty.participants, empty.ratings) == (0, (), ())
    assert len(empty.cells) == 3 * 3 + 2 * 2
    assert {(cell.assigned, cell.rated) for cell in empty.cells} == {(0, 0)}


def test_everyone_is_where_they_are(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(5)]
    for participant, last in zip(people, (0, 1, 4, 11, 2), strict=True):
        walk(database, participant, last)
    withdraw(database, people[4], NOW + timedelta(hours=1))
    found = overview(database)
    assert (found.counts.arrived, found.counts.in_progress) == (5, 3)
    assert (found.counts.completed, found.counts.withdrawn) == (1, 1)
    lines = {line.code: line for line in found.participants}
    states = [lines[participant.code].state for participant in people]
    assert states == ["consented", "in_progress", "in_progress", "completed", "withdrawn"]
    assert [lines[participant.code].progress for participant in people] == [0, 1, 4, 11, 2]
    assert lines[people[2].code].last_seen == NOW + timedelta(minutes=4)
    assert lines[people[4].code].last_seen == NOW + timedelta(hours=1)
    assert [line.code for line in found.participants] == [participant.code for participant in reversed(people)]


def test_cells_count_who_is_to_see_and_who_has_rated(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(6)]
    walk(database, people[0], 3)
    found = overview(database)
    assert all(cell.assigned == (2 if cell.experiment == "1" else 3) for cell in found.cells)
    first = find_trials(database, people[0])[0]
    rated = [(cell.experiment, cell.layout, cell.kind) for cell in found.cells if cell.rated]
    assert rated == [(first.experiment, first.layout, first.kind)]


def test_means_and_deviations_are_those_of_the_textbook(database: Database) -> None:
    values = [1, 2, 2, 5]
    for value in values:
        walk(database, enrol_somebody(database), 11, rating=value)
    rows = overview(database).ratings
    assert rows is not None
    assert len(rows) == 3 * 3 + 2 * 3
    for row in rows:
        assert row.n == 4
        assert row.sd is not None
        assert math.isclose(row.mean, statistics.mean(values))
        assert math.isclose(row.sd, statistics.stdev(values))


def test_one_rating_has_no_deviation_and_equal_ones_have_zero(database: Database) -> None:
    walk(database, enrol_somebody(database), 11, rating=4)
    rows = overview(database).ratings
    assert rows is not None
    assert {(row.mean, row.sd, row.n) for row in rows} == {(4.0, None, 1)}
    walk(database, enrol_somebody(database), 11, rating=4)
    rows = overview(database).ratings
    assert rows is not None
    assert {(row.mean, row.sd, row.n) for row in rows} == {(4.0, 0.0, 2)}


def test_hidden_ratings_are_not_read(database: Database) -> None:
    walk(database, enrol_somebody(database), 11)
    assert overview(database, revealed=False).ratings is None


def test_other_modes_and_versions_are_counted_apart(database: Database) -> None:
    walk(database, enrol_somebody(database, mode="live"), 11)
    walk(database, enrol_somebody(database, version="v0"), 11)
    enrol_somebody(database)
    found = overview(database)
    assert (found.counts.arrived, found.num_elsewhere) == (1, 2)
    assert found.ratings == ()
    assert sum(cell.assigned for cell in found.cells) == 5
