"""Exact answers on a deterministic MDP: distances, the planner, paths, the random phase, and where a policy leads."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy, StateAction
from webapp.explainer.random_step import RandomStep


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

    Example:
        >>> from webapp.explainer import Trajectory
        >>> path = Trajectory(states=(0, 4, 7), actions=(1, 0))
        >>> path.num_steps, path.pairs
        (2, ((0, 1), (4, 0)))
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
    before, start = _predecessors(mdp)
    distances = np.where(mdp.goal, 0.0, np.inf)
    claim = np.empty(mdp.num_states, dtype=np.int64)
    frontier = np.flatnonzero(mdp.goal)
    distance = 0
    while len(frontier):
        distance += 1
        counts = start[frontier + 1] - start[frontier]
        offsets = np.repeat(start[frontier] - (np.cumsum(counts) - counts), counts)
        nearby = before[offsets + np.arange(len(offsets))]
        nearby = nearby[np.isinf(distances[nearby])]
        # Whoever is named more than once is claimed by one of its namings. That is faster than sorting them.
        claim[nearby] = np.arange(len(nearby))
        frontier = nearby[claim[nearby] == np.arange(len(nearby))]
        distances[frontier] = distance
    return distances


def _predecessors(mdp: DeterministicMDP) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the states that lead to each other state, one state's after another's, and `[S + 1]` where each begin."""
    own = np.arange(mdp.num_states, dtype=np.int32)
    origin, action = np.nonzero(mdp.next_state != own[:, None])
    target = mdp.next_state[origin, action]
    before = origin.astype(np.int32)[np.argsort(target, kind="stable")]
    return before, np.concatenate(([0], np.cumsum(np.bincount(target, minlength=mdp.num_states))))


def plan(mdp: DeterministicMDP) -> Policy:
    """Return the policy that takes a shortest path to a goal, ties broken by the lowest action index.

    Returns:
        `[S]`. Where no goal can be reached every action is as good as any other, so the tie-break gives action 0.
    """
    policy: Policy = np.argmin(distances_to_goal(mdp)[mdp.next_state], axis=1).astype(np.int32)
    return policy


def tie_averaged_policy(mdp: DeterministicMDP) -> NDArray[np.float64]:
    """Return the policy that is uniform over all optimal actions: those on a shortest path to a goal.

    `plan` takes one of these paths; importance under this policy does not depend on which.

    Returns:
        `[S, A]` probabilities. Where no goal can be reached every action is as good as any other, in a goal too.
    """
    distances = distances_to_goal(mdp)[mdp.next_state]
    optimal = distances == distances.min(axis=1, keepdims=True)
    chances: NDArray[np.float64] = optimal / optimal.sum(axis=1, keepdims=True)
    return chances


def follow(mdp: DeterministicMDP, policy: Policy, start: int | None = None) -> Trajectory:
    r"""Follow a policy to the goal.

    Args:
        mdp: The world.
        policy: `[S]`.
        start: The index of the first state; the world's own start when left out.

    Raises:
        NeverArrives: The policy comes back to a state, or the episode ends elsewhere.

    Example:
        >>> from webapp.explainer import follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> follow(world, plan_world(world)).num_steps
        7
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

    This sweeps the whole world; `random_phases.balls` does not, and serves all states of a path at once.

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
    if forbidden is None:
        return mdp.random_step.push(np.array([start]), num_steps)[:, 0]
    selectable = mdp.selectable.copy()
    selectable[forbidden] = False
    return RandomStep.of(mdp.next_state, selectable).push(np.array([start]), num_steps)[:, 0]


def steps_to_goal(mdp: DeterministicMDP, policy: Policy) -> NDArray[np.float64]:
    """Count the actions that a policy takes from every state to a goal.

    Every state is led on by as many actions again as before, so that `log2(S)` rounds lead it to the end.

    Returns:
        `[S]`, 0 at a goal and infinite where the policy never arrives.

    Raises:
        ValueError: The policy does not fit the world.
    """
    end = policy_successors(mdp, policy)
    steps = np.where(mdp.terminal, 0.0, 1.0)
    for _ in range(_num_doublings(mdp)):
        steps += steps[end]
        end = end[end]
    return np.where(mdp.goal[end], steps, np.inf)


def meeting_places(mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> NDArray[np.int32]:
    """Return where the policy from each state first meets its own path to a goal.

    From there on it follows the path: a state's way passes through place `i` of the path exactly if it meets the path
    at `i` or before. So all questions about who passes through whom are comparisons of two numbers.

    Args:
        mdp: The world.
        policy: `[S]`.
        path: The policy's path to a goal.

    Returns:
        `[S]`: from 0 to T, the index into `path.states`; T + 1 where the policy arrives at another goal, and T + 2
        where it never arrives.

    Raises:
        ValueError: The policy does not fit the world.
    """
    end = policy_successors(mdp, policy)
    on_path = np.array(path.states)
    end[on_path] = on_path
    for _ in range(_num_doublings(mdp)):
        end = end[end]
    place = np.where(mdp.goal, path.num_steps + 1, path.num_steps + 2).astype(np.int32)
    place[on_path] = np.arange(len(on_path))
    meeting: NDArray[np.int32] = place[end]
    return meeting


def policy_successors(mdp: DeterministicMDP, policy: Policy) -> NDArray[np.int64]:
    """Return `[S]`: the state that follows each one under a policy; a terminal state follows itself.

    Raises:
        ValueError: The policy is not one action index per state that has not ended.
    """
    if policy.shape != (mdp.num_states,):
        raise ValueError(f"a policy must have shape {(mdp.num_states,)}, not {policy.shape}")
    actions = np.where(mdp.terminal, 0, policy)
    if not np.issubdtype(policy.dtype, np.integer) or actions.min() < 0 or actions.max() >= mdp.num_actions:
        raise ValueError(f"a policy must hold action indices from 0 to {mdp.num_actions - 1}")
    return mdp.next_state[np.arange(mdp.num_states), actions].astype(np.int64)


def _num_doublings(mdp: DeterministicMDP) -> int:
    """So many times must a stride of 1 be doubled to be S or more."""
    return (mdp.num_states - 1).bit_length()
