"""A policy that takes shortest paths to a goal, whichever of them: `solvers.tie_averaged_policy` and its like.

Each of its actions brings the goal one step nearer. So what stands anywhere is pushed down by distance, one distance
after the other, and no linear system has to be solved.
"""

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.random_phases import Ball
from webapp.explainer.random_step import Indices, Mass
from webapp.explainer.solvers import Trajectory, distances_to_goal
from webapp.explainer.stochastic import StochasticPolicy


def takes_shortest_paths(mdp: DeterministicMDP, policy: StochasticPolicy) -> bool:
    """Whether every action that a policy `[S, A]` may take where a goal can be reached is one of a shortest path."""
    return bool(_is_on_shortest_paths(mdp, policy, distances_to_goal(mdp)).all())


class ShortestPaths:
    """The course of such a policy, and one way that it may take.

    Attributes:
        arrives: `[S]`: True where the policy reaches a goal, which is where a goal can be reached.
        optimal: `[T, A]`: the actions that the policy may take in each state of the path but the last.

    Raises:
        ValueError: The policy may take an action that is on no shortest path; the message names where.
    """

    def __init__(self, mdp: DeterministicMDP, policy: StochasticPolicy, path: Trajectory) -> None:
        distances = distances_to_goal(mdp)
        is_on = _is_on_shortest_paths(mdp, policy, distances)
        if not is_on.all():
            state, action = divmod(int(np.argmin(is_on)), mdp.num_actions)
            raise ValueError(f"{mdp.actions[action]!r} in {mdp.states[state]!r} is on no shortest path to the goal")
        self._mdp, self._chances = mdp, policy
        self.arrives = np.isfinite(distances)
        self._distances = np.where(self.arrives, distances, -1).astype(np.int64)
        self.optimal = policy[list(path.states[:-1])] > 0

    def meeting(self, ball: Ball, mass: Mass) -> NDArray[np.float64]:
        """Return `[N]`: how much of each column of the mass `[B, N]` stands on its start or comes to it."""
        distances = self._distances[ball.states]
        start_distances = distances[ball.starts]
        met = np.zeros(len(ball.starts))
        here, flow = ball.states[:0], mass[:0]
        for distance in range(int(distances.max()), int(start_distances.min()) - 1, -1):
            standing = distances == distance
            here, flow = _joined((here, ball.states[standing]), (flow, mass[standing]))
            columns = np.flatnonzero(start_distances == distance)
            met[columns] = flow[np.searchsorted(here, ball.states[ball.starts[columns]]), columns]
            here, flow = self._pushed(here, flow)
        return met

    def _pushed(self, here: Indices, flow: Mass) -> tuple[Indices, Mass]:
        """Return where the policy's next action leads the flow `[n, N]` of the states `[n]`."""
        origin, action = np.nonzero(self._chances[here])
        after = self._mdp.next_state[here[origin], action]
        return _joined((after,), (flow[origin] * self._chances[here[origin], action][:, None],))


def _joined(states: tuple[Indices, ...], flows: tuple[Mass, ...]) -> tuple[Indices, Mass]:
    """Add up the flows of states that are named more than once; the states ascend."""
    named, flow = np.concatenate(states), np.concatenate(flows)
    order = np.argsort(named, kind="stable")
    first = np.flatnonzero(np.diff(named[order], prepend=-1))
    return named[order][first], np.add.reduceat(flow[order], first, axis=0) if len(first) else flow


def _is_on_shortest_paths(
    mdp: DeterministicMDP, policy: StochasticPolicy, distances: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """`[S, A]`: False for the actions that the policy may take and that bring no goal nearer."""
    must = np.isfinite(distances) & ~mdp.terminal
    nearer = distances[mdp.next_state] == distances[:, None] - 1
    is_on: NDArray[np.bool_] = nearer | ~must[:, None] | (policy == 0)
    return is_on
