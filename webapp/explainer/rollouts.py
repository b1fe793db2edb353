"""Algorithm 1's rollouts on a table: many walkers at once, each taking random actions and then the policy's."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy, StateAction

States = NDArray[np.integer[Any]]
"""`[N]` state indices, one per walker."""


def walk_randomly(
    mdp: DeterministicMDP,
    states: States,
    num_steps: int,
    rng: np.random.Generator,
    *,
    forbidden: Sequence[StateAction] | None = None,
) -> States:
    """Take random actions, each uniform over the selectable ones; where there is none the state stays.

    Args:
        mdp: The world.
        states: `[N]` state indices, one per walker.
        num_steps: How many random actions each walker takes.
        rng: The stream of the draws; one number is drawn per walker and action.
        forbidden: For each walker a state and an action that is not selectable there (`do(allow = 0)`), if any.

    Returns:
        `[N]`: where the walkers are then.

    Raises:
        ValueError: The number of actions is negative.
    """
    if num_steps < 0:
        raise ValueError(f"the number of random actions must be 0 or larger, not {num_steps}")
    denied_states, denied_actions = np.array(forbidden or [], dtype=np.int64).reshape(-1, 2).T
    for _ in range(num_steps):
        allowed = mdp.selectable[states]
        if forbidden is not None:
            there = states == denied_states
            allowed[there, denied_actions[there]] = False
        num_allowed = allowed.sum(axis=1)
        rank = (rng.random(len(states)) * num_allowed).astype(np.int64)
        action = np.argmax(np.cumsum(allowed, axis=1) > rank[:, None], axis=1)
        states = np.where(num_allowed > 0, mdp.next_state[states, action], states)
    return states


def returns(mdp: DeterministicMDP, policy: Policy, states: States, featured: States) -> NDArray[np.bool_]:
    """Follow the policy from each state until the goal or until its featured state.

    The test for the featured state comes after each action, as in Algorithm 1: a walker that starts there has not
    returned. A walker that takes S actions without meeting either moves in a loop and never returns.

    Args:
        mdp: The world.
        policy: `[S]`.
        states: `[N]` state indices, one per walker.
        featured: `[N]`: the index of each one's `s_f`.

    Returns:
        `[N]`: True for the walkers that meet the featured state.
    """
    returned = np.zeros(len(states), dtype=np.bool_)
    walkers = np.flatnonzero(~mdp.terminal[states])
    here: States = states[walkers]
    for _ in range(mdp.num_states):
        if not len(walkers):
            break
        here = mdp.next_state[here, policy[here]]
        met = here == featured[walkers]
        returned[walkers[met]] = True
        going = ~met & ~mdp.terminal[here]
        walkers, here = walkers[going], here[going]
    return returned


def arrivals(
    mdp: DeterministicMDP, policy: Policy, states: States, *, blocked: States | None = None
) -> NDArray[np.bool_]:
    """Follow the policy from each state until the episode ends.

    Args:
        mdp: The world.
        policy: `[S]`.
        states: `[N]` state indices, one per walker.
        blocked: `[N]`: the index of the state in which each one's policy action is forbidden (`do(allow = 0)`):
            whoever stands there is stuck.

    Returns:
        `[N]`: True for the walkers that reach a goal. One that takes S actions without moves in a loop and does not.
    """
    here: States = states
    for _ in range(mdp.num_states):
        going = ~mdp.terminal[here]
        if blocked is not None:
            going &= here != blocked
        if not going.any():
            break
        here = np.where(going, mdp.next_state[here, policy[here]], here)
    arrived: NDArray[np.bool_] = mdp.goal[here]
    return arrived
