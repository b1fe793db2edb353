import math
import random
import statistics
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from tests.unit.storage.people import (
    DRIVING,
    content_of,
    drive,
    enrol_somebody,
    pages_of,
    prediction,
    ratings_of,
    send,
    walk,
)
from tests.unit.storage.test_overview import overview
from webapp.storage.answers import store_last_step, store_page, store_step
from webapp.storage.database import Database
from webapp.storage.participants import Participant
from webapp.study.answers import DriveEnd, DriveStep, PageContent
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.session import DRIVEN, Page

NOW = datetime(2031, 3, 1, 10, tzinfo=UTC)
KINDS = DRIVING.experiments[0].kinds
SATISFIED = DRIVING.model_copy(
    update={"experiments": (DRIVING.experiments[0].model_copy(update={"satisfaction": True}),)}
)


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


def test_the_satisfaction_scale_is_among_the_ratings_where_it_was_asked(database: Database) -> None:
    participant = enrol_somebody(database, study=SATISFIED)
    walk(database, participant, participant.num_pages, study=SATISFIED)
    rows = overview(database, study=SATISFIED).ratings
    assert rows is not None
    of_scale = [row for row in rows if row.is_satisfaction]
    assert [(row.kind, row.item, row.points) for row in of_scale] == [
        (kind, item, 5) for kind in ("tailored_all", "placebic") for item in SATISFACTION_ITEMS
    ]
    own = [(row.kind, row.item) for row in rows if not row.is_satisfaction]
    asked = {kind: [item.id for item in SATISFIED.experiments[0].items_for(kind)] for kind in KINDS}
    assert own == [(kind, item) for kind in KINDS for item in asked[kind]]
    assert asked["none"] == ["foresee"]


def test_a_scale_of_another_length_keeps_its_length(database: Database) -> None:
    (experiment,) = DRIVING.experiments
    items = tuple(item.model_copy(update={"points": 7}) for item in experiment.items)
    study = DRIVING.model_copy(update={"experiments": (experiment.model_copy(update={"items": items}),)})
    participant = enrol_somebody(database, study=study)
    walk(database, participant, participant.num_pages, rating=7, study=study)
    rows = overview(database, study=study).ratings
    assert rows is not None
    assert {(row.points, row.mean) for row in rows} == {(7, 7.0)}


def test_without_predictions_and_drives_there_is_nothing_to_sum_up(database: Database) -> None:
    walk(database, enrol_somebody(database), 11)
    found = overview(database)
    assert (found.predictions, found.drives) == ((), ())


def test_predictions_are_summed_up_by_kind_with_their_calibration(database: Database) -> None:
    rng = random.Random(1)
    made: dict[str, list[tuple[bool, bool, int]]] = {kind: [] for kind in KINDS}

    def predict(page: Page) -> PageContent:
        assert page.trial is not None
        entries = []
        for number in (1, 2):
            predicted, confidence, luck = (
                rng.choice(["left", "right", "toggle"]),
                rng.choice([1, 2, 4, 5]),
                rng.random(),
            )
            entry = prediction(number, predicted, confidence, is_as_good=predicted == "left" or luck < 0.5)
            made[page.trial.kind].append((entry.is_correct, entry.is_as_good, confidence))
            entries.append(entry)
        return PageContent(predictions=entries)

    for _ in range(9):
        take_part(database, enrol_somebody(database, study=DRIVING), probe=predict)
    rows = overview(database, study=DRIVING).predictions
    assert rows is not None
    assert [(row.experiment, row.kind, row.n) for row in rows] == [("1", kind, 18) for kind in KINDS]
    for row in rows:
        entries = made[row.kind]
        assert math.isclose(row.share_right, statistics.fmean(right for right, _, _ in entries))
        assert math.isclose(row.share_as_good, statistics.fmean(good for _, good, _ in entries))
        assert math.isclose(row.mean_confidence, statistics.fmean(confidence for *_, confidence in entries))
        assert row.share_right <= row.share_as_good
        for level, expected in zip(row.calibration, range(1, 6), strict=True):
            right = [right for right, _, confidence in entries if confidence == expected]
            assert (level.confidence, level.n, level.num_right) == (expected, len(right), sum(right))
            assert level.share_right == (statistics.fmean(right) if right else None)
        assert row.calibration[2].share_right is None


def test_drives_are_summed_up_by_kind_before_and_after_the_explanation(database: Database) -> None:
    ends: Iterator[DriveEnd] = iter(random.Random(2).choices(["reached", "gave_up", "step_limit"], k=1000))
    lengths = iter(random.Random(3).choices(range(7, 11), k=1000))
    made: list[tuple[int, Page, DriveEnd, int]] = []
    for _ in range(4):
        participant = enrol_somebody(database, study=DRIVING)
        for page in take_part_in_drives(database, participant):
            made.append((participant.id, page, next(ends), next(lengths)))
            finish_drive(database, participant, page, *made[-1][2:])
    rows = overview(database, study=DRIVING).drives
    assert rows is not None
    assert [(row.experiment, row.kind) for row in rows] == [("1", kind) for kind in KINDS]
    for row in rows:
        own = [drive for drive in made if drive[1].trial is not None and drive[1].trial.kind == row.kind]
        for phase, found in (("before", row.before), ("after", row.after)):
            of_phase = [(end, length) for _, page, end, length in own if DRIVEN[page.kind] == phase]
            assert (found.n, found.num_reached) == (len(of_phase), [end for end, _ in of_phase].count("reached"))
            extra = [length - 7 for end, length in of_phase if end == "reached"]
            assert found.extra_steps == (statistics.fmean(extra) if extra else None)
        reached = {(who, page.kind): end == "reached" for who, page, end, _ in own}
        people = {who for who, kind in reached if kind == "first_drive"}
        gains = [reached[who, "drive"] - reached[who, "first_drive"] for who in people]
        assert row.num_pairs == len(people) == (4 if row.kind == "tailored_all" else 0)
        assert row.gain == (statistics.fmean(gains) if gains else None)
    assert (rows[1].before.n, rows[1].before.share_reached) == (0, None)


def test_who_drove_only_before_the_explanation_has_no_gain(database: Database) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    (page,) = [page for page in pages_of(database, participant, DRIVING) if page.kind == "first_drive"]
    walk(database, participant, page.number, study=DRIVING)
    rows = overview(database, study=DRIVING).drives
    assert rows is not None
    (row,) = [row for row in rows if row.kind == "tailored_all"]
    assert (row.before.n, row.after.n, row.num_pairs, row.gain) == (1, 0, 0, None)


@pytest.mark.parametrize(("before", "after", "gain"), [(0, 1, 1.0), (1, 0, -1.0), (1, 1, 0.0)])
def test_a_gain_is_the_difference_of_the_shares(database: Database, before: int, after: int, gain: float) -> None:
    participant = enrol_somebody(database, study=DRIVING)
    for page in take_part_in_drives(database, participant):
        arrives = {"first_drive": before, "drive": after, "practice": 0}[page.kind]
        finish_drive(database, participant, page, "reached" if arrives else "gave_up", 9)
    rows = overview(database, study=DRIVING).drives
    assert rows is not None
    assert [row.gain for row in rows] == [gain, None, None]


def take_part(database: Database, participant: Participant, probe: Callable[[Page], PageContent]) -> None:
    """Send every page; `probe` makes the predictions."""
    for page in pages_of(database, participant, DRIVING):
        content = probe(page) if page.kind == "probe" else content_of(page, study=DRIVING)
        assert send(database, participant, page.number, study=DRIVING, content=content) == "accept"


def take_part_in_drives(database: Database, participant: Participant) -> Iterator[Page]:
    """Send every page but the drives, which whoever asks for them has to finish."""
    for page in pages_of(database, participant, DRIVING):
        if page.kind in DRIVEN:
            yield page
        else:
            store_page(
                database, participant, page, f"{participant.id} {page.number}", content_of(page, study=DRIVING), NOW
            )


def finish_drive(database: Database, participant: Participant, page: Page, end: DriveEnd, num_steps: int) -> None:
    content = PageContent(drive=drive(page, end, num_steps))
    for number in range(1, num_steps):
        store_step(database, participant, page, DriveStep(number, "left", None), NOW)
    last, nonce = DriveStep(num_steps, "left", None), f"{participant.id} {page.number}"
    assert store_last_step(database, participant, page, nonce, last, content, NOW) == "accept"


def test_ratings_are_not_mixed_with_those_of_other_items(database: Database) -> None:
    participant = enrol_somebody(database)
    walk(database, participant, 2)
    page = pages_of(database, participant)[2]
    given = ratings_of(["likeliness", "loveliness", "general"], 1)
    values = {"likeliness": 1, "loveliness": 3, "general": 5}
    store_page(database, participant, page, "n", PageContent(ratings=replace(given, values=values)), NOW)
    rows = overview(database).ratings
    assert rows is not None
    assert {row.item: row.mean for row in rows} == values
