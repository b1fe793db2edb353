"""The map of an experiment, its optimal path, and the subgoals that the method derives from it."""

from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.importance import exact_importance
from webapp.explainer.mdp import DeterministicMDP, Policy, StateAction
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.subgoals import subgoal_steps
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import Layout, parse_layout

RANDOM_STEPS = 10
"""r of the importance that the subgoals are derived from."""


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What fresh agents have to learn, and what the method says of it.

    Attributes:
        layout: The map.
        mdp: Its world.
        policy: The planner's, `[S]`.
        path: The planner's shortest path, `T` steps.
        importance: `[T + 1]`, exact return probabilities.
        subgoals: The derived subgoals without the step that reaches the goal, which the goal's own reward pays.
    """

    layout: Layout
    mdp: DeterministicMDP
    policy: Policy
    path: Trajectory
    importance: NDArray[np.float64]
    subgoals: tuple[int, ...]

    @property
    def max_steps(self) -> int:
        """The action at which an episode is truncated."""
        return 10 * self.layout.width * self.layout.height

    @property
    def inner_steps(self) -> range:
        """The steps that a sub-reward can be put on: all but the one that reaches the goal."""
        return range(1, self.path.num_steps)

    def pairs(self, steps: tuple[int, ...]) -> tuple[StateAction, ...]:
        """Return the state-action pairs of some steps of the path."""
        return tuple(self.path.pairs[step - 1] for step in steps)


def prepare_task(layout: Layout, name: str = "map", random_steps: int = RANDOM_STEPS) -> Task:
    """Plan on a map and derive the subgoals of the path.

    Args:
        layout: The map.
        name: What to call it in messages.
        random_steps: r.

    Raises:
        LayoutError: The goal cannot be reached.
    """
    mdp = tabulate(layout, name)
    policy = plan(mdp)
    path = follow(mdp, policy)
    values = exact_importance("return_probability", mdp, policy, path, random_steps).values
    subgoals = tuple(step for step in subgoal_steps(values) if step < path.num_steps)
    return Task(layout, mdp, policy, path, values, subgoals)


def packaged_layout(name: str = "simulation") -> str:
    """Return the text of a map of the default study."""
    return files("webapp").joinpath("studies", "sakai2021", "layouts", f"{name}.txt").read_text(encoding="utf-8")


def read_task(text: str, name: str) -> Task:
    """Read a map and prepare it.

    Raises:
        LayoutError: The map cannot be used.
    """
    return prepare_task(parse_layout(text, name), name)
