"""Exact importance in a deterministic world: no linear system, no SciPy, and all states of a path at once.

Two kinds of policy never come back to where they were once they are on their way to the goal. Under a deterministic
policy, a way that meets the policy's path follows it from there (`solvers.meeting_places`). Under a policy that takes
shortest paths, whichever of them, each action brings the goal one step nearer (`shortest_paths`). In both cases what
the random phase leaves before a state is pushed on to it, and that is all there is to add up.
"""

from collections.abc import Callable
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.random_phases import Ball, balls
from webapp.explainer.random_step import Mass
from webapp.explainer.shortest_paths import ShortestPaths
from webapp.explainer.solvers import Trajectory, meeting_places, steps_to_goal
from webapp.explainer.stochastic import AnyPolicy, action_probabilities


def return_probability(
    mdp: DeterministicMDP, policy: AnyPolicy, path: Trajectory, random_steps: int
) -> NDArray[np.float64]:
    """Compute `[T]`: the probability of coming back to each state of a path but the last.

    Args:
        mdp: The world.
        policy: `[S]` actions, or `[S, A]` probabilities of actions that all lie on shortest paths. Where it never
            reaches a goal it does not return.
        path: A way to a goal that the policy may take.
        random_steps: r, at least 0.

    Raises:
        ValueError: The number of random actions is negative, the path does not follow the policy to a goal, or the
            probabilities are those of another kind of policy.
    """
    course = _course(mdp, policy, path)

    def solve(ball: Ball) -> NDArray[np.float64]:
        mass = ball.random_phase(random_steps)
        # A walk that happens to end on the state has not returned: the test comes after each action of the policy.
        mass[ball.starts, np.arange(len(ball.starts))] = 0.0
        return course.meeting(ball, mass)

    return _for_all(mdp, path, random_steps, solve)


def ace(mdp: DeterministicMDP, policy: AnyPolicy, path: Trajectory, random_steps: int) -> NDArray[np.float64]:
    """Compute `[T]`: the average causal effect of being allowed the policy's action in each state but the last.

    Every action that the policy may take in the state is forbidden there, in both phases.

    Args:
        mdp: The world.
        policy: `[S]` actions, or `[S, A]` probabilities of actions that all lie on shortest paths. Where it never
            reaches a goal it does not arrive.
        path: A way to a goal that the policy may take.
        random_steps: r, at least 0.

    Raises:
        ValueError: The number of random actions is negative, the path does not follow the policy to a goal, or the
            probabilities are those of another kind of policy.
    """
    course = _course(mdp, policy, path)

    def solve(ball: Ball) -> NDArray[np.float64]:
        denied = ball.random_phase(random_steps, course.optimal[ball.columns])
        missing = course.meeting(ball, denied)
        arrives = course.arrives[ball.states]
        if arrives.all():
            return missing
        lost: NDArray[np.float64] = (ball.random_phase(random_steps) - denied)[arrives].sum(axis=0) + missing
        return lost

    return _for_all(mdp, path, random_steps, solve)


def reward_importance(
    mdp: DeterministicMDP, policy: Policy, path: Trajectory, discount: float = 0.99
) -> NDArray[np.float64]:
    """Compute `[T]`: what the policy's action in each state but the last is worth (section 7.3).

    Entering a goal earns 1 and all else 0, so a state from which the policy arrives in `n` actions is worth
    `discount ** (n - 1)`. The other action is the best one while the prohibition lasts, and it is taken at every visit:
    whoever comes back to the state never reaches the goal, so of the actions from which the policy does not lead back
    the one nearest to the goal counts. Where the state is not met again, that is the one with the highest value under
    the policy. If all lead back, or there is no other action, nothing is earned.

    Args:
        mdp: The world.
        policy: `[S]`.
        path: The policy's path to a goal.
        discount: From 0 up to, not including, 1.

    Raises:
        ValueError: The discount is out of range, or the path does not follow the policy to a goal.
    """
    if not 0 <= discount < 1:
        raise ValueError(f"the discount must lie from 0 up to, not including, 1, not {discount}")
    check_path(mdp, policy, path)
    steps = steps_to_goal(mdp, policy)
    meeting = meeting_places(mdp, policy, path)
    states, actions = np.array(path.states[:-1], dtype=np.int64), np.array(path.actions, dtype=np.int64)
    # Without an action the goal is `steps` away; the last of these earns the 1 undiscounted.
    after = mdp.next_state[states]
    places = np.arange(path.num_steps)
    arrives = np.isfinite(steps[after]) & (meeting[after] > places[:, None])
    arrives[places, actions] = False
    others = np.where(arrives, discount ** steps[after], 0.0)
    lost: NDArray[np.float64] = discount ** (steps[states] - 1) - others.max(axis=1)
    return lost


def check_path(mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> None:
    """Refuse a path that is not the policy's way to a goal.

    Raises:
        ValueError: The message names the first state where it is not.
    """
    states, actions = np.array(path.states[:-1], dtype=np.int64), np.array(path.actions, dtype=np.int64)
    _refuse_leaving(mdp, path, policy[states] == actions)


def _refuse_leaving(mdp: DeterministicMDP, path: Trajectory, follows: NDArray[np.bool_]) -> None:
    """Refuse a path where the policy does not follow, `[T]`, where the world does not, or that ends in no goal."""
    states, actions = np.array(path.states, dtype=np.int64), np.array(path.actions, dtype=np.int64)
    leads_on = follows & (mdp.next_state[states[:-1], actions] == states[1:])
    if not leads_on.all():
        raise ValueError(f"the path leaves the policy in {mdp.states[path.states[int(np.argmin(leads_on))]]!r}")
    if not mdp.goal[states[-1]]:
        raise ValueError(f"the path must end in a goal, not in {mdp.states[path.states[-1]]!r}")


class _Course(Protocol):
    """A policy, and one way that it may take to a goal.

    Attributes:
        arrives: `[S]`: True where the policy reaches a goal.
        optimal: `[T, A]`: the actions that the policy may take in each state of the path but the last.
    """

    @property
    def arrives(self) -> NDArray[np.bool_]: ...

    @property
    def optimal(self) -> NDArray[np.bool_]: ...

    def meeting(self, ball: Ball, mass: Mass) -> NDArray[np.float64]:
        """Return `[N]`: how much of each column of the mass `[B, N]` stands on its start or comes to it."""


def _course(mdp: DeterministicMDP, policy: AnyPolicy, path: Trajectory) -> _Course:
    if policy.ndim == 1:
        return _SinglePath(mdp, cast("Policy", policy), path)
    chances = action_probabilities(mdp, policy)
    _refuse_leaving(mdp, path, chances[list(path.states[:-1]), list(path.actions)] > 0)
    return ShortestPaths(mdp, chances, path)


class _SinglePath:
    """The course of a deterministic policy."""

    def __init__(self, mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> None:
        check_path(mdp, policy, path)
        self._mdp, self._path = mdp, path
        self._place = meeting_places(mdp, policy, path)

    @property
    def arrives(self) -> NDArray[np.bool_]:
        arrives: NDArray[np.bool_] = self._place <= self._path.num_steps + 1
        return arrives

    @property
    def optimal(self) -> NDArray[np.bool_]:
        optimal: NDArray[np.bool_] = np.array(self._path.actions)[:, None] == np.arange(self._mdp.num_actions)
        return optimal

    def meeting(self, ball: Ball, mass: Mass) -> NDArray[np.float64]:
        passes = self._place[ball.states][:, None] <= ball.columns
        # A product with ones sums the columns faster than a sum over the first axis.
        met: NDArray[np.float64] = np.ones(len(mass)) @ (mass * passes)
        return met


def _for_all(
    mdp: DeterministicMDP, path: Trajectory, random_steps: int, solve: Callable[[Ball], NDArray[np.float64]]
) -> NDArray[np.float64]:
    values = np.zeros(path.num_steps)
    for ball in balls(mdp, path.states[:-1], random_steps):
        values[ball.columns] = solve(ball)
    return values
