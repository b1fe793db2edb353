"""The open page on which anybody asks the agent about a route.

A question stands in the address of its page, all of it: a link shares it, and nothing is stored.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flask import Blueprint, Response, abort, g, render_template, request, url_for

from webapp.stimuli.asking import Answer, answer
from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.world_table import WorldTable
from webapp.study.protocol import Study
from webapp.study.routes import MAX_ROUTE_ACTIONS, RouteTooLongError, UnknownActionError, parse_route, write_route
from webapp.views.answering import go_to
from webapp.views.forms import FormError
from webapp.views.services import services
from webapp.views.texts import language, texts

bp = Blueprint("ask", __name__)

UNDO, CLEAR = "undo", "clear"
"""What the buttons send that take actions back; every other one sends the action that it adds."""

_PARTS = ("layout", "route", "from", "ask")
"""What of an address goes along into another language."""

_NAMED_LENGTH = 40
"""How much of a wrong input is repeated, in characters."""


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked.

    Attributes:
        world: Where the route is taken.
        from_step: The step of the agent's way from whose state it is taken, from 1.
        route: The names of its actions.
        asks: Whether the agent is to answer, or the route is still being made.
    """

    world: WorldTable
    from_step: int
    route: tuple[str, ...]
    asks: bool

    @property
    def states(self) -> Sequence[int]:
        """The states visited, up to the end of the episode."""
        return self.world.roll_out(self.world.state_of_step(self.from_step), self.route)

    @property
    def is_over(self) -> bool:
        """Whether the episode has ended."""
        return self.world.is_terminal(self.states[-1])

    @property
    def query(self) -> Mapping[str, str]:
        """The question as it stands in an address; what can be left out is."""
        said = {"layout": self.world.layout, "route": write_route(self.route)}
        said |= {"from": str(self.from_step)} if self.from_step > 1 else {}
        said |= {"ask": "yes"} if self.asks else {}
        return {name: value for name, value in said.items() if value}


@bp.get("/ask")
def ask() -> str | Response | tuple[str, int]:
    """Show the layouts, the route so far and, when asked, what the agent says about it."""
    catalogue = services().bundles.current
    if catalogue.study.ask is None:
        abort(404)
    speech = _speak(request.args.get("lang", ""), catalogue.study)
    layout, offered = request.args.get("layout", ""), _offered(catalogue.study)
    if not offered or (layout in catalogue.study.layouts and layout not in offered):
        return _refuse(layout if offered else "", speech), 404
    if layout not in offered:
        error = FormError("worlds", texts()("ask.errors.layout", value=_named(layout)))
        page = _render(catalogue, speech, None, [error] if layout else [])
        return (page, 422) if layout else page
    errors: list[FormError] = []
    question = _read(catalogue.world(layout), errors)
    if errors:
        return _render(catalogue, speech, question, errors), 422
    query = {**question.query, **speech}
    if sorted(request.args.items(multi=True)) != sorted(query.items()):
        return go_to(_address(query))
    return _render(catalogue, speech, question)


def _speak(chosen: str, study: Study) -> Mapping[str, str]:
    """Let the page have the language that its address names; return what of it the address of the next page has."""
    if chosen in study.languages:
        g.language = chosen
    return {"lang": chosen} if chosen else {}


def _offered(study: Study) -> tuple[str, ...]:
    """Return the layouts that may be asked about: in a live study none that participants are going to judge."""
    used = {layout for experiment in study.experiments for layout in experiment.layouts}
    kept_back = used if services().config.live else ()
    return tuple(layout for layout in study.layouts if layout not in kept_back)


def _refuse(layout: str, speech: Mapping[str, str]) -> str:
    """Say that a layout, or where none is named that any layout, is in use."""
    t = texts()
    message, back = t("ask.none_offered"), (url_for("arrival.welcome"), t("error_pages.begin"))
    if layout:
        message, back = t("ask.in_use", value=layout), (_address(speech), t("ask.title"))
    shown = {"title": t("ask.in_use_title"), "message": message, "back_url": back[0], "back_label": back[1]}
    return render_template("errors/error.html", status=404, **shown)


def _read(world: WorldTable, errors: list[FormError]) -> Question:
    """Read the question; what cannot be read adds an error and is left out."""
    from_step, press = _from_step(world, errors), request.args.get("action", "")
    route = () if press == CLEAR else _route(request.args.get("route", ""), world, errors)
    question = Question(world, from_step, route, asks=request.args.get("ask") == "yes")
    if not press or errors:
        return question
    if press == UNDO:
        return replace(question, route=route[:-1], asks=False)
    longer = route if press == CLEAR else _route(f"{write_route(route)} {press}", world, errors)
    return replace(question, route=longer or route, asks=False)


def _route(text: str, world: WorldTable, errors: list[FormError]) -> tuple[str, ...]:
    t = texts()
    try:
        return parse_route(text, world.actions, t)
    except UnknownActionError as error:
        errors.append(FormError("route", t("ask.errors.action", value=_named(error.word))))
    except RouteTooLongError as error:
        errors.append(FormError("route", t("ask.errors.too_long", number=error.num_actions, limit=MAX_ROUTE_ACTIONS)))
    return ()


def _from_step(world: WorldTable, errors: list[FormError]) -> int:
    given = request.args.get("from", "").strip() or "1"
    if re.fullmatch("[0-9]{1,6}", given) and 1 <= int(given) <= world.num_steps:
        return int(given)
    errors.append(FormError("from", texts()("ask.errors.step", value=_named(given), last=world.num_steps)))
    return 1


def _render(
    catalogue: Catalogue, speech: Mapping[str, str], question: Question | None, errors: Sequence[FormError] = ()
) -> str:
    kept = {name: value for name, value in request.args.items() if name in _PARTS}
    known, t = catalogue.study.languages, texts()
    is_strange = "lang" in speech and speech["lang"] not in known
    return render_template(
        "ask/ask.html",
        errors=errors,
        wrong={error.control: error.message for error in errors},
        notice=t("notices.language_unknown") if is_strange else None,
        chosen_language=None if is_strange else speech.get("lang"),
        language_links={code: _address({**kept, "lang": code}) for code in known},
        worlds=_worlds(catalogue, question, speech),
        question=None if question is None else _shown(catalogue, question, is_wrong=bool(errors)),
        answer=None if question is None or errors or not question.asks else _answered(catalogue, question),
    )


def _worlds(catalogue: Catalogue, question: Question | None, speech: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the layouts to choose from; a route that came without one is kept for the one that is chosen."""
    chosen = None if question is None else question.world.layout
    kept = {name: request.args[name] for name in ("route", "from") if chosen is None and name in request.args}
    return [
        {
            "name": layout,
            "title": texts()("ask.world", number=number),
            "view": catalogue.view(layout, catalogue.world(layout).start, language()),
            "address": _address({"layout": layout, **kept, **speech, "_anchor": "question"}),
            "is_chosen": layout == chosen,
        }
        for number, layout in enumerate(_offered(catalogue.study), start=1)
    ]


def _shown(catalogue: Catalogue, question: Question, *, is_wrong: bool) -> dict[str, Any]:
    """Return a question as the page shows it; one that is not understood with what was written."""
    t, world, states = texts(), question.world, question.states
    later = {step: t("ask.from_later", step=step) for step in range(2, world.num_steps + 1)}
    num_unused = len(question.route) - len(states) + 1
    return {
        "layout": world.layout,
        "route": request.args.get("route", "") if is_wrong else write_route(question.route),
        "starts": {1: t("ask.from_start"), **later},
        "from_step": question.from_step,
        "view": catalogue.view(world.layout, states[-1], language()),
        "message": t(_message(question)),
        "steps": [
            {"words": catalogue.action_name(action, language()), "note": _note(states, number)}
            for number, action in enumerate(question.route)
        ],
        "unused": t.plural("ask.unused", num_unused) if num_unused else None,
        "is_over": question.is_over,
    }


def _message(question: Question) -> str:
    """Return the key of the text that says what happened last."""
    states = question.states
    if question.world.is_goal(states[-1]):
        return "ask.at_goal"
    if not question.route:
        return "drive.start" if question.from_step == 1 else "ask.begun_later"
    return "drive.in_vain" if states[-1] == states[-2] else f"drive.did.{question.route[-1]}"


def _note(states: Sequence[int], number: int) -> str | None:
    """Return what is remarkable about an action, given by its place in the route, from 0; None for nothing."""
    if number + 1 >= len(states):
        return texts()("ask.step_unused")
    return texts()("ask.step_in_vain") if states[number] == states[number + 1] else None


def _answered(catalogue: Catalogue, question: Question) -> dict[str, Any]:
    """Return the agent's answer as the page shows it."""
    world, from_step = question.world, question.from_step
    found = answer(world, question.route, from_step)
    begin, *strips = catalogue.strips_of(world.layout, found.shown, language(), from_step)
    sentences = catalogue.sentences(world.layout, language())
    moments, number = [], 1 + len(begin.frames)
    for step, strip in zip(found.shown, strips, strict=True):
        moments.append(
            {
                "strip": strip,
                "first": number,
                "words": sentences[step],
                "is_explanation": step == found.explanation,
                "mark": _mark(found, step),
            }
        )
        number += len(strip.frames)
    return {
        "found": found,
        "verdict": _verdict(found),
        "lead": _lead(found),
        "begin": begin,
        "moments": moments,
        "strips": (begin, *strips),
        "passed": [sentences[step] for step in found.passed],
    }


def _verdict(found: Answer) -> list[str]:
    t = texts()
    if not found.reaches_goal:
        return [t("ask.not_reached")]
    return [t.plural("ask.reached", found.num_actions), t.plural("ask.agent_steps", found.num_agent_actions)]


def _lead(found: Answer) -> str:
    t = texts()
    if found.key_points:
        return t("ask.missing")
    return t("ask.subgoals") if found.reaches_goal else t("ask.nothing_missing")


def _mark(found: Answer, step: int) -> str:
    """Return what a moment is to the route, in words."""
    t = texts()
    if found.key_points:
        return t("ask.explanation") if step == found.explanation else t("ask.also_missing")
    return t("ask.on_route") if step in found.passed else t("ask.not_on_route")


def _address(query: Mapping[str, Any]) -> str:
    return url_for(".ask", **query)


def _named(value: str) -> str:
    return value if len(value) <= _NAMED_LENGTH else f"{value[:_NAMED_LENGTH]}…"
