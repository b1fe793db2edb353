"""Read summaries of participants, a few hundred in one short transaction: a long one would hold up who is answering."""

from array import array
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise
from typing import Any

from sqlalchemy import Connection, FromClause, Integer, Select, and_, case, cast, func, select

from webapp.storage.answers import RATED_PAGES
from webapp.storage.live_plans import CellKey, Plan, Plans
from webapp.storage.live_summaries import DRIVE_NUMBERS, End, PersonSummary, microseconds
from webapp.storage.scope import Scope
from webapp.storage.tables import (
    answers,
    arrangements,
    drives,
    events,
    pages,
    participants,
    predictions,
    ratings,
    recruits,
    trials,
)
from webapp.study.quality import PersonFacts, judge, judged_rules

_MICROSECONDS = 1_000_000
_ATTENTION, _QUIZ = "attention", "quiz"


@dataclass(frozen=True, slots=True)
class Decided:
    """What is known of participants from elsewhere than their own rows, by the rows' numbers.

    Attributes:
        excluded: Who is excluded.
        released: Whom a researcher let go on without some pages, and which.
        duplicates: Whose recruiter's id or session stands elsewhere in the live data too.
    """

    excluded: Collection[int] = frozenset()
    released: Mapping[int, Collection[int]] = field(default_factory=dict)
    duplicates: Collection[int] = frozenset()


@dataclass(slots=True)
class _Rows:
    """The rows of one participant, as they are read."""

    cells: list[CellKey] = field(default_factory=list)
    places: list[tuple[str, int, int]] = field(default_factory=list)
    submitted: list[datetime] = field(default_factory=list)
    ratings: list[tuple[int, int, str, int]] = field(default_factory=list)
    predictions: list[tuple[int, int, bool, bool]] = field(default_factory=list)
    drives: list[tuple[int, str, bool, int]] = field(default_factory=list)
    checks: list[bool] = field(default_factory=list)
    quiz: list[tuple[int, bool]] = field(default_factory=list)
    is_recruited: bool = False
    num_left_window: int = 0


def read_summaries(
    connection: Connection, plans: Plans, scope: Scope, ids: Sequence[int], decided: Decided
) -> Iterator[PersonSummary]:
    """Yield the summaries of those of some participants who are there and belong to the scope.

    Args:
        connection: A transaction.
        plans: Of the study version.
        scope: Whose data.
        ids: The rows' numbers, at most some hundreds.
        decided: What is known of them from elsewhere.
    """
    for person, rows in read_rows(connection, scope, ids):
        yield _summary(plans, person, rows, decided)


def read_facts(
    connection: Connection,
    plans: Plans,
    scope: Scope,
    ids: Sequence[int],
    decided: Decided,
    *,
    silent_before: datetime | None = None,
) -> Iterator[tuple[str, PersonFacts]]:
    """Yield the public code and what the exclusion rules look at.

    Args:
        connection: A transaction.
        plans: Of the study version.
        scope: Whose data.
        ids: The rows' numbers, at most some hundreds.
        decided: What is known of them from elsewhere.
        silent_before: Whoever may still go on and gave no sign of life since then counts as not having finished, as on
            the dashboard; None to leave open whether any of these will finish.
    """
    for person, rows in read_rows(connection, scope, ids):
        facts = _facts(plans, person, rows, decided)
        is_stalled = silent_before is not None and person.last_seen_at < silent_before
        yield person.code, replace(facts, is_complete=False) if is_stalled and facts.is_complete is None else facts


def read_rows(connection: Connection, scope: Scope, ids: Sequence[int]) -> Iterator[tuple[Any, _Rows]]:
    """Yield the rows of some participants, each with everything that is summarised of them, in order of arrival."""
    query = select(participants).where(scope.of(participants), participants.c.id.in_(ids)).order_by(participants.c.id)
    people = connection.execute(query).all()
    found = {person.id: _Rows() for person in people}
    for who, *cell in connection.execute(_trials(found)):
        found[who].cells.append(tuple(cell))
    for who, *place in connection.execute(_of(arrangements, found, "experiment", "arrangement", "layout_order")):
        found[who].places.append(tuple(place))
    for who, submitted_at in connection.execute(_of(pages, found, "submitted_at")):
        found[who].submitted.append(submitted_at)
    for who, trial, *rating in connection.execute(_in_trials(ratings, found, "page_number", "item", "rating")):
        found[who].ratings.append((trial, *rating))
    for who, *told in connection.execute(_in_trials(predictions, found, "confidence", "is_correct", "is_as_good")):
        found[who].predictions.append(tuple(told))
    for (who,) in connection.execute(_of(recruits, found)):
        found[who].is_recruited = True
    _read_drives(connection, found)
    _read_answers(connection, found)
    _read_events(connection, found)
    for person in people:
        yield person, found[person.id]


def _read_drives(connection: Connection, found: Mapping[int, _Rows]) -> None:
    extra = (drives.c.num_steps - drives.c.optimum).label("extra")
    reached = case((drives.c.end == "reached", 1), else_=0)
    query = _in_trials(drives, found, "phase").add_columns(reached, extra)
    for who, trial, phase, has_reached, extra_steps in connection.execute(query):
        found[who].drives.append((trial, phase, bool(has_reached), extra_steps))


def _read_answers(connection: Connection, found: Mapping[int, _Rows]) -> None:
    """Read whether checks were answered rightly, and of the quiz which attempts were right as a whole."""
    all_right = func.min(cast(answers.c.is_correct, Integer))
    query = (
        select(answers.c.participant_id, answers.c.attempt, all_right)
        .where(answers.c.participant_id.in_(found), answers.c.purpose == _QUIZ)
        .group_by(answers.c.participant_id, answers.c.page_number, answers.c.attempt)
    )
    for who, attempt, is_right in connection.execute(query):
        found[who].quiz.append((attempt, bool(is_right)))
    checks = _of(answers, found, "is_correct").where(answers.c.purpose == _ATTENTION)
    for who, is_right in connection.execute(checks):
        found[who].checks.append(bool(is_right))


def _read_events(connection: Connection, found: Mapping[int, _Rows]) -> None:
    query = (
        select(events.c.participant_id, func.count())
        .where(events.c.participant_id.in_(found), events.c.event == "focus_lost")
        .group_by(events.c.participant_id)
    )
    for who, num_left_window in connection.execute(query):
        found[who].num_left_window = num_left_window


def _of(table: FromClause, found: Mapping[int, _Rows], *columns: str) -> Select[Any]:
    named = (table.c.participant_id, *(table.c[name] for name in columns))
    return select(*named).where(table.c.participant_id.in_(found)).order_by(*table.primary_key)


def _trials(found: Mapping[int, _Rows]) -> Select[Any]:
    return _of(trials, found, "experiment", "kind", "layout")


def _in_trials(table: FromClause, found: Mapping[int, _Rows], *columns: str) -> Select[Any]:
    """Select columns of a table that belongs to pages, after the participant and the trial; only what is in trials."""
    on_page = and_(pages.c.participant_id == table.c.participant_id, pages.c.number == table.c.page_number)
    return (
        select(table.c.participant_id, pages.c.trial_number, *(table.c[name] for name in columns))
        .join(pages, on_page)
        .where(table.c.participant_id.in_(found), pages.c.trial_number.is_not(None))
    )


def _summary(plans: Plans, person: Any, rows: _Rows, decided: Decided) -> PersonSummary:  # noqa: ANN401 - a row
    plan = plans.plan(tuple(rows.cells))
    facts = _facts(plans, person, rows, decided)
    quality = plans.study.quality
    return PersonSummary(
        id=person.id,
        code=person.code,
        language=plans.shared(person.language),
        plan=plan,
        places=plans.shared(tuple(rows.places)),
        num_stored=len(rows.submitted),
        num_pages=person.num_pages,
        consented=microseconds(person.consented_at),
        last_seen=microseconds(person.last_seen_at),
        end=_end(person),
        holds_place=person.slot_released_at is None,
        is_late=person.returned_late_at is not None,
        is_excluded=person.id in decided.excluded,
        times=array("q", [number for timed in _times(plans, person, rows, decided) for number in timed]),
        num_left_window=rows.num_left_window,
        ratings=_ratings(plans, plan, rows),
        predictions=_predictions(plans, plan, rows),
        confidences=_confidences(plans, plan, rows),
        drives=_drives(plans, plan, rows),
        flags=judge(quality, facts),
        judged=plans.shared(judged_rules(quality, facts)),
    )


def _end(person: Any) -> End | None:  # noqa: ANN401 - a row
    if person.completed_at is not None:
        return "completed"
    if person.withdrawn_at is not None:
        return "withdrawn"
    return None if person.screened_out_at is None else "screened_out"


def _times(plans: Plans, person: Any, rows: _Rows, decided: Decided) -> Iterator[tuple[int, int]]:  # noqa: ANN401
    """Yield number and microseconds of the pages that count: not those with a longer break, nor those let go."""
    released = decided.released.get(person.id, ())
    moments = [microseconds(time) for time in (person.consented_at, *rows.submitted)]
    for number, (before, after) in enumerate(pairwise(moments), start=1):
        if number not in released and after - before <= plans.study.lease_minutes * 60 * _MICROSECONDS:
            yield number, after - before


def _facts(plans: Plans, person: Any, rows: _Rows, decided: Decided) -> PersonFacts:  # noqa: ANN401 - a row
    plan, end = plans.plan(tuple(rows.cells)), _end(person)
    is_over = person.completed_at is not None
    quiz_is_over = plan.quiz_page is not None and len(rows.submitted) >= plan.quiz_page and bool(rows.quiz)
    was_let_go = plan.quiz_page in decided.released.get(person.id, ())
    return PersonFacts(
        total_s=(person.completed_at - person.consented_at).total_seconds() if is_over else None,
        rating_page_s=tuple(
            time / _MICROSECONDS
            for number, time in _times(plans, person, rows, decided)
            if plan.page_kinds[number - 1] in RATED_PAGES
        ),
        num_rating_pages=len({page for _, page, _, _ in rows.ratings}),
        num_items=len({item for _, _, item, _ in rows.ratings}),
        ratings=frozenset(value for *_, value in rows.ratings),
        num_checks=len(rows.checks),
        num_failed_checks=rows.checks.count(False),
        failed_quiz=not max(rows.quiz)[1] if quiz_is_over and not was_let_go else None,
        is_duplicate=person.id in decided.duplicates if rows.is_recruited else None,
        is_complete=None if end is None else end == "completed",
    )


def _ratings(plans: Plans, plan: Plan, rows: _Rows) -> "array[int]":
    sums: dict[int, list[int]] = {}
    for trial, _, item, value in rows.ratings:
        entry = sums.setdefault(plans.rating_place(plan.arms[trial - 1], item), [0, 0])
        entry[0] += value
        entry[1] += 1
    return array("i", [number for place, entry in sums.items() for number in (place, *entry)])


def _predictions(plans: Plans, plan: Plan, rows: _Rows) -> "array[int]":
    sums: dict[int, list[int]] = {}
    for trial, _, is_right, is_as_good in rows.predictions:
        entry = sums.setdefault(plans.arm_place(plan.arms[trial - 1]), [0, 0, 0])
        for place, number in enumerate((1, is_right, is_as_good)):
            entry[place] += number
    return array("i", [number for place, entry in sums.items() for number in (place, *entry)])


def _confidences(plans: Plans, plan: Plan, rows: _Rows) -> "array[int]":
    told = ((plans.arm_place(plan.arms[trial - 1]), sure, right) for trial, sure, right, _ in rows.predictions)
    return array("i", [int(number) for entry in told for number in entry])


def _drives(plans: Plans, plan: Plan, rows: _Rows) -> "array[int]":
    sums: dict[int, list[int]] = {}
    of_trial: dict[int, dict[str, bool]] = {}
    for trial, phase, has_reached, extra_steps in rows.drives:
        entry = sums.setdefault(plans.arm_place(plan.arms[trial - 1]), [0] * (DRIVE_NUMBERS - 1))
        start = 0 if phase == "before" else 3
        for place, number in enumerate((1, has_reached, extra_steps if has_reached else 0), start=start):
            entry[place] += number
        of_trial.setdefault(trial, {})[phase] = has_reached
    for trial, reached in of_trial.items():
        if len(reached) > 1:
            entry = sums[plans.arm_place(plan.arms[trial - 1])]
            entry[6] += 1
            entry[7] += reached["after"] - reached["before"]
    return array("i", [number for place, entry in sums.items() for number in (place, *entry)])
