"""Other policies that are as good: the same path, with the ties between optimal actions broken otherwise elsewhere.

A deterministic policy leads many equal paths through one state only because of how it breaks ties, and that state then
looks important. What stays when ties are broken at random, or not at all, is the world's doing.
"""

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.seeding import stream
from webapp.explainer.solvers import Trajectory, distances_to_goal
from webapp.explainer.stochastic import AnyPolicy, StochasticPolicy, World


def shortest_path_actions(mdp: DeterministicMDP) -> NDArray[np.bool_]:
    """Return `[S, A]`: True for the actions that begin a shortest path to a goal; none where there is no path."""
    distances = distances_to_goal(mdp)
    arrives = np.isfinite(distances)[:, None]
    shortest: NDArray[np.bool_] = arrives & (distances[mdp.next_state] == distances[:, None] - 1)
    return shortest


def check_optimal_actions(world: World, optimal_actions: NDArray[np.bool_], path: Trajectory) -> None:
    """Refuse a table of optimal actions that does not fit the world, or that the path does not take.

    Args:
        world: The world.
        optimal_actions: `[S, A]`.
        path: Whose actions must all be optimal; else ties are broken between actions that the path does not take.

    Raises:
        ValueError: The table has another shape or no booleans, or the path takes another action.
    """
    shape = (world.num_states, world.num_actions)
    if optimal_actions.shape != shape or optimal_actions.dtype != np.bool_:
        found = f"{optimal_actions.shape} of {optimal_actions.dtype}"
        raise ValueError(f"the optimal actions must be {shape} booleans, not {found}")
    for state, action in path.pairs:
        if not optimal_actions[state, action]:
            raise ValueError(
                f"ties are broken among optimal actions, and {world.actions[action]!r}, which the path takes in "
                f"{world.states[state]!r}, is none; name the optimal actions, or break no ties"
            )


def random_tie_break(
    optimal_actions: NDArray[np.bool_], policy: AnyPolicy, path: Trajectory, seed: int, number: int
) -> Policy:
    """Draw a policy that takes one optimal action in each state, each of them equally likely.

    Args:
        optimal_actions: `[S, A]`. Where there is none the policy stays as it is, by its likeliest action.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: Where the draw is set aside: in its states the path's actions are taken, so that it remains the path.
        seed: At least 0.
        number: Which of the draws; each has a stream of its own, so that their number changes none of them.

    Returns:
        `[S]`.
    """
    rng = stream(seed, "stability", "ties", str(number))
    priority = np.where(optimal_actions, rng.random(optimal_actions.shape), -1.0)
    drawn = np.where(optimal_actions.any(axis=1), priority.argmax(axis=1), _likeliest(policy)).astype(np.int32)
    drawn[list(path.states[:-1])] = path.actions
    return drawn


def every_tie(optimal_actions: NDArray[np.bool_], policy: AnyPolicy) -> StochasticPolicy:
    """Return `[S, A]`: all optimal actions equally likely; where there is none, the policy's likeliest action.

    Args:
        optimal_actions: `[S, A]`.
        policy: `[S]` actions or `[S, A]` probabilities.
    """
    taken = optimal_actions.copy()
    without = np.flatnonzero(~optimal_actions.any(axis=1))
    taken[without, _likeliest(policy)[without]] = True
    chances: StochasticPolicy = taken / taken.sum(axis=1, keepdims=True)
    return chances


def _likeliest(policy: AnyPolicy) -> NDArray[np.int64]:
    return (policy if policy.ndim == 1 else policy.argmax(axis=1)).astype(np.int64)
