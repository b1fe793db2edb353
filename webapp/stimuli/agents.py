"""Who is explained: for each layout a policy, and the world as the explainer sees it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import plan
from webapp.explainer.worlds.key_door import tabulate
from webapp.stimuli.build_error import BuildError
from webapp.stimuli.sources import Sources

__all__ = ["Agent", "AgentProvider", "Agents", "BuildError", "ReportProgress", "agents_of", "planner_agents"]

ReportProgress = Callable[[str, float], None]
"""Is told what is being done, in a few words, and how much of it is done, from 0 to 1."""


@dataclass(frozen=True, slots=True)
class Agent:
    """The explained agent of one layout.

    Attributes:
        policy: Gives its `[S]` action indices on a world with the labels of its own.
        world: The world as the explainer sees it: the world model tabulated, or the exact table.
        training: What is to be reported of its training; empty when nothing was trained.
    """

    policy: Callable[[DeterministicMDP], Policy]
    world: DeterministicMDP
    training: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Agents:
    """The agents of all layouts of a study.

    Attributes:
        kind: `learned` where people are shown key-door layouts; `planner` in tests; `own_worlds` where there is no
            key-door layout.
        by_layout: One agent for each layout.
        settings: The training settings in full; empty when nothing was trained.
        seconds: By layout, how long it took until its agent was trained; empty when nothing was trained.
        save: Writes the weights into a bundle's folder, the same bytes for the same weights.
    """

    kind: str
    by_layout: Mapping[str, Agent]
    settings: Mapping[str, Any]
    seconds: Mapping[str, float]
    save: Callable[[Path], None]


class AgentProvider(Protocol):
    """A way to agents; `learned_agents` trains them.

    Attributes:
        __name__: What tells its bundles from those of other providers.
    """

    __name__: str

    def __call__(self, sources: Sources, progress: ReportProgress) -> Agents:
        """Return an agent for each key-door layout of the study."""


def planner_agents(sources: Sources, progress: ReportProgress) -> Agents:
    """Return agents that know the exact table and plan on it, so that tests get a real bundle within seconds."""
    del progress
    worlds = {name: tabulate(layout) for name, layout in sources.layouts.items()}
    by_layout = {name: Agent(policy=plan, world=world, training={}) for name, world in worlds.items()}
    return Agents("planner", by_layout, settings={}, seconds={}, save=lambda folder: None)  # noqa: ARG005


def agents_of(sources: Sources, provider: AgentProvider, progress: ReportProgress) -> Agents:
    """Ask a provider for the agents of the key-door layouts, and add those of the study's own worlds.

    The latter are not trained: they plan on the exact table, or follow the policy that the world brings along.
    """
    nobody = Agents("own_worlds", {}, settings={}, seconds={}, save=lambda folder: None)  # noqa: ARG005
    provided = provider(sources, progress) if sources.layouts else nobody
    own = {
        name: Agent(
            policy=_always(world.policy),
            world=world.table,
            training={"agent": "planner" if world.planned else "own_policy"},
        )
        for name, world in sources.worlds.items()
    }
    both = {**provided.by_layout, **own}
    return replace(provided, by_layout={name: both[name] for name in sources.study.layouts})


def _always(policy: Policy) -> Callable[[DeterministicMDP], Policy]:
    return lambda table: policy.copy()  # noqa: ARG005 - there is only one table of such a world.
