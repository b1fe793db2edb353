"""Explain one map on demand: choose the world, the policy and the estimator, and train what is not known yet."""

import hashlib
import json
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from webapp.explainer.explanation import Assess, Explanation, explain
from webapp.explainer.importance import ImportanceKind, exact_importance, recurrent_importance, sampled_importance
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.seeding import stream
from webapp.explainer.solvers import plan
from webapp.explainer.worlds.key_door import ACTIONS, tabulate
from webapp.explainer.worlds.layout import Layout

if TYPE_CHECKING:
    from webapp.explainer.learning import TrainedAgent, TrainingSettings

WorldKind = Literal["exact", "learned"]
PolicyKind = Literal["planner", "dqn"]
EstimatorKind = Literal["exact", "monte-carlo"]

ReportProgress = Callable[[str, float], None]
"""Takes the name of a stage and how much of it is done, from 0 to 1."""


class NotLearned(ValueError):
    """An agent or a world model was not right when the budget of its training ended."""


@dataclass(frozen=True, slots=True)
class Request:
    """What somebody wants to know about a map.

    Attributes:
        world: The table of the map's rules, or the world model learned from experience in it.
        policy: The planner's shortest path in that world, or the learned agent's greedy policy.
        importance: Which definition of importance.
        estimator: Exactly, or by sampling; in a learned world by rollouts through the recurrent network.
        random_steps: r, at least 0.
        num_trials: Rollouts per state and probability, at least 1; an exact estimator needs none.
        seed: Of the sampling and of the training, at least 0.
        route: The names of the questioner's actions, if somebody asks.
        from_step: The step at which they ask, from 1.

    Raises:
        ValueError: A number is too small, an action is unknown, or the route is empty.
    """

    world: WorldKind = "exact"
    policy: PolicyKind = "planner"
    importance: ImportanceKind = "return_probability"
    estimator: EstimatorKind = "exact"
    random_steps: int = 10
    num_trials: int = 1000
    seed: int = 0
    route: tuple[str, ...] | None = None
    from_step: int = 1

    def __post_init__(self) -> None:
        least = {"random_steps": 0, "num_trials": 1, "seed": 0, "from_step": 1}
        for name, smallest in least.items():
            if getattr(self, name) < smallest:
                raise ValueError(f"{name} must be {smallest} or larger, not {getattr(self, name)}")
        if self.route is None:
            return
        if not self.route:
            raise ValueError("a route has at least one action; leave it out when nobody asks")
        for action in self.route:
            if action not in ACTIONS:
                raise ValueError(f"{action!r} is not an action; use {', '.join(ACTIONS)}")

    def __str__(self) -> str:
        """Say in one line what is asked."""
        importance = {"return_probability": "return probability", "ace": "average causal effect"}[self.importance]
        sampled = f", {self.num_trials} trials per state, seed {self.seed}"
        return (
            f"{self.world} world, {self.policy}, {importance} after {self.random_steps} random actions, "
            f"{self.estimator}{sampled if self.estimator == 'monte-carlo' else ''}"
        )

    @property
    def learns(self) -> bool:
        """Whether a network must be trained first."""
        return self.world == "learned" or self.policy == "dqn"


def answer(
    layout: Layout,
    request: Request,
    cache: Path,
    progress: ReportProgress,
    source: str = "map",
    settings: "TrainingSettings | None" = None,
) -> tuple[DeterministicMDP, Explanation]:
    """Explain the path of an agent on a map.

    Torch is loaded only for what is learned, and only sampling a learned world rolls its network out.

    Args:
        layout: The map.
        request: What is asked.
        cache: The folder in which trained networks are kept by content; it is made when needed.
        progress: Told how much of the training is done, from 0 to 1.
        source: What to call the map in messages.
        settings: How to train; the settings' own defaults when left out.

    Returns:
        The world in which the explanation holds, exact or tabulated from the learned model, and the explanation.

    Raises:
        LayoutError: The goal cannot be reached.
        NeverArrives: The policy does not lead to the goal.
        NotLearned: The networks did not learn the map within their budget.
        ValueError: There is no such step.
    """
    table = tabulate(layout, source)
    agent = _trained_agent(layout, request.seed, settings, cache, progress) if request.learns else None
    mdp = agent.tabulate() if agent is not None and request.world == "learned" else table
    policy = agent.policy(mdp) if agent is not None and request.policy == "dqn" else plan(mdp)
    route = None if request.route is None else tuple(ACTIONS.index(action) for action in request.route)
    return mdp, explain(mdp, policy, _assess(request, mdp, policy, agent), route, request.from_step)


def as_json(mdp: DeterministicMDP, explanation: Explanation) -> Mapping[str, object]:
    """Return an explanation as the object that other programs read, made of lists, numbers and text only."""
    path, errors = explanation.path, explanation.importance.standard_errors

    def pair(step: int) -> Mapping[str, object]:
        state, action = path.pairs[step - 1]
        return {"step": step, "state": _numbers(mdp, state), "action": mdp.actions[action]}

    first = explanation.explanation_step
    return {
        "states": [_numbers(mdp, state) for state in path.states],
        "actions": [mdp.actions[action] for action in path.actions],
        "importance": explanation.importance.values.tolist(),
        "standard_error": None if errors is None else errors.tolist(),
        "threshold": explanation.threshold,
        "subgoals": [pair(step) for step in explanation.subgoals],
        "key_points": [pair(step) for step in explanation.key_points],
        "explanation": None if first is None else pair(first),
    }


def _trained_agent(
    layout: Layout, seed: int, settings: "TrainingSettings | None", cache: Path, progress: ReportProgress
) -> "TrainedAgent":
    from webapp.explainer import learning  # noqa: PLC0415 - torch is loaded only for what is learned.

    settings = settings or learning.TrainingSettings()
    weights = cache / f"{_fingerprint(layout, settings, seed)}.safetensors"
    if weights.exists():
        return learning.load(weights, [layout])[0]
    try:
        agents = learning.train([layout], settings, [seed], lambda now: progress("training", now.fraction))
    except learning.TrainingFailed as error:
        raise NotLearned(f"the training failed: {error}") from error
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    draft = weights.with_name(f"{weights.stem}.{secrets.token_hex(8)}.part")
    learning.save(agents, draft)
    draft.replace(weights)
    return agents[0]


def _fingerprint(layout: Layout, settings: "TrainingSettings", seed: int) -> str:
    """Name what training depends on: the map, the settings, the seed, torch, and the code that learns."""
    core = Path(__file__).parent
    code = hashlib.sha256()
    for source in sorted([*core.glob("learning/*.py"), *core.glob("worlds/*.py"), core / "seeding.py"]):
        code.update(source.read_bytes())
    facts = [str(layout), settings.to_dict(), seed, version("torch"), code.hexdigest()]
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:32]


def _assess(request: Request, mdp: DeterministicMDP, policy: Policy, agent: "TrainedAgent | None") -> Assess:
    kind, random_steps = request.importance, request.random_steps
    if request.estimator == "exact":
        return lambda path: exact_importance(kind, mdp, policy, path, random_steps)
    if agent is not None and request.world == "learned":
        model, seed = agent.recurrent_model(), request.seed
        return lambda path: recurrent_importance(kind, model, mdp, policy, path, random_steps, request.num_trials, seed)
    rng = stream(request.seed, "rollouts", "table")
    return lambda path: sampled_importance(kind, mdp, policy, path, random_steps, request.num_trials, rng)


def _numbers(mdp: DeterministicMDP, state: int) -> list[int]:
    label = mdp.states[state]
    if not isinstance(label, tuple):
        raise TypeError(f"a state is written as its components, and {label!r} has none")
    return [int(component) for component in label]
