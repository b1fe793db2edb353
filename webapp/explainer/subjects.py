"""What is explained: a world, a policy in it and one of its ways to the goal, prepared from a map or an environment."""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import Trajectory, follow, plan, tie_averaged_policy
from webapp.explainer.stochastic import AnyPolicy, World
from webapp.explainer.training_cache import ReportProgress, trained_agent
from webapp.explainer.worlds.enumeration import MAX_STATES, enumerate_world
from webapp.explainer.worlds.finite import describe_state
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import Layout

if TYPE_CHECKING:
    from webapp.explainer.learning import TrainedAgent, TrainingSettings

WorldKind = Literal["exact", "learned"]
PolicyKind = Literal["planner", "tie-averaged", "dqn"]


@dataclass(frozen=True, slots=True)
class MapSource:
    """A key-door map and what to call it in messages, such as its file name."""

    layout: Layout
    name: str = "map"


@dataclass(frozen=True, slots=True)
class EnvironmentSource:
    """A finite environment that is not a map.

    Attributes:
        name: Its Gymnasium id, or `module:callable` for one's own.
        seed: Of its `reset`, at least 0.
        actions: The names of the actions to explain with, in order; all of the environment's when empty.
        options: Keyword arguments for making it.
        max_states: Refuse an environment with more states than this.
    """

    name: str
    seed: int = 0
    actions: tuple[str, ...] = ()
    options: Mapping[str, object] = field(default_factory=dict)
    max_states: int = MAX_STATES


Source = MapSource | EnvironmentSource


@dataclass(frozen=True, slots=True)
class Subject:
    """What is explained.

    Attributes:
        source: Where it comes from.
        world: The table of its rules, or of what the learned world model predicts.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: The way to the goal that is explained: in a deterministic world the planner's or the agent's, else the
            policy's most probable one.
        describe: Says a state's label in words.
        agent: The trained agent, where one was needed.
    """

    source: Source
    world: World
    policy: AnyPolicy
    path: Trajectory
    describe: Callable[[Hashable], str] = str
    agent: "TrainedAgent | None" = None


def prepare(
    source: Source,
    world: WorldKind = "exact",
    policy: PolicyKind = "planner",
    *,
    cache: Path,
    progress: ReportProgress,
    seed: int = 0,
    discount: float = 0.99,
    settings: "TrainingSettings | None" = None,
) -> Subject:
    """Enumerate a world, train what is not known yet, and find the path that is explained.

    Torch is loaded only for what is learned, Gymnasium and SciPy only for environments that need them.

    Args:
        source: A map or an environment.
        world: The table of the rules, or the world model learned from experience (maps only).
        policy: The planner's; the one that is uniform over all optimal actions, whose explained path stays the
            planner's; or the learned agent's (maps only).
        cache: The folder in which trained networks are kept by content; it is made when needed.
        progress: Told how much of the training, or of the states that are allowed, is done, from 0 to 1.
        seed: Of the training.
        discount: With which the planner of a stochastic world weighs sooner against surer.
        settings: How to train; the settings' own defaults when left out.

    Raises:
        LayoutError: The goal of a map cannot be reached.
        NeverArrives: The policy does not lead to the goal.
        NotLearned: The networks did not learn the map within their budget.
        ValueError: The environment cannot be enumerated, or nothing can be learned in it.
    """
    if isinstance(source, EnvironmentSource):
        if world == "learned" or policy == "dqn":
            raise ValueError(f"agents and world models are trained for key-door maps only, not for {source.name!r}")
        return _environment(source, policy, discount, progress)
    table = tabulate(source.layout, source.name)
    learns = world == "learned" or policy == "dqn"
    agent = trained_agent(source.layout, seed, cache, progress, settings) if learns else None
    mdp = agent.tabulate() if agent is not None and world == "learned" else table
    if agent is not None and policy == "dqn":
        return Subject(source, mdp, agent.policy(mdp), follow(mdp, agent.policy(mdp)), agent=agent)
    return _planned(source, mdp, policy, agent)


def _planned(source: Source, mdp: DeterministicMDP, policy: PolicyKind, agent: "TrainedAgent | None") -> Subject:
    planned = plan(mdp)
    chosen: AnyPolicy = tie_averaged_policy(mdp) if policy == "tie-averaged" else planned
    return Subject(source, mdp, chosen, follow(mdp, planned), agent=agent)


def _environment(source: EnvironmentSource, policy: PolicyKind, discount: float, progress: ReportProgress) -> Subject:
    from webapp.explainer import stochastic_planning as planning  # noqa: PLC0415 - loads SciPy.
    from webapp.explainer.worlds.gymnasium_worlds import world_of  # noqa: PLC0415 - loads Gymnasium.

    finite = world_of(source.name, seed=source.seed, actions=source.actions or None, options=source.options)
    report = lambda count: progress("listing states", count / source.max_states)
    world = enumerate_world(finite, max_states=source.max_states, progress=report)
    planned = planning.plan_world(world, discount)
    path = planning.most_probable_path(world, planned)
    chosen: AnyPolicy = planning.tie_averaged_plan(world, discount) if policy == "tie-averaged" else planned
    return Subject(source, world, chosen, path, describe=lambda label: describe_state(finite, label))
