"""Small deterministic worlds for tests, and the method of the paper once more, as slow and plain as can be.

The oracle knows nothing of arrays or trees: it enumerates every sequence of random actions and then walks.
"""

from collections.abc import Callable, Hashable, Iterator
from fractions import Fraction

import numpy as np
from hypothesis import assume, reject
from hypothesis import strategies as st

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan

State = Hashable
Step = Callable[[State, int], tuple[State, bool]]
"""Maps a state and an action to the next state and whether the episode ends there."""


@st.composite
def mdps(draw: st.DrawFn, max_states: int = 8, max_actions: int = 3) -> DeterministicMDP:
    """Draw a world with at least one goal, maybe dead ends, loops, and ends that are no goals."""
    num_states, num_actions = draw(st.integers(2, max_states)), draw(st.integers(1, max_actions))
    targets = st.lists(st.integers(0, num_states - 1), min_size=num_actions, max_size=num_actions)
    table = np.array(draw(st.lists(targets, min_size=num_states, max_size=num_states)), dtype=np.int32)
    goal = np.zeros(num_states, dtype=np.bool_)
    goal[num_states - 1] = True
    terminal = goal.copy()
    terminal[0] = num_states > 2 and draw(st.booleans())
    table[terminal] = np.flatnonzero(terminal)[:, None]
    start = draw(st.integers(0, num_states - 1))
    states, actions = tuple(f"s{i}" for i in range(num_states)), tuple(f"a{i}" for i in range(num_actions))
    return DeterministicMDP(states, actions, table, terminal, goal, start)


@st.composite
def mdps_with_policy(draw: st.DrawFn) -> tuple[DeterministicMDP, np.ndarray]:
    """Draw a world and any policy in it, sensible or not."""
    mdp = draw(mdps())
    choices = st.lists(st.integers(0, mdp.num_actions - 1), min_size=mdp.num_states, max_size=mdp.num_states)
    return mdp, np.array(draw(choices), dtype=np.int32)


class Oracle:
    """The method on plain dictionaries.

    Attributes:
        policy: The action taken in each state that has not ended.
        goals: The states that count as reaching the target.
    """

    def __init__(
        self, step: Step, num_actions: int, policy: dict[State, int], goals: set[State], ended: set[State]
    ) -> None:
        self._step, self._actions, self._ended = step, range(num_actions), ended
        self.policy, self.goals = policy, goals

    def return_probability(self, featured: State, random_steps: int) -> Fraction:
        ends = self._random_ends(featured, random_steps, denied=False, featured=featured)
        return sum((share for share, state in ends if self.comes_to(state, featured)), Fraction(0))

    def ace(self, featured: State, random_steps: int) -> Fraction:
        chances = []
        for denied in (False, True):
            ends = self._random_ends(featured, random_steps, denied=denied, featured=featured)
            reached = [share for share, state in ends if self.reaches_goal(state, featured if denied else None)]
            chances.append(sum(reached, Fraction(0)))
        return chances[0] - chances[1]

    def reward_importance(self, featured: State, discount: Fraction) -> Fraction:
        others = [action for action in self._actions if action != self.policy[featured]]
        denied = [self._earned(featured, self.policy | {featured: action}, discount) for action in others]
        return self._earned(featured, self.policy, discount) - max(denied, default=Fraction(0))

    def _earned(self, state: State, policy: dict[State, int], discount: Fraction) -> Fraction:
        """Walk until the goal pays 1, each action later by the discount less; a round earns nothing."""
        seen: set[State] = set()
        while state not in self._ended:
            if state in seen:
                return Fraction(0)
            seen.add(state)
            state, _ = self._step(state, policy[state])
        return discount ** (len(seen) - 1) if state in self.goals else Fraction(0)

    def _random_ends(
        self, state: State, remaining: int, *, denied: bool, featured: State
    ) -> Iterator[tuple[Fraction, State]]:
        """Yield the probability and the end of every sequence of random actions."""
        if remaining == 0:
            yield Fraction(1), state
            return
        after = [] if state in self._ended else [(action, *self._step(state, action)) for action in self._actions]
        allowed = [(action, new) for action, new, ends in after if new != state and not ends]
        if denied and state == featured:
            allowed = [(action, new) for action, new in allowed if action != self.policy[state]]
        if not allowed:
            yield Fraction(1), state
            return
        for _, new in allowed:
            for share, end in self._random_ends(new, remaining - 1, denied=denied, featured=featured):
                yield share / len(allowed), end

    def comes_to(self, state: State, featured: State) -> bool:
        """Algorithm 1's loop; a state seen twice means that it would run for ever."""
        seen = {state}
        while state not in self._ended:
            state, _ = self._step(state, self.policy[state])
            if state == featured:
                return True
            if state in seen:
                return False
            seen.add(state)
        return False

    def reaches_goal(self, state: State, forbidden: State | None) -> bool:
        seen: set[State] = set()
        while state not in self._ended:
            if state == forbidden or state in seen:
                return False
            seen.add(state)
            state, _ = self._step(state, self.policy[state])
        return state in self.goals


def oracle_of(mdp: DeterministicMDP, policy: np.ndarray) -> Oracle:
    """Return the oracle for a tabulated world; its states are the indices."""

    def step(state: State, action: int) -> tuple[State, bool]:
        assert isinstance(state, int)
        after = int(mdp.next_state[state, action])
        return after, bool(mdp.terminal[after])

    goals = {int(state) for state in np.flatnonzero(mdp.goal)}
    ended = {int(state) for state in np.flatnonzero(mdp.terminal)}
    return Oracle(step, mdp.num_actions, dict(enumerate(policy.tolist())), set(goals), set(ended))


def planned_path(mdp: DeterministicMDP) -> tuple[np.ndarray, Trajectory]:
    """Return the planner's policy and its path; a world where it does not arrive, or need not move, is not tried."""
    policy = plan(mdp)
    try:
        path = follow(mdp, policy)
    except NeverArrives:
        reject()
    assume(path.num_steps > 0)
    return policy, path
