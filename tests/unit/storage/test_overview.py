from datetime import UTC, datetime, timedelta

import pytest

from tests.unit.storage.people import DRIVING, STUDY, enrol_somebody, pages_of, send, walk, walk_to
from webapp.storage.database import Database
from webapp.storage.overview import Overview, UnvalidatedLanguage, read_overview
from webapp.storage.participants import find_trials, withdraw
from webapp.study.answers import Answer, PageContent
from webapp.study.experiments import Drive
from webapp.study.protocol import Study

NOW = datetime(2031, 3, 1, 10, tzinfo=UTC)


def overview(database: Database, *, revealed: bool = True, study: Study = STUDY) -> Overview:
    return read_overview(database, study, "v1", "test", revealed=revealed)


def test_an_empty_study_has_all_its_cells_and_no_ratings(database: Database) -> None:
    empty = overview(database)
    assert (empty.counts.arrived, empty.participants, empty.ratings) == (0, (), ())
    assert len(empty.cells) == 3 * 3 + 2 * 2
    assert {(cell.assigned, cell.done) for cell in empty.cells} == {(0, 0)}


def test_everyone_is_where_they_are(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(5)]
    for participant, last in zip(people, (0, 1, 4, 11, 2), strict=True):
        for number in range(1, last + 1):
            send(database, participant, number, now=NOW + timedelta(minutes=number))
    withdraw(database, people[4], NOW + timedelta(hours=1))
    found = overview(database)
    assert (found.counts.arrived, found.counts.in_progress) == (5, 3)
    assert (found.counts.completed, found.counts.withdrawn, found.counts.screened_out) == (1, 1, 0)
    lines = {line.code: line for line in found.participants}
    states = [lines[participant.code].state for participant in people]
    assert states == ["consented", "in_progress", "in_progress", "completed", "withdrawn"]
    assert [lines[participant.code].progress for participant in people] == [0, 1, 4, 11, 2]
    assert lines[people[2].code].last_seen == NOW + timedelta(minutes=4)
    assert lines[people[4].code].last_seen == NOW + timedelta(hours=1)
    assert [line.code for line in found.participants] == [participant.code for participant in reversed(people)]


def test_whoever_was_screened_out_is_counted_apart(database: Database) -> None:
    people = [enrol_somebody(database, study=DRIVING) for _ in range(3)]
    for participant in people[:2]:
        page = walk_to(database, participant, "quiz", DRIVING)
        failed = PageContent(answers=[Answer("goal", "key", is_correct=False)], failed=True, screens_out=True)
        send(database, participant, page.number, study=DRIVING, content=failed)
    counts = overview(database, study=DRIVING).counts
    assert (counts.arrived, counts.screened_out, counts.in_progress) == (3, 2, 1)
    assert (counts.completed, counts.withdrawn) == (0, 0)
    states = [line.state for line in overview(database, study=DRIVING).participants]
    assert states == ["consented", "screened_out", "screened_out"]


def test_the_states_add_up(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(4)]
    walk(database, people[0], 11)
    withdraw(database, people[1], NOW)
    counts = overview(database).counts
    assert counts.arrived == counts.in_progress + counts.completed + counts.withdrawn + counts.screened_out == 4


def test_cells_count_who_is_to_see_and_who_is_done(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(6)]
    walk(database, people[0], 3)
    found = overview(database)
    assert all(cell.assigned == (2 if cell.experiment == "1" else 3) for cell in found.cells)
    first = find_trials(database, people[0])[0]
    done = [(cell.experiment, cell.layout, cell.kind) for cell in found.cells if cell.done]
    assert done == [(first.experiment, first.layout, first.kind)]


@pytest.mark.parametrize("when", ["before_ratings", "after_ratings", None])
def test_a_trial_is_done_with_its_last_page_whether_that_is_a_rating_or_not(
    database: Database, when: str | None
) -> None:
    (experiment,) = DRIVING.experiments
    items = tuple(item.model_copy(update={"without_explanation": False}) for item in experiment.items)
    drive = None if when is None else Drive(when=when)  # type: ignore[arg-type]
    changes = {"items": items, "kinds": ("none", "placebic", "subgoals"), "drive": drive}
    study = DRIVING.model_copy(update={"experiments": (experiment.model_copy(update=changes),), "attention_checks": ()})
    participant = enrol_somebody(database, study=study)
    shown = pages_of(database, participant, study)
    for page in shown:
        send(database, participant, page.number, study=study)
        finished = [
            trial.kind
            for trial in find_trials(database, participant)
            if max(other.number for other in shown if other.trial == trial) <= page.number
        ]
        done = [cell.kind for cell in overview(database, study=study).cells for _ in range(cell.done)]
        assert sorted(done) == sorted(finished)
    assert not [page for page in shown if page.kind == "rating" and page.trial and page.trial.kind == "none"]


def test_every_kind_is_assigned_and_done_although_there_are_more_kinds_than_layouts(database: Database) -> None:
    (experiment,) = DRIVING.experiments
    kinds = ("subgoals", "highlights", "evenly_spaced", "placebic")
    study = DRIVING.model_copy(update={"experiments": (experiment.model_copy(update={"kinds": kinds}),)})
    for _ in range(24):
        participant = enrol_somebody(database, study=study)
    walk(database, participant, participant.num_pages, study=study)
    cells = overview(database, study=study).cells
    assert len(cells) == 12
    assert sum(cell.assigned for cell in cells) == 24 * 3
    assert {cell.assigned for cell in cells} == {6}
    assert sum(cell.done for cell in cells) == 3


def test_languages_without_a_back_translation_are_named_with_their_readers(database: Database) -> None:
    for language in ("en", "ja", "ja"):
        enrol_somebody(database, study=DRIVING, language=language)
    enrol_somebody(database, "live", study=DRIVING, language="ja")
    assert overview(database, study=DRIVING).unvalidated == (UnvalidatedLanguage("ja", 2),)
    cited = DRIVING.model_copy(update={"translations": {"ja": object()}})
    assert overview(database, study=cited).unvalidated == ()
    original = DRIVING.model_copy(update={"languages": ("en",)})
    assert overview(database, study=original).unvalidated == ()


def test_what_is_hidden_is_not_read(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    walk(database, participant, participant.num_pages, study=DRIVING)
    found = overview(database, revealed=False, study=DRIVING)
    assert (found.ratings, found.predictions, found.drives) == (None, None, None)
    shown = overview(database, study=DRIVING)
    assert all((shown.ratings, shown.predictions, shown.drives))


def test_other_modes_and_versions_are_counted_apart(database: Database) -> None:
    for mode, version in (("live", "v1"), ("test", "v0")):
        elsewhere = enrol_somebody(database, mode, version, study=DRIVING)  # type: ignore[arg-type]
        walk(database, elsewhere, elsewhere.num_pages, study=DRIVING)
    enrol_somebody(database, study=DRIVING)
    found = overview(database, study=DRIVING)
    assert (found.counts.arrived, found.num_elsewhere) == (1, 2)
    assert (found.ratings, found.predictions, found.drives) == ((), (), ())
    assert sum(cell.assigned for cell in found.cells) == 3
    assert sum(cell.done for cell in found.cells) == 0
