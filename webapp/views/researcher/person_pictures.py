"""What one participant saw, exactly: the pictures of their own bundle, explanations made for them, their drives."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from flask import g

from webapp.stimuli.catalogue import Frame, Situation, Strip
from webapp.storage.answers import drive_actions
from webapp.storage.participants import Participant, find_trials
from webapp.study.session import DRIVEN, Page, Trial, pages
from webapp.views.driving import explanation_of
from webapp.views.researcher.frame import look
from webapp.views.services import services
from webapp.views.visit import Visit

_PHASES = {"practice": "Practice", "before": "Drive before the explanation", "after": "Drive after the explanation"}


@dataclass(frozen=True, slots=True)
class ShownDrive:
    """A drive, picture by picture.

    Attributes:
        name: Which one.
        page: The number of its page.
        strip: The views, with what the participant did between them.
    """

    name: str
    page: int
    strip: Strip


@dataclass(frozen=True, slots=True)
class ShownTrial:
    """What somebody saw in one trial, as far as they came.

    Attributes:
        number: From 1, over all experiments.
        trial: The trial.
        situation: What was shown first; None before they came there.
        strips: The explanation; None before they came there.
        remark: What stood above it, if anything.
        probes: The views about which they predicted.
        drives: Their drives.
    """

    number: int
    trial: Trial
    situation: Situation | None
    strips: Sequence[Strip] | None
    remark: str | None
    probes: Sequence[Frame]
    drives: Sequence[ShownDrive]


def shown_to(person: Participant) -> tuple[Sequence[ShownDrive], Sequence[ShownTrial]]:
    """Return the practice drive, if there was one, and what was shown in each trial."""
    catalogue = look().catalogue
    trials = find_trials(services().database, person)
    visit = Visit(person, catalogue, pages(catalogue.study, trials))
    last = person.num_stored + (1 if person.is_in_progress else 0)
    reached = [page for page in visit.pages if page.number <= last]
    practice = tuple(_drives(visit, [page for page in reached if page.trial is None]))
    g.language = person.language  # What stands with the pictures is in the words that they read.
    try:
        shown = tuple(_shown(visit, number, trial, reached) for number, trial in enumerate(trials, start=1))
    finally:
        g.language = "en"
    return practice, shown


def _shown(visit: Visit, number: int, trial: Trial, reached: Sequence[Page]) -> ShownTrial:
    theirs = [page for page in reached if page.trial == trial]
    kinds = {page.kind for page in theirs}
    catalogue, explained = visit.catalogue, None
    if kinds & {"explanation", "rating", "satisfaction"}:
        explained = explanation_of(visit, trial)
    asked = catalogue.probes(trial.experiment, trial.layout) if "probe" in kinds else ()
    return ShownTrial(
        number=number,
        trial=trial,
        situation=catalogue.situation(trial, visit.language) if theirs else None,
        strips=None if explained is None else explained["strips"],
        remark=None if explained is None else explained["remark"],
        probes=[catalogue.view(trial.layout, probe.state, visit.language) for probe in asked],
        drives=tuple(_drives(visit, theirs)),
    )


def _drives(visit: Visit, theirs: Sequence[Page]) -> Iterator[ShownDrive]:
    catalogue, language = visit.catalogue, visit.language
    for page in theirs:
        if page.kind not in DRIVEN:
            continue
        actions = drive_actions(services().database, visit.participant, page.number)
        layout, from_step = _course(visit, page)
        world = catalogue.world(layout)
        states = world.roll_out(world.path_states[from_step - 1], actions)
        frames = tuple(catalogue.view(layout, state, language) for state in states)
        names = tuple(catalogue.action_name(action, language) for action in actions)
        yield ShownDrive(_PHASES[DRIVEN[page.kind]], page.number, Strip(frames, names))


def _course(visit: Visit, page: Page) -> tuple[str, int]:
    if page.trial is not None:
        return page.trial.layout, visit.catalogue.from_step(page.trial)
    practice = visit.catalogue.study.practice
    assert practice is not None  # noqa: S101 - for the type checker: without the section there is no such page
    return practice.layout, 1
