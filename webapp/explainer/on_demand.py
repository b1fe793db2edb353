"""Answer one question about a map or an environment: prepare what it is about, then explain it."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from webapp.explainer import granularity
from webapp.explainer.abstraction import CoarseWorld
from webapp.explainer.explanation import Assess, Explanation, certain, explain
from webapp.explainer.importance import ProbabilityKind, exact_importance
from webapp.explainer.key_points import roll_out
from webapp.explainer.mdp import Policy
from webapp.explainer.questioner import check_size, mistaken_route
from webapp.explainer.requests import Request
from webapp.explainer.solvers import Trajectory, check_step
from webapp.explainer.subjects import MapSource, Source, Subject, prepare
from webapp.explainer.training_cache import ReportProgress
from webapp.explainer.worlds.key_door import ACTIONS, key_door_state

if TYPE_CHECKING:
    from webapp.explainer.learning import TrainingSettings
    from webapp.explainer.sampling import Sampled
    from webapp.explainer.worlds.key_door_abstractions import CoarseGranularity


@dataclass(frozen=True, slots=True)
class Coarse:
    """What a path was explained as.

    Attributes:
        world: The coarse world in which the explanation holds.
        path: The coarse path, with the steps that each coarse step covers.
    """

    world: CoarseWorld
    path: granularity.CoarsePath


@dataclass(frozen=True, slots=True)
class Answer:
    """An explanation with what it is about.

    Attributes:
        subject: The world, the policy and the path.
        explanation: Of that path, or of the coarse path that it amounts to.
        sampled: How the sampling went, where there was any.
        coarse: The coarse world and path, where the explanation is one of them.
        route: The actions, in the world's own steps, that were asked about, given or planned on a believed map.
        question: The same as a sentence; empty when nobody asks.
    """

    subject: Subject
    explanation: Explanation
    sampled: "Sampled | None" = None
    coarse: Coarse | None = None
    route: tuple[int, ...] | None = None
    question: str = ""


def answer(
    source: Source,
    request: Request,
    cache: Path,
    progress: ReportProgress,
    settings: "TrainingSettings | None" = None,
) -> Answer:
    """Explain the path of an agent.

    Torch is loaded only for what is learned or sampled.

    Args:
        source: A map or an environment.
        request: What is asked.
        cache: The folder in which trained networks are kept by content; it is made when needed.
        progress: Told how much of the training is done, from 0 to 1.
        settings: How to train; the settings' own defaults when left out.

    Raises:
        LayoutError: The goal of a map cannot be reached, or the believed map does not fit.
        NeverArrives: The policy does not lead to the goal.
        NotLearned: The networks did not learn the map within their budget.
        ValueError: There is no such step or action, or the environment cannot be explained.
    """
    _check_question(source, request)
    subject = prepare_for(source, request, cache, progress, settings)
    route = _route(subject, request)
    if request.granularity != "steps":
        return _coarse_answer(subject, request, route)
    sampled = _sample(subject, request) if request.estimator == "monte-carlo" else None
    explanation = explain(
        subject.world,
        subject.policy,
        _exactly(subject, request) if sampled is None else lambda path: sampled.importance,  # noqa: ARG005
        route,
        request.from_step,
        path=subject.path,
        rule=request.threshold,
        num_subgoals=request.num_subgoals,
    )
    return Answer(subject, explanation, sampled, None, route, _question(subject, request, route))


def prepare_for(
    source: Source,
    request: Request,
    cache: Path,
    progress: ReportProgress,
    settings: "TrainingSettings | None" = None,
) -> Subject:
    """Prepare what a request is about without explaining anything; see `answer`."""
    return prepare(
        source,
        request.world,
        request.policy,
        cache=cache,
        progress=progress,
        seed=request.seed,
        discount=request.discount,
        settings=settings,
    )


def _exactly(subject: Subject, request: Request) -> Assess:
    kind, world, policy = request.importance, subject.world, subject.policy
    return lambda path: exact_importance(kind, world, policy, path, request.r, request.discount)


def _sample(subject: Subject, request: Request) -> "Sampled":
    from webapp.explainer.sampling import sample, sample_recurrent  # noqa: PLC0415 - loads torch.
    from webapp.explainer.stop_rule import StopRule  # noqa: PLC0415 - with it.

    kind, path, rule = (
        cast("ProbabilityKind", request.importance),
        subject.path,
        StopRule(request.num_trials, request.stops_early),
    )
    if subject.agent is not None and request.world == "learned" and subject.policy.ndim == 1:
        model, policy = subject.agent.recurrent_model(), cast("Policy", subject.policy)
        return sample_recurrent(kind, model, certain(subject.world), policy, path, request.r, rule, request.seed)
    return sample(kind, subject.world, subject.policy, path, request.r, rule, request.seed)


def _coarse_answer(subject: Subject, request: Request, route: tuple[int, ...] | None) -> Answer:
    if not isinstance(subject.source, MapSource):
        raise ValueError(f"{request.granularity} are known for key-door maps only, not for {subject.source.name!r}")  # noqa: TRY004 - what is asked is at fault.
    level = cast("CoarseGranularity", request.granularity)
    coarse = granularity.coarse_world(subject.world, subject.source.layout, level)
    asked = None if route is None else _rolled_out(subject, request, route)
    found, explanation = granularity.explain_coarsely(
        coarse,
        subject.path,
        request.importance,
        request.r,
        asked,
        request.from_step,
        discount=request.discount,
        rule=request.threshold,
        num_subgoals=request.num_subgoals,
    )
    question = _question(subject, request, route)
    return Answer(subject, explanation, None, Coarse(coarse, found), route, question)


def _rolled_out(subject: Subject, request: Request, route: Sequence[int]) -> Trajectory:
    check_step(subject.path, request.from_step)
    return roll_out(certain(subject.world), subject.path.states[request.from_step - 1], route)


def as_json(found: Answer, request: Request) -> Mapping[str, object]:
    """Return an answer as the object that other programs read, made of lists, numbers and text only."""
    asked = {**about(found.subject, request), **_as_asked(found, request)}
    if found.coarse is not None:
        return {**granularity.as_json(found.coarse.world, found.coarse.path, found.explanation), "about": asked}
    world, explanation = found.subject.world, found.explanation
    path, importance = explanation.path, explanation.importance

    def pair(step: int) -> Mapping[str, object]:
        state, action = path.pairs[step - 1]
        return {"step": step, "state": _components(world.states[state]), "action": world.actions[action]}

    first = explanation.explanation_step
    written: dict[str, object] = {
        "states": [_components(world.states[state]) for state in path.states],
        "actions": [world.actions[action] for action in path.actions],
        "importance": importance.values.tolist(),
        "standard_error": None if importance.standard_errors is None else importance.standard_errors.tolist(),
        "threshold": explanation.threshold,
        "subgoals": [pair(step) for step in explanation.subgoals],
        "key_points": [pair(step) for step in explanation.key_points],
        "explanation": None if first is None else pair(first),
    }
    if importance.error_bound:
        written["error_bound"] = importance.error_bound
    if found.sampled is not None:
        sampled = found.sampled
        written["sampling"] = {
            "trials": sampled.num_trials,
            "stopped": sampled.stopped,
            "unsettled": list(sampled.unsettled),
            "truncated": sampled.num_truncated,
        }
    return {**written, "about": asked}


def about(subject: Subject, request: Request) -> dict[str, object]:
    """Return what an answer was computed with, so that it can be computed again."""
    chosen: dict[str, object] = {"version": version("xar"), "source": subject.source.name}
    if isinstance(subject.source, MapSource):
        chosen["layout"] = str(subject.source.layout).splitlines()
    else:
        chosen["environment"] = {
            "seed": subject.source.seed,
            "actions": list(subject.world.actions),
            "options": {key: _plain(value) for key, value in subject.source.options.items()},
        }
    chosen |= {name: getattr(request, name) for name in ("world", "policy", "importance", "estimator", "granularity")}
    chosen |= {"random_steps": request.r, "discount": request.discount, "seed": request.seed}
    return chosen | {"threshold_rule": request.threshold, "num_subgoals": request.num_subgoals}


def _as_asked(found: Answer, request: Request) -> dict[str, object]:
    if found.route is None:
        return {"route": None, "from_step": None, "believed_layout": None}
    return {
        "route": [found.subject.world.actions[action] for action in found.route],
        "from_step": request.from_step,
        "believed_layout": None if request.belief is None else str(request.belief.layout).splitlines(),
    }


def _question(subject: Subject, request: Request, route: tuple[int, ...] | None) -> str:
    if route is None:
        return ""
    actions = ", ".join(subject.world.actions[action] for action in route)
    if request.belief is None:
        return f"Asked at step {request.from_step}: {actions}."
    believer = f"by somebody who believes in {request.belief.source}, and so in the route"
    return f"Asked at step {request.from_step} {believer} {actions}."


def _plain(value: object) -> object:
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _components(label: Hashable) -> list[object]:
    """Return a state's components as numbers and text; a label without components is the only one of its own."""
    parts = label if isinstance(label, tuple) else (label,)
    return [int(part) if isinstance(part, int | np.integer) else str(part) for part in parts]


def _check_question(source: Source, request: Request) -> None:
    """Refuse what can be refused before anything is learned."""
    if isinstance(source, MapSource):
        if request.belief is not None:
            check_size(source.layout, request.belief)
        for name in request.route or ():
            _action(ACTIONS, name)
    elif request.belief is not None:
        raise ValueError(f"a believed map belongs to a map, and {source.name!r} is none; give a route instead")


def _route(subject: Subject, request: Request) -> tuple[int, ...] | None:
    """Return the questioner's action indices, given or planned on the map that they believe in, if somebody asks."""
    if request.belief is not None and isinstance(subject.source, MapSource):
        check_step(subject.path, request.from_step)
        state = key_door_state(certain(subject.world), subject.path.states[request.from_step - 1])
        return mistaken_route(subject.source.layout, request.belief, state)
    if request.route is None:
        return None
    return tuple(_action(subject.world.actions, name) for name in request.route)


def _action(names: Sequence[str], name: str) -> int:
    if name not in names:
        raise ValueError(f"{name!r} is not an action; use {', '.join(names)}")
    return names.index(name)
