import random
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import timedelta

import pytest
from sqlalchemy import Connection

from tests.unit.storage.histories import EVERYTHING, History
from tests.unit.storage.people import NOW, STUDY, at_once, enrol_somebody, pages_of, send, walk
from webapp.storage import live
from webapp.storage.database import Database
from webapp.storage.erasure import erase
from webapp.storage.helping import release_page
from webapp.storage.live import LiveNumbers
from webapp.storage.live_person_numbers import PersonLine
from webapp.storage.live_scopes import ScopePeople
from webapp.storage.participants import withdraw
from webapp.storage.people import exclude
from webapp.storage.records import head
from webapp.storage.scope import Scope
from webapp.study.recruitment import Recruit
from webapp.study.sections import Quality

HERE = Scope(STUDY.name, "v1", "test")


def everybody(numbers: LiveNumbers, history: History) -> tuple[PersonLine, ...]:
    return numbers.people(history.study, history.scope, history.now, per_page=10**6).lines


@pytest.mark.parametrize("seed", range(6))
def test_after_any_history_the_numbers_are_those_of_counting_anew(database: Database, seed: int) -> None:
    history = History(database, random.Random(seed))
    kept = LiveNumbers(database)
    for _ in range(8):
        history.happen(history.chooser.choice((1, 5, 60)))
        if history.chooser.random() < 0.2:
            history.now += timedelta(minutes=45)
        anew = LiveNumbers(database)
        look = (history.study, history.scope, history.now)
        assert asdict(kept.overview(*look)) == asdict(anew.overview(*look))
        assert everybody(kept, history) == everybody(anew, history)
        assert sorted(line.code for line in everybody(kept, history)) == sorted(history.people)


def test_only_whom_records_name_are_read_again(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(5)]
    here = ScopePeople(database, STUDY, HERE)
    here.refresh()
    before, version = dict(here.people), here.version
    enrol_somebody(database, "live")
    here.refresh()
    assert here.version == version
    send(database, people[3], 1)
    here.refresh()
    read_again = [number for number, person in here.people.items() if person is not before[number]]
    assert read_again == [people[3].id]


def test_the_numbers_say_up_to_which_record_they_count(database: Database) -> None:
    numbers = LiveNumbers(database)
    assert numbers.overview(STUDY, HERE, NOW).head.number == 0
    walk(database, enrol_somebody(database), 2)
    with database.read() as connection:
        assert numbers.overview(STUDY, HERE, NOW).head == head(connection)


def test_time_alone_makes_somebody_stalled_and_a_sign_of_life_undoes_it(database: Database) -> None:
    person = enrol_somebody(database)
    numbers = LiveNumbers(database)
    lease = timedelta(minutes=STUDY.lease_minutes)
    at_the_limit = numbers.overview(STUDY, HERE, NOW + lease).counts
    assert (at_the_limit.in_progress, at_the_limit.stalled) == (1, 0)
    later = NOW + lease + timedelta(microseconds=1)
    after = numbers.overview(STUDY, HERE, later).counts
    assert (after.in_progress, after.stalled) == (0, 1)
    assert numbers.people(STUDY, HERE, later, state="stalled").num_found == 1
    send(database, person, 1, now=later)
    assert numbers.overview(STUDY, HERE, later).counts.stalled == 0


def test_whoever_is_erased_leaves_nothing_even_if_the_number_is_given_to_somebody_else(database: Database) -> None:
    numbers = LiveNumbers(database)
    walk(database, enrol_somebody(database), 3)
    gone = enrol_somebody(database)
    walk(database, gone, 11, rating=5)
    assert numbers.overview(STUDY, HERE, NOW).counts.completed == 1
    erase(database, gone.code, "ada", NOW)
    newcomer = enrol_somebody(database)
    assert database.url is not None or newcomer.id == gone.id  # PostgreSQL gives no number twice.
    after = numbers.overview(STUDY, HERE, NOW)
    assert (after.counts.arrived, after.counts.completed) == (2, 0)
    assert {rating.mean for rating in after.ratings} == {3.0}
    assert numbers.person(STUDY, HERE, gone.code, NOW) is None


def test_what_was_decided_about_somebody_goes_with_them_when_they_are_erased(database: Database) -> None:
    """Who looks on is another process than the one that erases, and learns of it from the log alone."""
    study, scope = STUDY.model_copy(update={"quality": Quality(duplicates=True)}), Scope(STUDY.name, "v1", "live")
    twin = enrol_somebody(database, "live", study=study, recruit=Recruit("prolific", "a", None, "same session"))
    gone = enrol_somebody(database, "live", study=study, recruit=Recruit("prolific", "b", None, "same session"))
    release_page(database, gone.code, pages_of(database, gone, study)[0], "a reason", "ada", NOW)
    exclude(database, gone.code, "a reason", "ada", NOW)
    kept = LiveNumbers(database)
    assert kept.overview(study, scope, NOW).quality[0].num_flagged == 2
    erase(database, gone.code, "ada", NOW)
    assert kept.overview(study, scope, NOW).quality[0].num_flagged == 0
    newcomer = enrol_somebody(database, "live", study=study)
    assert database.url is not None or newcomer.id == gone.id  # PostgreSQL gives no number twice.
    send(database, newcomer, 1, study=study, now=NOW + timedelta(seconds=30))
    lines = {line.code: line for line in kept.people(study, scope, NOW).lines}
    assert {code: line.excluded for code, line in lines.items()} == {twin.code: None, newcomer.code: None}
    assert asdict(kept.overview(study, scope, NOW)) == asdict(LiveNumbers(database).overview(study, scope, NOW))


def test_scopes_are_counted_apart_and_the_others_participants_are_told(database: Database) -> None:
    enrol_somebody(database)
    for mode, version in (("live", "v1"), ("test", "v0"), ("bot", "v1")):
        walk(database, enrol_somebody(database, mode, version), 11)  # type: ignore[arg-type]
    numbers = LiveNumbers(database)
    for scope in (HERE, Scope(STUDY.name, "v1", "live"), Scope(STUDY.name, "v0", "test")):
        found = numbers.overview(STUDY, scope, NOW)
        assert (found.counts.arrived, found.num_elsewhere) == (1, 3)
        assert found.counts.completed == (0 if scope == HERE else 1)
        assert sum(cell.assigned for cell in found.cells) == 5


def test_scopes_that_nobody_looks_at_are_let_go_and_read_again(database: Database) -> None:
    enrol_somebody(database)
    numbers = LiveNumbers(database)
    first = numbers.overview(STUDY, HERE, NOW)
    for number in range(live.MOST_SCOPES + 2):
        assert numbers.overview(STUDY, Scope(STUDY.name, f"other {number}", "test"), NOW).counts.arrived == 0
    assert numbers.overview(STUDY, HERE, NOW) == first


def test_threads_may_look_while_people_send_pages(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(4)]
    numbers = LiveNumbers(database)

    def act(number: int) -> int:
        if number < 4:
            walk(database, people[number], 11)
            return 0
        return max(numbers.overview(STUDY, HERE, NOW).counts.arrived for _ in range(10))

    assert at_once(8, act)[4:] == [4] * 4
    assert numbers.overview(STUDY, HERE, NOW) == LiveNumbers(database).overview(STUDY, HERE, NOW)
    assert numbers.overview(STUDY, HERE, NOW).counts.completed == 4


def test_a_study_without_anybody_has_all_its_cells_and_nothing_to_compare(database: Database) -> None:
    empty = LiveNumbers(database).overview(EVERYTHING, Scope(EVERYTHING.name, "v1", "live"), NOW)
    assert (empty.counts.arrived, empty.ratings, empty.predictions, empty.drives) == (0, (), (), ())
    assert (empty.drop_out, empty.page_times) == ((), ())
    assert {(cell.assigned, cell.done) for cell in empty.cells} == {(0, 0)}
    assert {(step.count, step.of_previous) for step in empty.funnel} == {(0, None)}
    assert {(rule.num_flagged, rule.num_judged) for rule in empty.quality} == {(0, 0)}
    assert len(empty.quality) == 7


class FailingDatabase(Database):
    """A database that once fails to read, when it is asked for the n-th time."""

    failing_read = 10**6

    @contextmanager
    def read(self) -> Iterator[Connection]:
        self.failing_read -= 1
        if self.failing_read == 0:
            raise RuntimeError("the disk is full")
        with super().read() as connection:
            yield connection


def test_a_look_that_fails_half_way_is_made_up_for(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("webapp.storage.live_scopes.CHUNK", 1)
    people = [enrol_somebody(database) for _ in range(3)]
    failing = FailingDatabase(database.path, database.url)
    numbers = LiveNumbers(failing)
    numbers.overview(STUDY, HERE, NOW)
    for person in people:
        send(database, person, 1)
    withdraw(database, people[0], NOW)
    failing.failing_read = 3
    with pytest.raises(RuntimeError, match="disk is full"):
        numbers.overview(STUDY, HERE, NOW)
    assert numbers.overview(STUDY, HERE, NOW) == LiveNumbers(database).overview(STUDY, HERE, NOW)
    failing.close()
