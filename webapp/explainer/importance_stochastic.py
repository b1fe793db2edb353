"""Exact importance where the world, the policy or both are stochastic (Sakai et al. 2021, sections 4.2.1 and 7.3).

For a state `s_f` of a path: take `r` random actions from it, then follow the policy.

- `return_probability`: the probability that the policy leads back to `s_f`.
- `ace`: the probability of reaching the goal, minus the same where the optimal action of `s_f` is forbidden in `s_f`,
  in both phases. Every action that the policy may take in `s_f` counts as optimal there, so whoever then comes to
  `s_f` misses the goal.
- `reward_importance`: the expected discounted reward from `s_f`, minus the same where the optimal action is forbidden
  in `s_f` and the other action that is then worth most is taken there. It has no random phase.

A deterministic world is taken as well. Where its policy is deterministic too, `importance_deterministic` gives the same
numbers of the first two without a linear system.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.reachability import (
    Reachability,
    chain_reach_probability,
    markov_chain,
    may_reach,
    random_phase,
)
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import (
    AnyPolicy,
    StochasticMDP,
    StochasticPolicy,
    World,
    action_probabilities,
    from_deterministic,
)
from webapp.explainer.transient_systems import TransientSystem

Bounded = tuple[NDArray[np.float64], float]
"""`[T]` values, one per state of the path but the target, and a bound on the error of each of them."""


def return_probability(world: World, policy: AnyPolicy, path: Trajectory, random_steps: int) -> Bounded:
    """Compute the probability of coming back, for every state of a path.

    The test for the state comes after each action of the policy: a walk whose random phase ends on it has not returned.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: A way to the goal that the policy may take.
        random_steps: r, at least 0.

    Raises:
        ValueError: The number of random actions is negative, or the policy may not take the path to a goal.
        NotSolved: The numbers cannot be trusted.
    """
    course = _Course(_stochastic(world), policy, path)
    values, bounds = [], [0.0]
    for state in path.states[:-1]:
        reached = course.meeting(state)
        after_a_step = reached.values.copy()
        after_a_step[state] = float((course.chain[[state]] @ reached.values)[0])
        values.append(float(random_phase(course.mdp, state, random_steps) @ after_a_step))
        bounds.append(reached.error_bound)
    return np.clip(np.array(values), 0.0, 1.0), max(bounds)


def ace(world: World, policy: AnyPolicy, path: Trajectory, random_steps: int) -> Bounded:
    """Compute the average causal effect of being allowed the optimal action, for every state of a path.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: A way to the goal that the policy may take.
        random_steps: r, at least 0.

    Raises:
        ValueError: The number of random actions is negative, or the policy may not take the path to a goal.
        NotSolved: The numbers cannot be trusted.
    """
    course = _Course(_stochastic(world), policy, path)
    arriving = chain_reach_probability(course.chain, course.mdp.goal)
    values, bounds = [], [0.0]
    for state in path.states[:-1]:
        reached = course.meeting(state)
        avoiding = arriving.values - reached.values * arriving.values[state]
        optimal = tuple((state, int(action)) for action in np.flatnonzero(course.chances[state]))
        allowed = random_phase(course.mdp, state, random_steps) @ arriving.values
        denied = random_phase(course.mdp, state, random_steps, forbidden=optimal) @ avoiding
        values.append(float(allowed - denied))
        bounds.append(3 * arriving.error_bound + reached.error_bound)
    return np.clip(np.array(values), -1.0, 1.0), max(bounds)


def reward_importance(world: World, policy: AnyPolicy, path: Trajectory, discount: float = 0.99) -> Bounded:
    """Compute what the optimal action of every state of a path is worth (section 7.3).

    In place of every action that the policy may take in `s_f`, another one is taken at every visit: the one that is
    worth most while the prohibition lasts. Where `s_f` is not met again, that is the one with the highest `Q(s_f, a)`
    under the policy. Where it may be, such a `Q` would count on the forbidden action at the next visit, and favour
    what changes nothing. Where the policy may take every action, nothing is left to take and nothing is earned.

    Args:
        world: The world. If it names no rewards, entering a goal earns 1 and all else 0.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: A way to the goal that the policy may take.
        discount: From 0 up to, not including, 1.

    Raises:
        ValueError: The discount is out of range, or the policy may not take the path to a goal.
        NotSolved: The numbers cannot be trusted.
    """
    if not 0 <= discount < 1:
        raise ValueError(f"the discount must lie from 0 up to, not including, 1, not {discount}")
    returns = _DiscountedReturns(_Course(_stochastic(world), policy, path), discount)
    losses = [returns.loss(state) for state in path.states[:-1]]
    return np.array([value for value, _ in losses]), max((bound for _, bound in losses), default=0.0)


def _stochastic(world: World) -> StochasticMDP:
    return from_deterministic(world) if isinstance(world, DeterministicMDP) else world


class _Course:
    """A policy in a world and one way that it may take to the goal."""

    def __init__(self, mdp: StochasticMDP, policy: AnyPolicy, path: Trajectory) -> None:
        self.mdp = mdp
        self.chances: StochasticPolicy = action_probabilities(mdp, policy)
        self.chain = markov_chain(mdp, policy)
        self._check(path)

    def _check(self, path: Trajectory) -> None:
        for (state, action), after in zip(path.pairs, path.states[1:], strict=True):
            row = state * self.mdp.num_actions + action
            outcomes = self.mdp.next_state[self.mdp.row_start[row] : self.mdp.row_start[row + 1]]
            if not self.chances[state, action] or after not in outcomes:
                raise ValueError(f"the path leaves the policy in {self.mdp.states[state]!r}")
        if not self.mdp.goal[path.states[-1]]:
            raise ValueError(f"the path must end in a goal, not in {self.mdp.states[path.states[-1]]!r}")

    @cached_property
    def _transient(self) -> NDArray[np.bool_]:
        """`[S]`: the states from which the policy may still reach a goal: none of them is visited for ever."""
        return may_reach(self.chain, self.mdp.goal) & ~self.mdp.terminal

    @cached_property
    def _system(self) -> TransientSystem:
        return TransientSystem(self.chain, self._transient)

    def meeting(self, state: int) -> Reachability:
        """Return the probability of ever being in a state of the path, from every state.

        With `n(s)` the expected number of visits, that is `n(s) / n(state)`: one system serves the whole path.
        """
        there = np.flatnonzero(self._transient) == state
        visits = self._system.solve(there.astype(np.float64))
        visits_from_itself = float(visits.values[there][0])
        values = np.zeros(self.mdp.num_states)
        values[self._transient] = np.clip(visits.values / visits_from_itself, 0.0, 1.0)
        values[state] = 1.0
        return Reachability(values, 2 * visits.error_bound / visits_from_itself)


class _DiscountedReturns:
    """The expected discounted rewards of a policy, and what they become when one state's action is forbidden."""

    def __init__(self, course: _Course, discount: float) -> None:
        self._course, self._discount = course, discount
        mdp = course.mdp
        self._reward = mdp.goal_chance if mdp.reward is None else mdp.reward
        self._alive = np.flatnonzero(~mdp.terminal)
        self._system = TransientSystem(discount * course.chain[self._alive][:, self._alive])
        solution = self._system.solve((course.chances * self._reward).sum(axis=1)[self._alive])
        self._values = np.zeros(mdp.num_states)
        self._values[self._alive] = solution.values
        self._bound = solution.error_bound

    def loss(self, state: int) -> tuple[float, float]:
        """Return what is lost when the optimal action of a state is forbidden there, and a bound on the error.

        Let `c(s)` be the expected discount until the state is met and `w(s)` the reward before that. Taking another
        action `a` at every visit is worth `v = R(a) + discount * E[w(s') + c(s') v]`, which gives `v`. The largest
        counts; since it is all that does, actions that tie need no choice between them.
        """
        own = float(self._values[state])
        others = np.flatnonzero(self._course.chances[state] == 0).tolist()
        if not others:
            return own, self._bound
        there = self._alive == state
        visits = self._system.solve(there.astype(np.float64))
        visits_from_itself = float(visits.values[there][0])
        until = np.zeros(self._course.mdp.num_states)
        until[self._alive] = np.clip(visits.values / visits_from_itself, 0.0, 1.0)
        before = self._values - until * own
        first = np.array([self._reward[state, a] + self._discount * self._expected(state, a, before) for a in others])
        again = np.array([self._discount * self._expected(state, a, until) for a in others])
        worth = first / (1 - again)
        inexact = 2 * visits.error_bound / visits_from_itself
        errors = (2 * self._bound + (abs(own) + np.abs(worth)) * inexact) / (1 - again - inexact)
        return own - float(worth.max()), self._bound + float(errors.max())

    def _expected(self, state: int, action: int, values: NDArray[np.float64]) -> float:
        """The mean of `[S]` values after an action."""
        mdp = self._course.mdp
        row = state * mdp.num_actions + action
        outcomes = slice(mdp.row_start[row], mdp.row_start[row + 1])
        return float(mdp.probability[outcomes] @ values[mdp.next_state[outcomes]])
