import random
import statistics
from collections import Counter
from collections.abc import Sequence
from datetime import timedelta
from itertools import pairwise
from typing import Any

import pytest
from sqlalchemy import Table, select

from tests.unit.storage.histories import EVERYTHING, History
from tests.unit.storage.people import (
    DRIVING,
    NOW,
    STUDY,
    enrol_somebody,
    page_of_kind,
    pages_of,
    send,
    walk,
    walk_to,
)
from webapp.storage.database import Database
from webapp.storage.helping import release_page
from webapp.storage.ledger import release_abandoned
from webapp.storage.live import LiveNumbers
from webapp.storage.live_numbers import Numbers, UnvalidatedLanguage
from webapp.storage.live_plans import Plans
from webapp.storage.live_reading import Decided, read_facts
from webapp.storage.participants import find_trials, withdraw
from webapp.storage.people import exclude, include
from webapp.storage.scope import Mode, Scope
from webapp.storage.tables import arrangements, events, pages, participants, trials
from webapp.study.answers import Answer, Event, PageContent
from webapp.study.attrition import compare_drop_out
from webapp.study.experiments import Drive
from webapp.study.protocol import Study
from webapp.study.recruitment import Recruit
from webapp.study.sections import Quality
from webapp.study.session import Trial
from webapp.study.session import pages as all_pages


def overview(database: Database, study: Study = STUDY, mode: Mode = "test", later: float = 0) -> Numbers:
    """Everything, so many minutes after the consents."""
    scope = Scope(study.name, "v1", mode)
    return LiveNumbers(database).overview(study, scope, NOW + timedelta(minutes=later))


def judged(
    database: Database, rules: Quality, study: Study = STUDY, mode: Mode = "test", later: float = 0
) -> dict[str, tuple[int, int]]:
    """By rule, how many are flagged and how many judged."""
    found = overview(database, study.model_copy(update={"quality": rules}), mode, later).quality
    return {count.rule: (count.num_flagged, count.num_judged) for count in found}


@pytest.mark.parametrize("seed", range(4))
def test_after_any_history_the_numbers_are_what_the_rows_say(database: Database, seed: int) -> None:
    history = History(database, random.Random(100 + seed))
    history.happen(350)
    history.now += timedelta(minutes=history.chooser.choice((0, 30, 59)))
    found = LiveNumbers(database).overview(history.study, history.scope, history.now)
    people = persons(database, history)
    states = Counter(state(person, history) for person in people)
    assert found.counts.arrived == len(people)
    assert found.counts.in_progress == states["open"]
    for name in ("stalled", "completed", "withdrawn", "screened_out"):
        assert getattr(found.counts, name) == states[name]
    assert found.counts.excluded == len(history.excluded)
    assert {(cell.experiment, cell.kind, cell.layout): cell.assigned for cell in found.cells if cell.assigned} == (
        Counter(cell(trial) for person in people for trial in person["trials"])
    )
    check_arms(found, people, history)
    check_places(found, people, history)
    check_times(found, people, history)
    left = sum(any(event.event == "focus_lost" for event in person["events"]) for person in people)
    assert (found.focus.num_left_window, found.focus.num_people) == (left, sum(bool(p["pages"]) for p in people))


def persons(database: Database, history: History) -> list[dict[str, Any]]:
    with database.read() as connection:
        rows = connection.execute(select(participants).where(history.scope.of(participants))).all()

        def of(table: Table, person: int) -> Sequence[Any]:
            query = select(table).where(table.c.participant_id == person).order_by(*table.primary_key)
            return connection.execute(query).all()

        tables = (trials, pages, events, arrangements)
        return [{"row": row} | {table.name: of(table, row.id) for table in tables} for row in rows]


def state(person: dict[str, Any], history: History) -> str:
    row = person["row"]
    for name in ("completed", "withdrawn", "screened_out"):
        if getattr(row, f"{name}_at") is not None:
            return name
    lease = timedelta(minutes=history.study.lease_minutes)
    return "stalled" if row.last_seen_at < history.now - lease else "open"


def cell(trial: Any) -> tuple[str, str, str]:  # noqa: ANN401
    return trial.experiment, trial.kind, trial.layout


def check_arms(found: Numbers, people: list[dict[str, Any]], history: History) -> None:
    started, finished, dropped = Counter[str](), Counter[str](), Counter[str]()
    for person in people:
        own = [Trial(t.experiment, t.position, t.num_trials, t.layout, t.kind, t.draw) for t in person["trials"]]
        due = {page.number: page for page in all_pages(history.study, own)}
        for number, trial in enumerate(own, start=1):
            numbers = [page.number for page in due.values() if page.trial == trial]
            sent = [page for page in person["pages"] if page.trial_number == number]
            was_reached = len(person["pages"]) >= min(numbers) - 1 and state(person, history) != "screened_out"
            is_done = len(sent) == len(numbers)
            started[trial.kind] += was_reached
            finished[trial.kind] += is_done
            dropped[trial.kind] += was_reached and not is_done and state(person, history) in ("withdrawn", "stalled")
    for arm in found.arms:
        assert (arm.started, arm.finished, arm.dropped) == (started[arm.kind], finished[arm.kind], dropped[arm.kind])
    expected = compare_drop_out([arm.started for arm in found.arms], [arm.dropped for arm in found.arms], seed=2021)
    assert [test.p_value for test in found.drop_out] == ([] if expected is None else [expected.p_value])


def check_places(found: Numbers, people: list[dict[str, Any]], history: History) -> None:
    for use in found.arrangements:
        theirs = [
            person
            for person in people
            if any(
                (given.experiment, given.arrangement, given.layout_order)
                == (use.experiment, use.arrangement, use.layout_order)
                for given in person["arrangements"]
            )
        ]
        states = Counter(state(person, history) for person in theirs)
        assert (use.uses, use.completed) == (len(theirs), states["completed"])
        assert use.counted == sum(person["row"].slot_released_at is None for person in theirs)
        assert use.dropped == states["withdrawn"] + states["stalled"] + states["screened_out"]
    assert sum(use.uses for use in found.arrangements) == len(people)


def check_times(found: Numbers, people: list[dict[str, Any]], history: History) -> None:
    by_kind: dict[str, list[float]] = {}
    for person in people:
        released = {page.number for page in person["pages"] if len(page.nonce) == 32}
        times = [person["row"].consented_at, *(page.submitted_at for page in person["pages"])]
        for page, (before, after) in zip(person["pages"], pairwise(times), strict=True):
            if after - before <= timedelta(minutes=history.study.lease_minutes) and page.number not in released:
                by_kind.setdefault(page.kind, []).append((after - before).total_seconds())
    assert {row.page_kind: row.n for row in found.page_times} == {kind: len(times) for kind, times in by_kind.items()}
    for row in found.page_times:
        assert row.median_s == pytest.approx(statistics.median(by_kind[row.page_kind]))
        if row.n > 1:
            lower, _, upper = statistics.quantiles(by_kind[row.page_kind], method="inclusive")
            assert (row.lower_quartile_s, row.upper_quartile_s) == pytest.approx((lower, upper))


def test_the_funnel_goes_from_consent_to_completion_and_never_up(database: Database) -> None:
    for last in (0, 1, 3, 4, 11, 11):
        walk(database, enrol_somebody(database), last)
    found = overview(database)
    names = [step.name for step in found.funnel]
    assert names[:2] == ["gave consent", "read the instructions"]
    assert names[2:] == [
        *(f"finished trial {number} of 3 of experiment 1" for number in (1, 2, 3)),
        "finished trial 1 of 2 of experiment 2",
        "completed the study",
    ]
    assert [step.count for step in found.funnel] == [6, 5, 4, 2, 2, 2, 2]
    assert [step.of_previous for step in found.funnel] == [None, 5 / 6, 4 / 5, 1 / 2, 1, 1, 1]


def test_whoever_is_screened_out_did_not_pass_the_quiz_and_started_no_trial(database: Database) -> None:
    people = [enrol_somebody(database, study=DRIVING) for _ in range(3)]
    for person in people[:2]:
        page = walk_to(database, person, "quiz", DRIVING)
        wrong = Answer("goal", "key", is_correct=False)
        failed = PageContent(answers=[wrong], failed=True, screens_out=person is people[0])
        send(database, person, page.number, study=DRIVING, content=failed)
    found = overview(database, DRIVING)
    steps = {step.name: step.count for step in found.funnel}
    assert (steps["finished the practice"], steps["passed the quiz"]) == (2, 1)
    assert (found.counts.screened_out, found.counts.in_progress) == (1, 2)
    assert sum(arm.started for arm in found.arms) == 1


def test_a_drop_out_is_put_down_to_the_trial_in_which_it_happened(database: Database) -> None:
    person = enrol_somebody(database)
    kinds = [trial.kind for trial in find_trials(database, person)]
    walk(database, person, 3)  # The instructions and the first trial.
    withdraw(database, person, NOW)
    found = overview(database)
    assert [(arm.kind, arm.finished) for arm in found.arms if arm.finished] == [(kinds[0], 1)]
    assert [(arm.kind, arm.started) for arm in found.arms if arm.dropped] == [(kinds[1], 1)]
    assert sum(arm.started for arm in found.arms) == 2
    assert {arm.share_dropped for arm in found.arms} == {0.0, 1.0, None}


def test_whoever_leaves_before_the_trials_or_completes_drops_out_of_none(database: Database) -> None:
    early, done = (enrol_somebody(database) for _ in range(2))
    withdraw(database, early, NOW)
    walk(database, done, 11)
    found = overview(database, later=10**6)
    assert sum(arm.dropped for arm in found.arms) == 0
    assert sum(arm.finished for arm in found.arms) == sum(arm.started for arm in found.arms) == 5
    assert found.drop_out == ()


def test_a_place_given_back_counts_for_the_balance_no_more(database: Database) -> None:
    enrol_somebody(database)
    with database.write() as connection:
        scope = Scope(STUDY.name, "v1", "test")
        release_abandoned(connection, scope, STUDY.lease_minutes, NOW + timedelta(days=1))
    uses = overview(database, later=10**4).arrangements
    assert sum(use.uses for use in uses) == 2
    assert sum(use.counted for use in uses) == 0
    assert sum(use.dropped for use in uses) == 2
    assert len(uses) == 6 + 2


def test_breaks_and_pages_let_go_are_no_time_of_working(database: Database) -> None:
    person = enrol_somebody(database)
    moments = (10, 25, 25 + 61 * 60, 25 + 61 * 60 + 7)
    for number, seconds in enumerate(moments, start=1):
        send(database, person, number, now=NOW + timedelta(seconds=seconds))
    page = pages_of(database, person)[4]
    release_page(database, person.code, page, "was stuck", "ada", NOW + timedelta(hours=2))
    found = {row.page_kind: row for row in overview(database).page_times}
    assert (found["instructions"].median_s, found["instructions"].n) == (10, 1)
    assert (found["situation"].median_s, found["situation"].n) == (11, 2)
    assert "rating" not in found


def test_exclusions_are_counted_and_leave_the_flow_as_it_is(database: Database) -> None:
    person = enrol_somebody(database)
    walk(database, person, 11)
    before = overview(database)
    exclude(database, person.code, "spoke of cheating", "ada", NOW)
    after = overview(database)
    assert (before.counts.excluded, after.counts.excluded) == (0, 1)
    assert (after.cells, after.arms, after.funnel) == (before.cells, before.arms, before.funnel)
    assert before.ratings
    assert after.ratings == ()
    include(database, person.code, "a misunderstanding", "ada", NOW)
    assert overview(database).ratings == before.ratings


def test_each_rule_counts_whom_it_flags_and_whom_it_can_judge(database: Database) -> None:
    people = [enrol_somebody(database) for _ in range(3)]
    for place, person in enumerate(people):
        for number in range(1, (11, 11, 5)[place] + 1):
            seconds = number * (2, 60, 2)[place]
            send(database, person, number, 1 + number % (1 + place), now=NOW + timedelta(seconds=seconds))
    rules = Quality(min_total_minutes=1, min_seconds_per_rating_page=3, straight_lining=True, incomplete=True)
    assert judged(database, rules) == {
        "min_total_minutes": (1, 2),
        "min_seconds_per_rating_page": (2, 3),
        "straight_lining": (2, 3),
        "incomplete": (0, 2),
    }
    assert judged(database, rules, later=120)["incomplete"] == (1, 3)
    withdraw(database, people[2], NOW + timedelta(minutes=1))
    assert judged(database, rules)["incomplete"] == (1, 3)


def test_a_quiz_counts_as_failed_when_it_is_left_without_a_right_attempt(database: Database) -> None:
    rules = Quality(failed_quiz=True)
    right, wrong = (Answer("goal", choice, is_correct=choice == "flag") for choice in ("flag", "key"))
    for attempts in ([right], [wrong, right], [wrong, wrong], [wrong]):
        person = enrol_somebody(database, study=DRIVING)
        page = walk_to(database, person, "quiz", DRIVING)
        for attempt, answer in enumerate(attempts, start=1):
            is_final = answer is right or attempt == 2
            content = PageContent(answers=[answer], attempt=attempt, is_final=is_final)
            assert send(database, person, page.number, study=DRIVING, content=content) == "accept"
    assert judged(database, rules, DRIVING) == {"failed_quiz": (1, 3)}
    release_page(database, person.code, page, "was stuck", "ada", NOW)
    assert judged(database, rules, DRIVING) == {"failed_quiz": (1, 3)}


def test_failed_attention_checks_are_counted_by_person(database: Database) -> None:
    rules = Quality(failed_attention_checks=1)
    person = enrol_somebody(database, study=EVERYTHING)
    check = EVERYTHING.attention_checks[0]
    for page in pages_of(database, person, EVERYTHING):
        answers = []
        if page.kind == "rating" and page.trial is not None and page.trial.position == check.trial:
            answers = [Answer(check.id, "5", is_correct=False)]
        history = History(database, random.Random(page.number))
        content = history.content(page)
        told = PageContent(content.ratings, answers, drive=content.drive, predictions=content.predictions)
        assert send(database, person, page.number, study=EVERYTHING, content=told) == "accept"
    assert judged(database, rules, EVERYTHING) == {"failed_attention_checks": (1, 1)}


def test_the_same_recruiter_id_or_session_in_another_study_is_a_duplicate_whoever_came_first(
    database: Database,
) -> None:
    other = STUDY.model_copy(update={"name": "other"})
    for study, recruit in (
        (other, Recruit("prolific", "a", None, "s1")),
        (STUDY, Recruit("prolific", "a", None, "s2")),
        (STUDY, Recruit("prolific", "b", None, "s1")),
        (STUDY, Recruit("prolific", "c", None, "s3")),
        (STUDY, Recruit("sona", "a", None, None)),
        (STUDY, None),
    ):
        enrol_somebody(database, "live", study=study, recruit=recruit)
    assert judged(database, Quality(duplicates=True), STUDY, "live") == {"duplicates": (2, 4)}
    assert judged(database, Quality(duplicates=True), other, "live") == {"duplicates": (1, 1)}


def test_somebody_elsewhere_can_make_a_duplicate_of_somebody_who_was_counted_already(database: Database) -> None:
    study = STUDY.model_copy(update={"quality": Quality(duplicates=True)})
    other = STUDY.model_copy(update={"name": "other"})
    recruit = Recruit("prolific", "a", None, None)
    enrol_somebody(database, "live", study=study, recruit=recruit)
    numbers, scope = LiveNumbers(database), Scope(study.name, "v1", "live")
    assert numbers.overview(study, scope, NOW).quality[0].num_flagged == 0
    enrol_somebody(database, "live", study=other, recruit=recruit)
    assert numbers.overview(study, scope, NOW).quality[0].num_flagged == 1


def test_bots_make_no_duplicates_of_people(database: Database) -> None:
    modes: tuple[Mode, ...] = ("live", "bot")
    for mode in modes:
        enrol_somebody(database, mode, recruit=Recruit("prolific", "a", None, None))
    assert judged(database, Quality(duplicates=True), STUDY, "live") == {"duplicates": (0, 1)}


def test_leaving_the_window_is_counted_and_is_no_rule(database: Database) -> None:
    for events_of_page in ([], [Event("focus_lost", "", "", 3)] * 4):
        person = enrol_somebody(database)
        send(database, person, 1, content=PageContent(events=events_of_page))
    enrol_somebody(database)
    found = overview(database)
    assert (found.focus.num_left_window, found.focus.num_people) == (1, 2)
    assert found.quality == ()


def test_languages_without_a_back_translation_are_named_with_their_readers(database: Database) -> None:
    for language in ("en", "ja", "ja"):
        enrol_somebody(database, study=DRIVING, language=language)
    enrol_somebody(database, "live", study=DRIVING, language="ja")
    assert overview(database, DRIVING).unvalidated == (UnvalidatedLanguage("ja", 2),)
    assert overview(database, DRIVING.model_copy(update={"languages": ("en",)})).unvalidated == ()


@pytest.mark.parametrize("when", ["before_ratings", "after_ratings", None])
def test_a_trial_is_done_with_its_last_page_whether_that_is_a_rating_or_not(
    database: Database, when: str | None
) -> None:
    (experiment,) = DRIVING.experiments
    drive = None if when is None else Drive(when=when)  # type: ignore[arg-type]
    items = tuple(item.model_copy(update={"without_explanation": False}) for item in experiment.items)
    changes = {"items": items, "kinds": ("none", "placebic", "subgoals"), "drive": drive}
    study = DRIVING.model_copy(update={"experiments": (experiment.model_copy(update=changes),), "attention_checks": ()})
    person = enrol_somebody(database, study=study)
    shown = pages_of(database, person, study)
    assert page_of_kind(database, person, "situation", study)
    for page in shown:
        send(database, person, page.number, study=study)
        finished = [
            trial.kind
            for trial in find_trials(database, person)
            if max(other.number for other in shown if other.trial == trial) <= page.number
        ]
        found = overview(database, study)
        assert sorted(cell.kind for cell in found.cells for _ in range(cell.done)) == sorted(finished)
        assert sorted(arm.kind for arm in found.arms for _ in range(arm.finished)) == sorted(finished)


def test_the_rules_files_may_count_the_silent_as_not_having_finished_too(database: Database) -> None:
    person = enrol_somebody(database)
    scope = Scope(STUDY.name, "v1", "test")
    walk(database, person, 3)
    for silent_before, expected in ((None, None), (NOW, None), (NOW + timedelta(seconds=1), False)):
        with database.read() as connection:
            ((code, facts),) = read_facts(
                connection, Plans(STUDY), scope, [person.id], Decided(), silent_before=silent_before
            )
        assert (code, facts.is_complete, facts.num_rating_pages) == (person.code, expected, 1)
