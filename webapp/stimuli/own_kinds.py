"""Kinds of explanation of a study's own: a function that chooses which steps of the agent's way are shown."""

import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import Trajectory
from webapp.stimuli.build_error import BuildError


@dataclass(frozen=True, slots=True, eq=False)
class ExplanationTask:
    """What an own kind chooses from. Steps count from 1 at the state in which the explanation is given.

    No array can be written to.

    Attributes:
        layout: The layout's name.
        world: The world as the agent knows it: `states` (labels), `actions` (names), `next_state` and so on.
        policy: `[S]`, the index of the agent's action in each state.
        path: What is left of the agent's way: `[T + 1]` states and `[T]` actions, by their indices.
        importance: `[T + 1]`, of each state of `path`, as the study file says; the last is the goal's and is 0.
        subgoals: The steps that the kind `subgoals` shows, ascending.
        num_pictures: How many pictures these have, without that of the present state.
        rng: Draws that are the same in every build of the study; a stream of its own for each kind and layout.
    """

    layout: str
    world: DeterministicMDP
    policy: Policy
    path: Trajectory
    importance: NDArray[np.float64]
    subgoals: tuple[int, ...]
    num_pictures: int
    rng: np.random.Generator


OwnKindFunction = Callable[[ExplanationTask], Sequence[int]]
"""Returns the steps to show, from 1 to T, ascending, at least one."""

OwnKindFunctions = Mapping[str, OwnKindFunction]


def chosen_steps(kind: str, function: OwnKindFunction, task: ExplanationTask) -> tuple[int, ...]:
    """Let an own kind choose, twice, and check its choice.

    Raises:
        BuildError: It raised something, what it returned is no choice of steps, or it chose otherwise when it was asked
            again; the message names it.
    """
    where = f"layout {task.layout!r}: the kind {kind!r}"
    first, second = (_choice(where, function, replace(task, rng=deepcopy(task.rng))) for _ in range(2))
    if first != second:
        wish = "it should return the same in every build, so draw with `rng` alone"
        raise BuildError(f"{where} returned {list(first)}, and {list(second)} when it was asked again; {wish}")
    return first


def _choice(where: str, function: OwnKindFunction, task: ExplanationTask) -> tuple[int, ...]:
    try:
        returned = function(task)
        steps = list(returned) if isinstance(returned, Iterator) else returned  # Its own code may yield them.
    except (Exception, SystemExit) as problem:
        raise BuildError(f"{where} raised {type(problem).__name__}: {problem}") from problem
    wish = f"it should return ascending steps from 1 to {task.path.num_steps}, at least one"
    try:
        chosen = tuple(_step(step) for step in steps)
    except TypeError:
        raise BuildError(f"{where} returned {steps!r}; {wish}") from None
    within = all(1 <= step <= task.path.num_steps for step in chosen)
    if not chosen or not within or any(later <= earlier for earlier, later in pairwise(chosen)):
        raise BuildError(f"{where} returned {list(chosen)}; {wish}")
    return chosen


def read_only(world: DeterministicMDP) -> DeterministicMDP:
    """Return the same world with arrays that cannot be written to."""
    return replace(
        world,
        next_state=locked(world.next_state),
        terminal=locked(world.terminal),
        goal=locked(world.goal),
        reward=None if world.reward is None else locked(world.reward),
    )


def locked(array: NDArray[Any]) -> NDArray[Any]:
    """Return a view of an array that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def _step(value: object) -> int:
    if isinstance(value, bool | np.bool_):
        raise TypeError("a truth value is no step")
    return operator.index(value)  # type: ignore[arg-type]  # It raises TypeError for whatever has no __index__.
