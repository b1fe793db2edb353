"""The page of one participant: where they are, what happened, what they saw and answered, what was decided."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from flask import abort, render_template, request
from flask.typing import ResponseReturnValue

from webapp.storage.live_person_numbers import PersonNumbers
from webapp.storage.participants import Participant, find_trials
from webapp.storage.people import MAX_REASON_LENGTH, PersonError, find_person
from webapp.storage.timeline import TimelineEntry, timeline
from webapp.storage.unblinding import is_person_unblinded
from webapp.study.experiments import Item
from webapp.study.session import pages
from webapp.views.researcher.door import bp, researcher
from webapp.views.researcher.frame import look, look_at_person
from webapp.views.researcher.person_pictures import shown_to
from webapp.views.researcher.sentences import sentence
from webapp.views.researcher.words import PAGES, STATES, flag_words, seconds_words
from webapp.views.services import services

_OF_PEOPLE = frozenset({"participant", "system"})


@dataclass(frozen=True, slots=True)
class Correctable:
    """A value that can be corrected.

    Attributes:
        key: File, page and question, for the form.
        words: What it is, and what was given.
    """

    key: str
    words: str


@dataclass(frozen=True, slots=True)
class Moment:
    """A line of the timeline.

    Attributes:
        first: The number of its first record.
        at: When.
        actor: Who.
        words: What happened.
        is_decision: Whether a researcher did it.
        num_left_window: How often the window was left on the page that was sent.
    """

    first: int
    at: datetime
    actor: str
    words: str
    is_decision: bool
    num_left_window: int


@bp.get("/people/<code>")
def person(code: str) -> ResponseReturnValue:
    """Show one participant."""
    return show_person(code)


def show_person(code: str, problem: tuple[str, str] | None = None, link: str | None = None) -> str:
    """Render the page of a participant.

    Args:
        code: The public code.
        problem: The name of the form that cannot be used as it is, and why; what was typed stays in it.
        link: A personal link that was made just now.
    """
    known = find_or_404(code)
    here, found = services(), look_at_person(known)
    sees = sees_pictures(known)
    told = here.live.person(found.study, found.scope, code, here.clock(), blind=not sees)
    if told is None:
        abort(404)
    practice, shown = shown_to(known) if sees else ((), ())
    happened = timeline(here.database, code)
    return render_template(
        "researcher/person.html",
        person=known,
        told=told,
        state=STATES[told.line.state],
        moments=_moments(happened, () if sees else _pages_of_trials(known), sees=sees),
        released={entry.page for entry in happened if entry.action == "page_released"},
        correctables=_correctables(told, sees=sees),
        sees=sees,
        practice=practice,
        shown=shown,
        problem=problem,
        link=link,
        form=request.form,
        page_name=lambda visit: page_name(visit.kind, visit.trial, sees=sees),
        flag_words=flag_words,
        seconds=seconds_words,
        max_reason_length=MAX_REASON_LENGTH,
    )


def find_or_404(code: str) -> Participant:
    """Return a participant; who was erased is nobody."""
    try:
        return find_person(services().database, code)
    except PersonError:
        abort(404)


def sees_pictures(known: Participant) -> bool:
    """Tell whether this account may see what a participant was shown."""
    may = researcher().may("owner")
    return may and (look().mask.is_open or is_person_unblinded(services().database, researcher().name, known))


def page_name(kind: str, trial: int | None, *, sees: bool) -> str:
    """Return what stands on a page. Arms differ in their pages, so those of trials have no names while blind."""
    return PAGES[kind] if sees or trial is None else "Page of a trial"


def _pages_of_trials(known: Participant) -> frozenset[int]:
    planned = pages(look().study, find_trials(services().database, known))
    return frozenset(page.number for page in planned if page.trial is not None)


def _moments(entries: Sequence[TimelineEntry], hidden: Collection[int], *, sees: bool) -> Sequence[Moment]:
    """Put entries into words; the actions of a drive that follow one another become one line.

    Args:
        entries: What happened.
        hidden: The pages on which nothing is told of how the agent was steered.
        sees: Whether pages of trials have names.
    """
    moments: list[Moment] = []
    drive: list[TimelineEntry] = []
    for entry in (*(entry for entry in entries if _is_told(entry, hidden)), None):
        if entry is not None and entry.action == "acted" and (not drive or drive[0].page == entry.page):
            drive.append(entry)
            continue
        if drive:
            moments.append(_drive_moment(drive))
        drive = [entry] if entry is not None and entry.action == "acted" else []
        if entry is not None and not drive:
            moments.append(_moment(entry, sees=sees))
    return moments


def _is_told(entry: TimelineEntry, hidden: Collection[int]) -> bool:
    """Leave out what is hidden, and the empty page that a release stores, because the release itself is told."""
    if entry.action == "acted":
        return entry.page not in hidden
    return entry.action != "sent" or entry.actor in _OF_PEOPLE


def _moment(entry: TimelineEntry, *, sees: bool) -> Moment:
    words = sentence(entry.action, entry.page, entry.part, entry.detail, sees=sees)
    if entry.action == "sent" and entry.page_kind is not None and (sees or entry.page_kind in _BEFORE_TRIALS):
        words = f"{words}: {PAGES[entry.page_kind].lower()}"
    return Moment(entry.number, entry.at, entry.actor, words, entry.actor not in _OF_PEOPLE, entry.away)


def _drive_moment(drive: Sequence[TimelineEntry]) -> Moment:
    first, last = drive[0], drive[-1]
    told = f"action {first.part}" if first.part == last.part else f"actions {first.part} to {last.part}"
    words = f"steered the agent on page {first.page}, {told}"
    return Moment(first.number, last.at, first.actor, words, is_decision=False, num_left_window=0)


_BEFORE_TRIALS = frozenset({"background", "instructions", "practice", "quiz"})


def _correctables(told: PersonNumbers, *, sees: bool) -> Sequence[Correctable]:
    """Return what can be corrected; while blind answers alone, because what was asked in trials tells their kinds."""
    latest: dict[tuple[int, str], Any] = {(answer.page, answer.question): answer for answer in told.answers}
    found = [
        Correctable(f"answers|{page}|{question}", f"Page {page}, {question.replace('_', ' ')}: {answer.answer}")
        for (page, question), answer in latest.items()
    ]
    if not sees:
        return found
    experiments = {trial.number: look().study.experiment(trial.experiment) for trial in told.trials}
    for given in told.ratings:
        asked = (*experiments[given.trial].items, Item(id=given.item))  # One of the satisfaction scale is in no study.
        points = next(item.points for item in asked if item.id == given.item)
        where = f"Page {given.page}, trial {given.trial}, {given.item.replace('_', ' ')} (1 to {points})"
        found.append(Correctable(f"ratings|{given.page}|{given.item}", f"{where}: {given.rating}"))
    for guess in told.predictions:
        where = f"Page {guess.page}, trial {guess.trial}, prediction {guess.question}"
        found.append(Correctable(f"probes|{guess.page}|{guess.question}", f"{where}: {guess.predicted}"))
    return found
