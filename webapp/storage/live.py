"""The dashboard's numbers, kept up to date: each look reads only what is new, however many participants there are."""

import threading
from dataclasses import dataclass
from datetime import datetime, timedelta

from webapp.storage.database import Database
from webapp.storage.live_details import read_details
from webapp.storage.live_flow import (
    arm_flows,
    cell_uses,
    cells,
    counts,
    drop_out_tests,
    focus_count,
    funnel,
    page_times,
    rule_counts,
    stalled,
    unvalidated,
)
from webapp.storage.live_numbers import (
    Cell,
    FocusCount,
    FunnelStep,
    Numbers,
    PageTime,
    State,
    UnvalidatedLanguage,
)
from webapp.storage.live_outcomes import DriveSummary, PredictionSummary, RatingSummary
from webapp.storage.live_person_numbers import PeoplePage, PersonLine, PersonNumbers
from webapp.storage.live_results import drive_summaries, prediction_summaries, rating_summaries
from webapp.storage.live_scopes import ScopePeople
from webapp.storage.live_summaries import PersonSummary, microseconds, to_time
from webapp.storage.records import Head
from webapp.storage.scope import Scope
from webapp.study.protocol import Study
from webapp.study.quality import Flag

MOST_SCOPES = 8
"""How many scopes are kept; the one that was looked at longest ago goes first."""

_MINUTE = 60_000_000


@dataclass(frozen=True, slots=True)
class _Settled:
    """The numbers that change only when somebody does something, and the version of the tally that they are from."""

    version: int
    funnel: tuple[FunnelStep, ...]
    cells: tuple[Cell, ...]
    page_times: tuple[PageTime, ...]
    focus: FocusCount
    ratings: tuple[RatingSummary, ...]
    predictions: tuple[PredictionSummary, ...]
    drives: tuple[DriveSummary, ...]
    unvalidated: tuple[UnvalidatedLanguage, ...]


class LiveNumbers:
    """The numbers of every scope that somebody looks at. One per program; threads may share it.

    A scope names a study's version, and a version never changes: the study of the first look is taken to be that of
    every later one.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._lock = threading.Lock()
        self._scopes: dict[Scope, ScopePeople] = {}
        self._settled: dict[Scope, _Settled] = {}

    def overview(self, study: Study, scope: Scope, now: datetime) -> Numbers:
        """Return what the dashboard shows of everybody together.

        Args:
            study: The study of the scope's version.
            scope: Whose data.
            now: Who is stalled depends on it.
        """
        with self._lock:
            here, latest = self._refreshed(study, scope)
            silent_before = _silent_before(study, now)
            known = self._settled.get(scope)
            if known is None or known.version != here.version:
                known = self._settled[scope] = _settle(here)
            return _numbers(here, scope, latest, known, silent_before)

    def people(
        self,
        study: Study,
        scope: Scope,
        now: datetime,
        *,
        state: State | None = None,
        flagged: bool | None = None,
        search: str = "",
        page: int = 1,
        per_page: int = 50,
    ) -> PeoplePage:
        """Return a page of the list of participants, the latest arrivals first.

        Args:
            study: The study of the scope's version.
            scope: Whose data.
            now: Who is stalled depends on it.
            state: Only those who are there; None for all.
            flagged: Only those whom a declared rule flags, or only the others; None for all.
            search: A part of the code; blanks around it and its case do not matter.
            page: From 1; beyond the last one, the last one is meant.
            per_page: How many stand on a page, at least 1.
        """
        wanted = search.strip().lower()
        with self._lock:
            here, _ = self._refreshed(study, scope)
            silent_before = _silent_before(study, now)
            found = [
                person
                for person in here.people.values()
                if (state is None or person.state(silent_before) == state)
                and wanted in person.code
                and (flagged is None or bool(_flags(here, person, silent_before)) == flagged)
            ]
            found.sort(key=lambda person: person.id, reverse=True)
            num_pages = max(1, -(-len(found) // per_page))
            number = min(max(1, page), num_pages)
            shown = found[(number - 1) * per_page : number * per_page]
            lines = tuple(_line(here, person, silent_before) for person in shown)
        return PeoplePage(lines, len(found), number, num_pages)

    def person(
        self, study: Study, scope: Scope, code: str, now: datetime, *, blind: bool = False
    ) -> PersonNumbers | None:
        """Return everything about one participant; None if there is no such one in the scope.

        Args:
            study: The study of the scope's version.
            scope: Whose data.
            code: The public code.
            now: Whether they are stalled depends on it.
            blind: Whether to leave out the kinds of their trials and what would tell them at once.
        """
        with self._lock:
            here, _ = self._refreshed(study, scope)
            silent_before = _silent_before(study, now)
            known = next((person for person in here.people.values() if person.code == code), None)
            if known is None:
                return None
            line, flags = _line(here, known, silent_before), _flags(here, known, silent_before)
        with self._database.read() as connection:
            return read_details(connection, study, known, line, flags, blind=blind)

    def _refreshed(self, study: Study, scope: Scope) -> tuple[ScopePeople, Head]:
        here = self._scopes.pop(scope, None) or ScopePeople(self._database, study, scope)
        self._scopes[scope] = here
        if len(self._scopes) > MOST_SCOPES:
            oldest = next(iter(self._scopes))
            del self._scopes[oldest]
            self._settled.pop(oldest, None)
        return here, here.refresh()


def _settle(here: ScopePeople) -> _Settled:
    plans, tally = here.plans, here.tally
    return _Settled(
        version=here.version,
        funnel=funnel(plans, tally),
        cells=cells(plans, tally),
        page_times=page_times(tally),
        focus=focus_count(tally),
        ratings=rating_summaries(plans, tally),
        predictions=prediction_summaries(plans, tally),
        drives=drive_summaries(plans, tally),
        unvalidated=unvalidated(plans, tally),
    )


def _numbers(here: ScopePeople, scope: Scope, latest: Head, settled: _Settled, silent_before: int) -> Numbers:
    plans, tally = here.plans, here.tally
    silent = stalled(tally, silent_before)
    flows = arm_flows(plans, tally, silent)
    return Numbers(
        head=latest,
        scope=scope,
        funnel=settled.funnel,
        counts=counts(tally, silent),
        cells=settled.cells,
        arms=flows,
        drop_out=drop_out_tests(plans, flows),
        arrangements=cell_uses(plans, tally, silent),
        page_times=settled.page_times,
        quality=rule_counts(plans, tally, silent),
        focus=settled.focus,
        ratings=settled.ratings,
        predictions=settled.predictions,
        drives=settled.drives,
        unvalidated=settled.unvalidated,
        num_elsewhere=here.num_elsewhere,
    )


def _silent_before(study: Study, now: datetime) -> int:
    return microseconds(now - timedelta(minutes=study.lease_minutes))


def _flags(here: ScopePeople, person: PersonSummary, silent_before: int) -> tuple[Flag, ...]:
    is_stalled = person.state(silent_before) == "stalled"
    if is_stalled and here.plans.study.quality.incomplete:
        return (*person.flags, Flag("incomplete", None, None))
    return person.flags


def _line(here: ScopePeople, person: PersonSummary, silent_before: int) -> PersonLine:
    return PersonLine(
        code=person.code,
        state=person.state(silent_before),
        progress=person.num_stored,
        num_pages=person.num_pages,
        consented_at=to_time(person.consented),
        last_seen=to_time(person.last_seen),
        minutes=(person.last_seen - person.consented) / _MINUTE,
        flags=tuple(flag.rule for flag in _flags(here, person, silent_before)),
        excluded=here.excluded.get(person.id),
        is_late=person.is_late,
    )
