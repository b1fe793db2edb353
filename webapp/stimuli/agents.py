"""Who is explained: for each layout a policy, and the world as the explainer sees it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import plan
from webapp.explainer.worlds.key_door import tabulate
from webapp.stimuli.sources import Sources

ReportProgress = Callable[[str, float], None]
"""Is told what is being done, in a few words, and how much of it is done, from 0 to 1."""


class BuildError(RuntimeError):
    """Agents that cannot be had, or that do what the study cannot show; the message says what was missing."""


@dataclass(frozen=True, slots=True)
class Agent:
    """The explained agent of one layout.

    Attributes:
        policy: Gives its `[S]` action indices on a world whose labels are `KeyDoorState`s.
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
        kind: `learned` in every bundle that is shown to people; `planner` in tests.
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
        """Return an agent for each layout of the study."""


def planner_agents(sources: Sources, progress: ReportProgress) -> Agents:
    """Return agents that know the exact table and plan on it, so that tests get a real bundle within seconds."""
    del progress
    worlds = {name: tabulate(layout) for name, layout in sources.layouts.items()}
    by_layout = {name: Agent(policy=plan, world=world, training={}) for name, world in worlds.items()}
    return Agents("planner", by_layout, settings={}, seconds={}, save=lambda folder: None)  # noqa: ARG005
