"""The pages on which participants steer the agent, and explanations that are made from how they did."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from flask import Blueprint, Response, flash, jsonify, request, url_for

from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.world_table import WorldTable
from webapp.storage.answers import Outcome, drive_actions, store_last_step, store_page, store_step
from webapp.study.answers import DriveEnd, DriveResult, DriveStep, PageContent
from webapp.study.events import parse_events
from webapp.study.experiments import TAILORED_KINDS
from webapp.study.questionnaire import measured_time
from webapp.study.session import DRIVEN, NoSuchPageError, Page, Trial
from webapp.views.answering import go_to, wants_json
from webapp.views.forms import refusal_of
from webapp.views.services import services
from webapp.views.texts import texts
from webapp.views.visit import Visit, load_visit, place_of

bp = Blueprint("driving", __name__)

GIVE_UP = "give_up"


@dataclass(frozen=True, slots=True)
class Driving:
    """A drive as far as it has come.

    Attributes:
        world: Where it takes place.
        from_step: The step of the agent's path from whose state it starts, from 1.
        actions: The actions so far.
        step_limit: How many there may be.
        phase: `practice`, `before` or `after` the explanation.
    """

    world: WorldTable
    from_step: int
    actions: Sequence[str]
    step_limit: int
    phase: Literal["practice", "before", "after"]

    @property
    def start(self) -> int:
        """The state in which it begins."""
        return self.world.path_states[self.from_step - 1]

    @property
    def states(self) -> Sequence[int]:
        """The states visited, the first and the present one included."""
        return self.world.roll_out(self.start, self.actions)

    @property
    def end(self) -> DriveEnd | None:
        """How it has ended by itself, or None while it goes on."""
        if self.world.is_terminal(self.states[-1]):
            return "reached" if self.world.is_goal(self.states[-1]) else "failed"
        return "step_limit" if len(self.actions) >= self.step_limit else None

    def result(self, end: DriveEnd) -> DriveResult:
        """Return what is stored of it."""
        optimum = self.world.optimum(self.start)
        assert optimum is not None  # noqa: S101 - for the type checker: the goal of every layout can be reached
        return DriveResult(
            phase=self.phase,
            layout=self.world.layout,
            end=end,
            num_steps=len(self.actions),
            optimum=optimum,
            step_limit=self.step_limit,
            subgoals_passed=self.world.subgoals_passed(self.from_step, self.actions),
            key_points=self.world.key_points(self.from_step, self.actions),
        )


@bp.post("/study/<int:number>/action")
def drive_on(number: int) -> Response:
    """Store one action, or the wish to give up; an action that is stored already changes nothing."""
    visit = load_visit()
    page = visit.page(number)
    if page.kind not in DRIVEN:
        raise NoSuchPageError(f"page {number} is no drive")
    refusal = refusal_of(request.form, visit, page, attempt=1)
    if refusal is not None:
        if not visit.participant.was_ended_early:
            flash(refusal)
        return go_to(place_of(visit.participant))
    driving = _driving(visit, page)
    outcome, ended = _store(visit, page, driving, request.form)
    is_news = outcome != "accept" and not _is_its_own_echo(driving, request.form)
    if outcome != "accept" and not wants_json():
        flash("already_answered" if outcome == "already_answered" else "too_early")
    if ended is not None and outcome == "accept":
        flash("practice_over" if driving.phase == "practice" else f"drive_{ended}")
    now = load_visit()
    place = place_of(now.participant)
    if wants_json() and place == url_for("participant.show_page", number=number):
        shown = _shown(now, _driving(now, page))
        said = {"message": texts()("notices.already_answered")} if is_news else {}
        return jsonify(shown | said | {"stands": is_news})
    return go_to(place)


def drive_context(visit: Visit, page: Page, _form: Mapping[str, str], _problems: object) -> dict[str, Any]:
    """Return what a page shows of the drive on it."""
    t, driving = texts(), _driving(visit, page)
    return {
        "drive": _shown(visit, driving),
        "phase": driving.phase,
        "heading": t(_HEADINGS[driving.phase]),
        "lead": t(_LEADS[driving.phase]),
        "pad": {action: t(key) for action, key in _BUTTONS.items()},
        "own_pad": _own_pad(visit, driving.world),
    }


@dataclass(frozen=True, slots=True)
class OwnButton:
    """A button of a world of the study's own.

    Attributes:
        action: The name of its action.
        label: What the study calls it.
        key: The key that presses it; None beyond the ninth.
    """

    action: str
    label: str
    key: str | None


def _own_pad(visit: Visit, world: WorldTable) -> tuple[OwnButton, ...]:
    """Return the buttons of a world of the study's own, in the order of its actions; none for a key-door layout."""
    if not _is_own(visit, world):
        return ()
    return tuple(
        OwnButton(action, _label(visit, action), str(number) if number <= _NUM_KEYS else None)
        for number, action in enumerate(world.actions, start=1)
    )


def _is_own(visit: Visit, world: WorldTable) -> bool:
    return world.layout in visit.catalogue.study.worlds


def _label(visit: Visit, action: str) -> str:
    name = visit.catalogue.action_name(action, visit.language)
    return name[:1].upper() + name[1:]


_NUM_KEYS = 9
"""The digits that press a button."""

_SENTENCE = "pictures.sentence"
"""The text that makes a sentence of words."""


def explanation_of(visit: Visit, trial: Trial) -> dict[str, Any]:
    """Return a trial's explanation as pages show it; a tailored one answers the participant's own drive."""
    if trial.kind not in TAILORED_KINDS:
        strips = () if trial.kind == "none" else visit.catalogue.explanation(trial, visit.language)
        return {"strips": strips, "remark": texts()("explanation.placebic") if trial.kind == "placebic" else None}
    page = next(page for page in visit.pages if page.trial == trial and page.kind == "first_drive")
    driving = _driving(visit, page)
    key_points = driving.world.key_points(driving.from_step, driving.actions)
    remark = "missing" if key_points else "arrived" if driving.end == "reached" else "nothing_missing"
    return {
        "strips": visit.catalogue.explanation(trial, visit.language, key_points),
        "remark": texts()(_REMARKS[remark]),
    }


_HEADINGS = {"practice": "drive.title_practice", "before": "drive.title_before", "after": "drive.title_after"}
_LEADS = {"practice": "drive.lead_practice", "before": "drive.lead_before", "after": "drive.lead_after"}
_BUTTONS = {
    "forward": "drive.buttons.forward",
    "left": "drive.buttons.left",
    "right": "drive.buttons.right",
    "pickup": "drive.buttons.pickup",
    "toggle": "drive.buttons.toggle",
}
_DEEDS = {
    "forward": "drive.did.forward",
    "left": "drive.did.left",
    "right": "drive.did.right",
    "pickup": "drive.did.pickup",
    "toggle": "drive.did.toggle",
}
_REMARKS = {
    "missing": "tailored.missing",
    "arrived": "tailored.arrived",
    "nothing_missing": "tailored.nothing_missing",
}


def _driving(visit: Visit, page: Page) -> Driving:
    actions = drive_actions(services().database, visit.participant, page.number)
    layout, from_step, factor = _course(visit.catalogue, page)
    world = visit.catalogue.world(layout)
    optimum = world.optimum(world.path_states[from_step - 1])
    assert optimum is not None  # noqa: S101 - for the type checker: the goal of every layout can be reached
    return Driving(world, from_step, actions, math.ceil(optimum * factor), DRIVEN[page.kind])


def _course(catalogue: Catalogue, page: Page) -> tuple[str, int, float]:
    """Return the layout of a drive, the step of the agent's path at which it starts, and how long it may be."""
    if page.trial is None:
        practice = catalogue.study.practice
        assert practice is not None  # noqa: S101 - for the type checker: without the section there is no such page
        return practice.layout, 1, practice.steps_per_optimal_step
    drive = catalogue.study.experiment(page.trial.experiment).drive
    assert drive is not None  # noqa: S101 - for the type checker: without the section there is no such page
    return page.trial.layout, catalogue.from_step(page.trial), drive.steps_per_optimal_step


def _store(visit: Visit, page: Page, driving: Driving, form: Mapping[str, str]) -> tuple[Outcome, DriveEnd | None]:
    here, action = services(), form.get("action", "")
    logs_behaviour = visit.catalogue.study.behaviour_log is not None
    events = parse_events(form.get("events", ""), behaviour=logs_behaviour)
    if action == GIVE_UP:
        content = PageContent(drive=driving.result("gave_up"), events=events)
        return store_page(here.database, visit.participant, page, form["nonce"], content, here.clock()), "gave_up"
    number = form.get("step", "")
    if action not in driving.world.actions or not re.fullmatch(r"[0-9]{1,6}", number):
        return "too_early", None
    step = DriveStep(int(number), action, measured_time(form.get("elapsed", "")))
    if step.number != len(driving.actions) + 1:
        return "already_answered" if step.number <= len(driving.actions) else "too_early", None
    after = Driving(driving.world, driving.from_step, (*driving.actions, action), driving.step_limit, driving.phase)
    if after.end is None:
        return store_step(here.database, visit.participant, page, step, here.clock()), None
    content = PageContent(drive=after.result(after.end), events=events)
    outcome = store_last_step(here.database, visit.participant, page, form["nonce"], step, content, here.clock())
    return outcome, after.end


def _is_its_own_echo(driving: Driving, form: Mapping[str, str]) -> bool:
    """Tell whether an action is the latest one once more, as after its answer got lost; then there is no news."""
    actions = driving.actions
    return bool(actions) and form.get("step") == str(len(actions)) and form.get("action") == actions[-1]


def _shown(visit: Visit, driving: Driving) -> dict[str, Any]:
    """Return a drive as a script wants it."""
    t, world, states = texts(), driving.world, driving.states
    view = visit.catalogue.view(world.layout, states[-1], visit.language)
    neighbours = {world.next_state(states[-1], action) for action in world.actions} - {states[-1]}
    views = [visit.catalogue.view(world.layout, state, visit.language) for state in sorted(neighbours)]
    return {
        "step": len(driving.actions) + 1,
        "picture": url_for("participant.picture", digest=view.digest),
        "alt": view.alt,
        "message": _message(visit, driving),
        "steps_left": t.plural("drive.steps_left", driving.step_limit - len(driving.actions)),
        "preload": [url_for("participant.picture", digest=frame.digest) for frame in views],
        "next": None,
    }


def _message(visit: Visit, driving: Driving) -> str:
    """Say what happened last. Actions of a study's own worlds are named as on their buttons."""
    t, states = texts(), driving.states
    if not driving.actions:
        return t("drive.start")
    if states[-1] == states[-2]:
        return t("drive.in_vain")
    action = driving.actions[-1]
    if _is_own(visit, driving.world):
        return t(_SENTENCE, text=_label(visit, action))
    return t(_DEEDS[action])
