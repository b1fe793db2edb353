"""Exact answers on a deterministic MDP: distances, the planner, paths, the random phase and the policy's in-tree."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy, StateAction


class NeverArrives(ValueError):
    """A policy does not lead to the goal; the message names the state where that shows."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """States in the order of their visit, and the actions between them.

    Attributes:
        states: `[T + 1]` state indices, the last one included.
        actions: `[T]` action indices.

    Raises:
        ValueError: There is not exactly one state more than there are actions.
    """

    states: tuple[int, ...]
    actions: tuple[int, ...]

    def __post_init__(self) -> None:
        if len(self.states) != len(self.actions) + 1:
            raise ValueError(f"{len(self.actions)} actions join {len(self.actions) + 1} states, not {len(self.states)}")

    @property
    def num_steps(self) -> int:
        """T."""
        return len(self.actions)

    @property
    def pairs(self) -> tuple[StateAction, ...]:
        """`[T]`: each state with the action taken in it."""
        return tuple(zip(self.states, self.actions, strict=False))

    def from_step(self, step: int) -> "Trajectory":
        """Return what is left from a step on.

        Args:
            step: From 1, the first; at most T.

        Raises:
            ValueError: There is no such step.
        """
        check_step(self, step)
        return Trajectory(self.states[step - 1 :], self.actions[step - 1 :])


def check_step(path: Trajectory, step: int) -> None:
    """Refuse a step that the path does not have.

    Raises:
        ValueError: The step is not from 1 to T.
    """
    if not 1 <= step <= path.num_steps:
        raise ValueError(f"there is no step {step}; the path has steps 1 to {path.num_steps}")


def distances_to_goal(mdp: DeterministicMDP) -> NDArray[np.float64]:
    """Count the actions of a shortest path to a goal from every state.

    Returns:
        `[S]`, 0 at a goal and infinite where no goal can be reached.
    """
    distances = np.where(mdp.goal, 0.0, np.inf)
    frontier = mdp.goal
    for distance in range(1, mdp.num_states + 1):
        frontier = frontier[mdp.next_state].any(axis=1) & np.isinf(distances)
        if not frontier.any():
            break
        distances[frontier] = distance
    return distances


def plan(mdp: DeterministicMDP) -> Policy:
    """Return the policy that takes a shortest path to a goal, ties broken by the lowest action index.

    Returns:
        `[S]`. Where no goal can be reached every action is as good as any other, so the tie-break gives action 0.
    """
    policy: Policy = np.argmin(distances_to_goal(mdp)[mdp.next_state], axis=1).astype(np.int32)
    return policy


def follow(mdp: DeterministicMDP, policy: Policy, start: int | None = None) -> Trajectory:
    """Follow a policy to the goal.

    Args:
        mdp: The world.
        policy: `[S]`.
        start: The index of the first state; the world's own start when left out.

    Raises:
        NeverArrives: The policy comes back to a state, or the episode ends elsewhere.
    """
    state = mdp.start if start is None else start
    states, actions, seen = [state], [], {state}
    while not mdp.terminal[state]:
        actions.append(int(policy[state]))
        state = int(mdp.next_state[state, actions[-1]])
        if state in seen:
            raise NeverArrives(f"the policy never reaches the goal: it loops through {mdp.states[state]!r}")
        states.append(state)
        seen.add(state)
    if not mdp.goal[state]:
        raise NeverArrives(f"the policy never reaches the goal: the episode ends in {mdp.states[state]!r}")
    return Trajectory(tuple(states), tuple(actions))


def random_phase(
    mdp: DeterministicMDP, start: int, num_steps: int, *, forbidden: StateAction | None = None
) -> NDArray[np.float64]:
    """Return where random actions lead, exactly (Sakai et al. 2021, section 4.2.1).

    The distribution is pushed forward step by step, so the work grows with the states within reach and not with S.

    Args:
        mdp: The world.
        start: The index of the first state.
        num_steps: How many random actions, each uniform over the selectable ones; where there is none the state stays.
        forbidden: A state and an action that is not selectable there (`do(allow = 0)`), if any.

    Returns:
        `[S]`: the probability of each state after the last action. It sums to 1.

    Raises:
        ValueError: The number of actions is negative.
    """
    if num_steps < 0:
        raise ValueError(f"the number of random actions must be 0 or larger, not {num_steps}")
    states, mass = np.array([start]), np.array([1.0])
    for _ in range(num_steps):
        allowed = mdp.selectable[states]
        if forbidden is not None:
            allowed[states == forbidden[0], forbidden[1]] = False
        num_allowed = allowed.sum(axis=1)
        origins, actions = np.nonzero(allowed)
        stuck = num_allowed == 0
        after = np.concatenate((mdp.next_state[states[origins], actions], states[stuck]))
        shares = np.concatenate((mass[origins] / num_allowed[origins], mass[stuck]))
        states, places = np.unique(after, return_inverse=True)
        mass = np.bincount(places, weights=shares)
    distribution = np.zeros(mdp.num_states)
    distribution[states] = mass
    return distribution


@dataclass(frozen=True, slots=True, eq=False)
class PolicyForest:
    """The policy's paths to the goals as trees whose edges point at the goals, numbered in pre-order.

    Whether the policy leads from one state through another is then a comparison of numbers: the states that pass
    through a state are its subtree, and a subtree is an interval of the pre-order.

    Attributes:
        entry: `[S]`: the pre-order number from 0, or S where the policy never reaches a goal.
        size: `[S]`: how many states pass through each one, itself included; 0 where the policy never reaches a goal.
    """

    entry: NDArray[np.int64]
    size: NDArray[np.int64]

    @property
    def arrives(self) -> NDArray[np.bool_]:
        """`[S]`: True where the policy reaches a goal."""
        arrives: NDArray[np.bool_] = self.size > 0
        return arrives

    def passes_through(self, state: int) -> NDArray[np.bool_]:
        """Return `[S]`: True where the policy's path to a goal visits the state, the state itself included."""
        offset = self.entry - self.entry[state]
        inside: NDArray[np.bool_] = (offset >= 0) & (offset < self.size[state])
        return inside


def policy_forest(mdp: DeterministicMDP, policy: Policy) -> PolicyForest:
    """Number the states by a tour of the policy's in-trees; takes O(S) steps and no linear system."""
    num_states = mdp.num_states
    after = mdp.next_state[np.arange(num_states), policy]
    by_successor = np.argsort(after, kind="stable")
    first = np.searchsorted(after[by_successor], np.arange(num_states + 1))
    tour: list[int] = []
    stack = [int(goal) for goal in np.flatnonzero(mdp.goal)]
    while stack:
        state = stack.pop()
        tour.append(state)
        before = by_successor[first[state] : first[state + 1]]
        stack.extend(before[~mdp.terminal[before]].tolist())
    entry = np.full(num_states, num_states, dtype=np.int64)
    entry[tour] = np.arange(len(tour))
    size = np.zeros(num_states, dtype=np.int64)
    for state in reversed(tour):
        size[state] += 1
        if not mdp.terminal[state]:
            size[after[state]] += size[state]
    return PolicyForest(entry, size)
