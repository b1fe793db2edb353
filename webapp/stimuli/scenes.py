"""What is explained of each layout: the agent's path, its importance, the situations and the kinds of explanation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from webapp.explainer.explanation import Strip, kind_strips
from webapp.explainer.importance import Importance, exact_importance
from webapp.explainer.key_points import key_point_steps
from webapp.explainer.questioner import NoSplit, Question, find_split
from webapp.explainer.seeding import stream
from webapp.explainer.selectors import random_pair_steps
from webapp.explainer.solvers import NeverArrives, Trajectory, follow
from webapp.explainer.subgoals import subgoal_steps
from webapp.explainer.worlds.layout import Layout
from webapp.stimuli.agents import Agent, BuildError
from webapp.study.protocol import KEY_POINT_KINDS, Experiment, ExplanationSettings, Kind, Study


@dataclass(frozen=True, slots=True)
class Walk:
    """An agent's way through its layout.

    Attributes:
        path: From the start to the goal, as states and actions of the agent's world.
        importance: Of each of the path's states.
        subgoals: Steps from 1.
    """

    path: Trajectory
    importance: Importance
    subgoals: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Scene:
    """What one experiment shows of one layout.

    Attributes:
        from_step: The step of the current state, from 1.
        video: The way so far, ending with the current state; None where only the current view is shown.
        announced: The next action indices; empty where none are announced.
        key_points: The steps that answer the question; empty where nobody asks.
        explanations: By kind: the strips of each of its variants. Only the random kind has more than one.
    """

    from_step: int
    video: Strip | None
    announced: tuple[int, ...]
    key_points: tuple[int, ...]
    explanations: Mapping[Kind, tuple[tuple[Strip, ...], ...]]


def walk(layout: str, agent: Agent, settings: ExplanationSettings) -> Walk:
    """Follow an agent from its start and find its subgoals.

    Raises:
        BuildError: It never arrives, or has no subgoals.
    """
    policy = agent.policy(agent.world)
    try:
        path = follow(agent.world, policy)
    except NeverArrives as error:
        raise BuildError(f"layout {layout!r}: {error}") from None
    importance = exact_importance(settings.importance, agent.world, policy, path, settings.random_steps)
    subgoals = subgoal_steps(importance.values)
    if not subgoals:
        raise BuildError(f"layout {layout!r}: the path has no subgoals with {settings.random_steps} random steps")
    return Walk(path, importance, subgoals)


def stage(study: Study, experiment: Experiment, name: str, layout: Layout, agent: Agent, way: Walk) -> Scene:
    """Work out what an experiment shows of a layout.

    Raises:
        BuildError: The question can be asked nowhere on the path, or a kind has nothing to show.
    """
    question = _ask(experiment, name, layout, agent, way)
    from_step = 1 if question is None else question.from_step
    key_points = (
        () if question is None else key_point_steps(agent.world, way.path, way.subgoals, question.route, from_step)
    )
    chosen = {kind: _steps(kind, study, name, way, from_step, key_points) for kind in experiment.kinds}
    for kind, variants in chosen.items():
        if kind != "full" and not all(variants):
            raise BuildError(f"layout {name!r}: experiment {experiment.id!r} has nothing to show as {kind!r}")
    return Scene(
        from_step=from_step,
        video=None if question is None else Strip(way.path.states[:from_step], way.path.actions[: from_step - 1]),
        announced=() if question is None else question.announced_actions,
        key_points=key_points,
        explanations={
            kind: tuple(kind_strips(kind, way.path, steps, from_step) for steps in variants)
            for kind, variants in chosen.items()
        },
    )


def _ask(experiment: Experiment, name: str, layout: Layout, agent: Agent, way: Walk) -> Question | None:
    if experiment.question is None:
        return None
    try:
        return find_split(
            layout,
            agent.world,
            way.path,
            min_video_actions=experiment.question.min_video_actions,
            num_announced=experiment.question.num_announced_actions,
        )
    except NoSplit as error:
        raise BuildError(f"layout {name!r} in experiment {experiment.id!r}: {error}") from None


def _steps(
    kind: Kind, study: Study, layout: str, way: Walk, from_step: int, key_points: Sequence[int]
) -> tuple[tuple[int, ...], ...]:
    """Return the steps that each variant of a kind shows."""
    ahead = tuple(step for step in way.subgoals if step >= from_step)
    if kind == "full":
        return ((),)
    if kind in KEY_POINT_KINDS:
        return (tuple(key_points),)
    if kind == "subgoals":
        return (ahead,)
    return tuple(
        _drawn_steps(study, layout, draw, way, from_step, len(ahead)) for draw in range(study.explanation.num_draws)
    )


def _drawn_steps(study: Study, layout: str, draw: int, way: Walk, from_step: int, count: int) -> tuple[int, ...]:
    rng = stream(study.seed, "random explanation", layout, str(from_step), str(draw))
    steps = random_pair_steps(way.path.num_steps - from_step + 1, count, rng)
    return tuple(step + from_step - 1 for step in steps)
