"""What is explained of each layout: the agent's path, its importance, the situations and the kinds of explanation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import get_args

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
from webapp.stimuli.arms import ArmKind, arm_steps
from webapp.stimuli.own_kinds import ExplanationTask, OwnKindFunction, OwnKindFunctions, chosen_steps, locked, read_only
from webapp.stimuli.probes import Prediction, predictions
from webapp.study.experiments import BUILT_IN_KINDS, KEY_POINT_KINDS, TAILORED_KINDS
from webapp.study.protocol import Experiment, ExplanationSettings, Kind, Study


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
        current: The current state.
        video: The way so far, ending with the current state; None where only the current view is shown.
        announced: The next action indices; empty where none are announced.
        key_points: The steps that answer the question; empty where nobody asks.
        explanations: By kind: the strips of each of its variants. Only the random kind has more than one. A tailored
            kind has none: its strips are put together when its participant has driven.
        pairs: The strip of each subgoal from the current state on, by its step.
        predictions: What is asked about the agent's next action.
    """

    from_step: int
    current: int
    video: Strip | None
    announced: tuple[int, ...]
    key_points: tuple[int, ...]
    explanations: Mapping[Kind, tuple[tuple[Strip, ...], ...]]
    pairs: Mapping[int, Strip]
    predictions: tuple[Prediction, ...]

    def num_pictures(self, kind: Kind) -> tuple[int, int]:
        """Return the fewest and the most pictures of a kind's explanation, the current view included.

        A tailored kind shows what its participant missed, or all the subgoals to those who missed nothing.
        """
        if kind in TAILORED_KINDS:
            sizes = [len(strip.states) for strip in self.pairs.values()]
            return 1 + min(sizes), 1 + sum(sizes)
        sizes = [sum(len(strip.states) for strip in strips) for strips in self.explanations[kind]]
        return min(sizes), max(sizes)

    def arms_like_subgoals(self) -> tuple[Kind, ...]:
        """Return the arms that happen to show exactly what the subgoals show, and so compare nothing."""
        own = (kind for kind in self.explanations if kind not in BUILT_IN_KINDS)
        return tuple(
            kind
            for kind in (*get_args(ArmKind), *own)
            if kind in self.explanations and self.explanations[kind][0][1:] == tuple(self.pairs.values())
        )


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


def stage(
    study: Study,
    experiment: Experiment,
    name: str,
    layout: Layout | None,
    agent: Agent,
    way: Walk,
    own_kinds: OwnKindFunctions = MappingProxyType({}),
) -> Scene:
    """Work out what an experiment shows of a layout.

    Args:
        study: The study.
        experiment: The experiment.
        name: The layout's name.
        layout: Its map; None where a world of the study's own takes its place.
        agent: The agent.
        way: Its way.
        own_kinds: The functions of the study's own kinds.

    Raises:
        BuildError: The question can be asked nowhere on the path, a kind has nothing to show or too little, or there
            are too few states to ask about.
    """
    question = _ask(experiment, name, layout, agent, way)
    from_step = 1 if question is None else question.from_step
    key_points = (
        () if question is None else key_point_steps(agent.world, way.path, way.subgoals, question.route, from_step)
    )
    situation = _Situation(study, name, agent, way, from_step, key_points, own_kinds)
    for kind in experiment.kinds:
        needs = kind not in _NEEDS_NOTHING and kind not in own_kinds
        if needs and not (key_points if kind in KEY_POINT_KINDS else situation.ahead):
            raise BuildError(f"layout {name!r}: experiment {experiment.id!r} has nothing to show as {kind!r}")
    world, policy = agent.world, agent.policy(agent.world)
    return Scene(
        from_step=from_step,
        current=way.path.states[from_step - 1],
        video=None if question is None else Strip(way.path.states[:from_step], way.path.actions[: from_step - 1]),
        announced=() if question is None else question.announced_actions,
        key_points=key_points,
        explanations={kind: situation.variants(kind) for kind in experiment.kinds if kind not in TAILORED_KINDS},
        pairs=dict(zip(situation.ahead, situation.strips(situation.ahead)[1:], strict=True)),
        predictions=predictions(study.seed, experiment, name, world, policy, way.path, from_step),
    )


_NEEDS_NOTHING: frozenset[Kind] = frozenset({"full", "none"})
"""The kinds that need no subgoals; of all others these are what is shown, or say how much is."""


def _ask(experiment: Experiment, name: str, layout: Layout | None, agent: Agent, way: Walk) -> Question | None:
    if experiment.question is None:
        return None
    if layout is None:
        raise BuildError(f"layout {name!r} in experiment {experiment.id!r}: the questioner needs a key-door layout")
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


@dataclass(frozen=True, slots=True)
class _Situation:
    """Where an explanation is given, and all that its kinds are made from."""

    study: Study
    layout: str
    agent: Agent
    way: Walk
    from_step: int
    key_points: tuple[int, ...]
    own_kinds: OwnKindFunctions

    @property
    def ahead(self) -> tuple[int, ...]:
        """The subgoals that do not lie behind."""
        return tuple(step for step in self.way.subgoals if step >= self.from_step)

    def strips(self, steps: Sequence[int]) -> tuple[Strip, ...]:
        """Lay out the current view and the pair of each step."""
        return kind_strips("subgoals", self.way.path, steps, self.from_step)

    def variants(self, kind: Kind) -> tuple[tuple[Strip, ...], ...]:
        """Return the strips of each variant of a kind that is not made for one person."""
        if kind == "full":
            return (kind_strips("full", self.way.path, (), self.from_step),)
        if kind == "placebic":
            return (self._placebo(),)
        return tuple(self.strips(steps) for steps in self._choices(kind))

    def _choices(self, kind: Kind) -> tuple[tuple[int, ...], ...]:
        """Return the steps that each variant shows of a kind that shows some."""
        match kind:
            case "random":
                choices = [self._drawn(draw) for draw in range(self.study.explanation.num_draws)]
            case "highlights" | "landmarks" | "evenly_spaced":
                choices = [self._arm(kind)]
            case "subgoals":
                choices = [self.ahead]
            case "all_key_points":
                choices = [self.key_points]
            case "first_key_point":
                choices = [self.key_points[:1]]
            case "none":
                choices = [()]
            case _ if kind in self.own_kinds:
                choices = [self._own(kind, self.own_kinds[kind])]
            case _:
                raise ValueError(f"the kind {kind!r} is not made from steps chosen beforehand")
        return tuple(choices)

    def _placebo(self) -> tuple[Strip, ...]:
        """Show the current view as often as the subgoals have pictures: it looks like an explanation and says nothing.

        Langer, Blank & Chanowitz 1978, "The mindlessness of ostensibly thoughtful action"; for intelligent systems:
        Eiband, Buschek, Kremer & Hussmann 2019, "The impact of placebic explanations on trust in intelligent systems".
        """
        current, *pairs = self.strips(self.ahead)
        return (current,) * (1 + sum(len(pair.states) for pair in pairs))

    def _drawn(self, draw: int) -> tuple[int, ...]:
        """Draw as many pairs as there are subgoals, as the paper does (section 6).

        The last pair is one picture instead of two, so a draw can have a picture more or fewer than the subgoals. The
        comparison arms, which are not the paper's, have exactly as many.
        """
        path = self.way.path
        rng = stream(self.study.seed, "random explanation", self.layout, str(self.from_step), str(draw))
        steps = random_pair_steps(path.num_steps - self.from_step + 1, len(self.ahead), rng)
        return tuple(step + self.from_step - 1 for step in steps)

    def _arm(self, kind: ArmKind) -> tuple[int, ...]:
        behind = self.from_step - 1
        world, left = self.agent.world, self.way.path.from_step(self.from_step)
        subgoals = tuple(step - behind for step in self.ahead)
        steps = arm_steps(kind, self.layout, world, self.agent.policy(world), left, subgoals)
        return tuple(step + behind for step in steps)

    def _own(self, kind: Kind, function: OwnKindFunction) -> tuple[int, ...]:
        behind = self.from_step - 1
        world = self.agent.world
        _, *pairs = self.strips(self.ahead)
        task = ExplanationTask(
            layout=self.layout,
            world=read_only(world),
            policy=locked(self.agent.policy(world)),
            path=self.way.path.from_step(self.from_step),
            importance=locked(self.way.importance.values[behind:]),
            subgoals=tuple(step - behind for step in self.ahead),
            num_pictures=sum(len(pair.states) for pair in pairs),
            rng=stream(self.study.seed, "own kind", kind, self.layout, str(self.from_step)),
        )
        return tuple(step + behind for step in chosen_steps(kind, function, task))
