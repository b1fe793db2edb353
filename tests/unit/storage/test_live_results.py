import math
import random
import statistics
from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from scipy import stats
from sqlalchemy import and_, select

from tests.unit.storage.histories import EVERYTHING, History
from tests.unit.storage.people import (
    DRIVING,
    STUDY,
    content_of,
    drive,
    enrol_somebody,
    pages_of,
    prediction,
    send,
    walk,
)
from tests.unit.storage.test_live_flow import overview
from webapp.storage.database import Database
from webapp.storage.live import LiveNumbers
from webapp.storage.live_outcomes import MeanEstimate, Share
from webapp.storage.live_results import mean_of, share_of
from webapp.storage.participants import Participant
from webapp.storage.people import exclusion_states
from webapp.storage.tables import drives, pages, participants, predictions, ratings, trials
from webapp.study.answers import DriveEnd, PageContent
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.protocol import Study

_TWICE = DRIVING.experiments[0].model_copy(update={"kinds": ("placebic", "none")})
TWICE: Study = DRIVING.model_copy(update={"experiments": (_TWICE,)})
"""Three layouts and two kinds: everybody sees one kind twice."""


@pytest.mark.parametrize("seed", range(3))
def test_after_any_history_the_results_are_what_the_rows_of_those_not_excluded_say(
    database: Database, seed: int
) -> None:
    history = History(database, random.Random(200 + seed))
    history.happen(400)
    found = LiveNumbers(database).overview(history.study, history.scope, history.now)
    rows = {table.name: joined(database, history, table) for table in (ratings, predictions, drives)}
    assert {(r.kind, r.item): r.n for r in found.ratings} == {
        key: len(group) for key, group in grouped(rows["ratings"], "kind", "item").items()
    }
    for rating in found.ratings:
        given = grouped(rows["ratings"], "kind", "item")[rating.kind, rating.item]
        means = [statistics.mean(r.rating for r in own) for own in grouped(given, "code").values()]
        assert rating.n_people == len(means)
        assert rating.mean == pytest.approx(statistics.mean(means))
        if rating.sd:
            expected = stats.t.interval(0.95, len(means) - 1, loc=rating.mean, scale=stats.sem(means))
            assert (rating.lower, rating.upper) == pytest.approx(expected)
        assert (rating.sd or 0) == pytest.approx(statistics.stdev(means) if len(means) > 1 else 0)
    assert {(told.kind,) for told in found.predictions} == grouped(rows["predictions"], "kind").keys()
    for predicted in found.predictions:
        made = grouped(rows["predictions"], "kind")[predicted.kind,]
        check_share(predicted.right, [(row.code, row.is_correct) for row in made])
        check_share(predicted.as_good, [(row.code, row.is_as_good) for row in made])
        assert predicted.mean_confidence == pytest.approx(statistics.mean(row.confidence for row in made))
        for entry in predicted.calibration:
            sure = [row.is_correct for row in made if row.confidence == entry.confidence]
            assert (entry.n, entry.num_right) == (len(sure), sum(sure))
    assert {(told.kind,) for told in found.drives} == grouped(rows["drives"], "kind").keys()
    for driven in found.drives:
        check_drives(driven, grouped(rows["drives"], "kind")[driven.kind,])


def joined(database: Database, history: History, table: Any) -> list[Any]:  # noqa: ANN401
    on_page = and_(pages.c.participant_id == table.c.participant_id, pages.c.number == table.c.page_number)
    on_trial = and_(trials.c.participant_id == pages.c.participant_id, trials.c.number == pages.c.trial_number)
    query = (
        select(participants.c.code, trials.c.kind, trials.c.number.label("trial"), table)
        .select_from(table.join(pages, on_page).join(trials, on_trial).join(participants))
        .where(history.scope.of(participants))
    )
    with database.read() as connection:
        excluded = exclusion_states(connection, history.scope)
        return [row for row in connection.execute(query).all() if row.participant_id not in excluded]


def grouped(rows: Sequence[Any], *names: str) -> dict[tuple[Any, ...], list[Any]]:
    found: dict[tuple[Any, ...], list[Any]] = {}
    for row in rows:
        found.setdefault(tuple(getattr(row, name) for name in names), []).append(row)
    return found


def check_share(share: Share, given: Sequence[tuple[str, bool]]) -> None:
    people: dict[str, list[bool]] = {}
    for code, counts in given:
        people.setdefault(code, []).append(counts)
    mean = sum(counts for _, counts in given) / len(given)
    assert (share.n, share.n_people) == (len(given), len(people))
    assert share.share == pytest.approx(mean)
    residuals = [sum(counts) - mean * len(counts) for counts in people.values()]
    if len(given) == len(people) or not any(abs(residual) > 1e-12 for residual in residuals):
        expected = stats.binomtest(sum(c for _, c in given), len(given)).proportion_ci(method="wilson")
        assert share.method == "wilson"
        if len(given) == len(people):
            assert (share.lower, share.upper) == pytest.approx((expected.low, expected.high))
        return
    assert share.method == "cluster"
    size = len(people)
    error = math.sqrt(size / (size - 1) * sum(residual**2 for residual in residuals)) / len(given)
    expected_ends = (max(0, mean - 1.959964 * error), min(1, mean + 1.959964 * error))
    assert (share.lower, share.upper) == pytest.approx(expected_ends, abs=1e-6)


def check_drives(driven: Any, rows: Sequence[Any]) -> None:  # noqa: ANN401
    for phase, of_phase in (("before", driven.before), ("after", driven.after)):
        there = [row for row in rows if row.phase == phase]
        assert (of_phase.reached is None) == (not there)
        if there:
            check_share(of_phase.reached, [(row.code, row.end == "reached") for row in there])
        extra = [row.num_steps - row.optimum for row in there if row.end == "reached"]
        assert (of_phase.extra_steps is None) == (not extra)
        if extra:
            assert of_phase.extra_steps.mean == pytest.approx(statistics.mean(extra))
    gains = []
    for own in grouped(rows, "code", "trial").values():
        ends = {row.phase: row.end == "reached" for row in own}
        if len(ends) == 2:
            gains.append(ends["after"] - ends["before"])
    assert (driven.gain is None) == (not gains)
    if gains:
        assert (driven.gain.n, driven.gain.mean) == (len(gains), pytest.approx(statistics.mean(gains)))


def test_a_persons_several_ratings_of_one_kind_and_item_are_averaged_first(database: Database) -> None:
    people = [enrol_somebody(database, study=TWICE) for _ in range(6)]
    for person in people:
        rate(database, person, [5, 1, 1] if person is people[0] else [2, 2, 2], TWICE)
    found = overview(database, TWICE).ratings
    for rating in found:
        assert rating.n_people == 6
        assert rating.n in (9, 8, 10)
    twice = next(rating for rating in found if rating.n > rating.n_people)
    assert twice.lower is not None
    assert twice.lower < twice.mean < (twice.upper or 0)


def rate(database: Database, person: Participant, values: Sequence[int], study: Study) -> None:
    for page in pages_of(database, person, study):
        value = values[page.trial.position - 1] if page.trial is not None else 3
        assert send(database, person, page.number, value, study=study) == "accept"


def test_one_person_has_a_mean_and_neither_spread_nor_interval(database: Database) -> None:
    rate(database, enrol_somebody(database), [4] * 3, STUDY)
    for rating in overview(database).ratings:
        assert (rating.mean, rating.sd, rating.lower, rating.upper) == (4.0, None, None, None)


def test_ratings_come_in_the_order_of_the_study_with_the_satisfaction_scale_last(database: Database) -> None:
    person = enrol_somebody(database, study=EVERYTHING)
    for page in pages_of(database, person, EVERYTHING):
        send(database, person, page.number, study=EVERYTHING, content=History(database, random.Random(1)).content(page))
        if page.kind == "quiz":
            assert overview(database, EVERYTHING).ratings == ()
    found = overview(database, EVERYTHING).ratings
    experiment = EVERYTHING.experiments[0]
    expected = [
        (kind, item)
        for kind in experiment.kinds
        for item in (*(i.id for i in experiment.items_for(kind)), *(SATISFACTION_ITEMS if kind != "none" else ()))
    ]
    if found:  # The quiz may have screened the person out.
        assert [(rating.kind, rating.item) for rating in found] == expected
        assert {rating.points for rating in found if rating.is_satisfaction} == {5}


def test_drives_before_and_after_are_told_apart_and_their_gain_is_over_pairs(database: Database) -> None:
    ends: tuple[tuple[DriveEnd, DriveEnd], ...] = (("gave_up", "reached"), ("reached", "reached"))
    for before, after in ends:
        person = enrol_somebody(database, study=DRIVING)
        for page in pages_of(database, person, DRIVING):
            content = content_of(page, 3, DRIVING)
            if content.drive is not None and page.kind != "practice":
                content = replace(content, drive=drive(page, before if page.kind == "first_drive" else after))
            assert send(database, person, page.number, study=DRIVING, content=content) == "accept"
    for driven in overview(database, DRIVING).drives:
        assert driven.after.reached is not None
        assert (driven.after.reached.num, driven.after.reached.n, driven.after.reached.method) == (2, 2, "wilson")
        if driven.before.reached is not None:
            assert driven.before.reached.num == 1
            assert driven.gain is not None
            assert (driven.gain.n, driven.gain.mean) == (2, 0.5)
    assert any(driven.gain for driven in overview(database, DRIVING).drives)


def test_predictions_on_a_scale_of_confidence_are_all_counted(database: Database) -> None:
    person = enrol_somebody(database, study=DRIVING)
    for page in pages_of(database, person, DRIVING):
        content = content_of(page, 3, DRIVING)
        if page.kind == "probe":
            content = PageContent(predictions=[prediction(1, "left", 5), prediction(2, "right", 1, is_as_good=True)])
        assert send(database, person, page.number, study=DRIVING, content=content) == "accept"
    for row in overview(database, DRIVING).predictions:
        assert (row.right.n, row.right.num, row.as_good.num, row.right.n_people) == (2, 1, 2, 1)
        assert row.mean_confidence == 3
        assert [(entry.n, entry.share_right) for entry in row.calibration] == [
            (1, 0.0),
            (0, None),
            (0, None),
            (0, None),
            (1, 1.0),
        ]


def test_a_share_without_any_spread_between_people_gets_the_interval_of_people() -> None:
    all_right = share_of([(3, 3, 10)])
    assert all_right is not None
    assert (all_right.n, all_right.n_people, all_right.method, all_right.upper) == (30, 10, "wilson", 1.0)
    assert all_right.lower == pytest.approx(stats.binomtest(10, 10).proportion_ci(method="wilson").low)


def test_nothing_given_is_no_estimate() -> None:
    assert share_of([]) is None
    assert share_of([(0, 0, 4)]) is None
    assert mean_of([(0, 0, 4)]) is None
    assert mean_of([(7, 2, 1)]) == MeanEstimate(2, 1, 3.5, None, None)


def test_results_grow_with_those_who_are_still_under_way(database: Database) -> None:
    walk(database, enrol_somebody(database), 3)
    found = overview(database, later=timedelta(days=2).total_seconds())
    assert {rating.n for rating in found.ratings} == {1}
