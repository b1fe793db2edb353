"""Small stochastic worlds for tests, and their exact answers in fractions.

The oracle knows nothing of arrays: it holds dictionaries, enumerates every random action with every outcome, changes
the world where an action is forbidden, and solves what is left by elimination.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from hypothesis import strategies as st

from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import StochasticMDP, from_outcomes

Chances = dict[int, Fraction]
"""The probability of each state or action that is possible."""


@dataclass(frozen=True)
class FractionWorld:
    """A world and a policy in exact numbers, states and actions by their indices."""

    num_actions: int
    outcomes: dict[tuple[int, int], Chances]
    ended: frozenset[int]
    goals: frozenset[int]
    policy: dict[int, Chances]
    reward: dict[tuple[int, int], Fraction]

    @property
    def states(self) -> range:
        return range(len(self.outcomes) // self.num_actions)

    def chain(self) -> dict[int, Chances]:
        """Where the policy leads from each state."""
        return {state: self._mixed(self.policy[state], state) for state in self.states}

    def _mixed(self, choice: Chances, state: int) -> Chances:
        mixed: Chances = {}
        for action, chance in choice.items():
            for after, share in self.outcomes[state, action].items():
                mixed[after] = mixed.get(after, Fraction(0)) + chance * share
        return mixed

    def return_probability(self, featured: int, random_steps: int) -> Fraction:
        chain = self.chain()
        reach = reach_in_fractions(chain, {featured})
        ends = self._random_ends(featured, random_steps, featured=None)
        total = Fraction(0)
        for share, end in ends:
            if end not in self.ended:
                total += share * sum((p * reach[after] for after, p in chain[end].items()), Fraction(0))
        return total

    def ace(self, featured: int, random_steps: int) -> Fraction:
        stuck = self.chain() | {featured: {featured: Fraction(1)}}
        free, denied = reach_in_fractions(self.chain(), self.goals), reach_in_fractions(stuck, self.goals)
        allowed = sum(
            (share * free[end] for share, end in self._random_ends(featured, random_steps, None)), Fraction(0)
        )
        ends = self._random_ends(featured, random_steps, featured)
        return allowed - sum((share * denied[end] for share, end in ends), Fraction(0))

    def _random_ends(self, state: int, remaining: int, featured: int | None) -> Iterator[tuple[Fraction, int]]:
        """Yield the probability and the end of every sequence of random actions and their outcomes."""
        allowed = [action for action in range(self.num_actions) if self._selectable(state, action)]
        if state == featured:
            allowed = [action for action in allowed if action not in self.policy[state]]
        if not remaining or not allowed:
            yield Fraction(1), state
            return
        for action in allowed:
            for after, chance in self.outcomes[state, action].items():
                for share, end in self._random_ends(after, remaining - 1, featured):
                    yield share * chance / len(allowed), end

    def _selectable(self, state: int, action: int) -> bool:
        after = self.outcomes[state, action].keys()
        return bool(after - {state}) and not after & self.ended

    def reward_importance(self, featured: int, discount: Fraction) -> Fraction:
        """Tries each other action in a world of its own, where the policy takes it whenever it is in the state."""
        changed = [
            self._values(self.policy | {featured: {action: Fraction(1)}}, discount)[featured]
            for action in self.others(featured)
        ]
        return self._values(self.policy, discount)[featured] - max(changed, default=Fraction(0))

    def action_values(self, state: int, discount: Fraction) -> dict[int, Fraction]:
        """Return what each action is worth if the policy is free to go on as ever."""
        values = self._values(self.policy, discount)
        later = {
            action: sum((p * values[after] for after, p in self.outcomes[state, action].items()), Fraction(0))
            for action in range(self.num_actions)
        }
        return {action: self.reward[state, action] + discount * later[action] for action in later}

    def others(self, state: int) -> list[int]:
        """Return the actions that the policy never takes in a state."""
        return [action for action in range(self.num_actions) if action not in self.policy[state]]

    def meets_again(self, state: int) -> bool:
        """Return whether an action that the policy never takes in a state can lead back to it."""
        reach = reach_in_fractions(self.chain(), {state})
        return any(reach[after] for action in self.others(state) for after in self.outcomes[state, action])

    def _values(self, policy: dict[int, Chances], discount: Fraction) -> dict[int, Fraction]:
        alive = [state for state in self.states if state not in self.ended]
        rows = {}
        for state in alive:
            moves = self._mixed(policy[state], state)
            row = {other: -discount * moves.get(other, Fraction(0)) for other in alive}
            row[state] += 1
            rows[state] = (row, sum((p * self.reward[state, a] for a, p in policy[state].items()), Fraction(0)))
        return dict.fromkeys(self.states, Fraction(0)) | _eliminate(rows)


def reach_in_fractions(chain: dict[int, Chances], targets: set[int] | frozenset[int]) -> dict[int, Fraction]:
    """Return the probability of reaching a set from every state of a chain."""
    able = set(targets)
    while more := {state for state, moves in chain.items() if state not in able and able & moves.keys()}:
        able |= more
    rows = {}
    for state in able - targets:
        row = {other: -chain[state].get(other, Fraction(0)) for other in able - targets}
        row[state] += 1
        rows[state] = (row, sum((p for after, p in chain[state].items() if after in targets), Fraction(0)))
    return dict.fromkeys(chain, Fraction(0)) | dict.fromkeys(targets, Fraction(1)) | _eliminate(rows)


def _eliminate(rows: dict[int, tuple[dict[int, Fraction], Fraction]]) -> dict[int, Fraction]:
    """Solve a linear system by Gauss and Jordan's elimination."""
    rows = {state: (dict(row), right) for state, (row, right) in rows.items()}
    free, pivots = set(rows), {}
    for unknown in list(rows):
        pivot = next(name for name in sorted(free) if rows[name][0][unknown] != 0)
        free.remove(pivot)
        pivots[unknown] = pivot
        row, right = rows[pivot]
        factor = row[unknown]
        row, right = {name: value / factor for name, value in row.items()}, right / factor
        rows[pivot] = row, right
        for name, (other, other_right) in rows.items():
            if name != pivot and (scale := other[unknown]):
                rows[name] = {key: other[key] - scale * row[key] for key in row}, other_right - scale * right
    return {unknown: rows[pivot][1] for unknown, pivot in pivots.items()}


def _shares(weights: Sequence[int]) -> Chances:
    return {i: Fraction(weight, sum(weights)) for i, weight in enumerate(weights) if weight}


@st.composite
def fraction_worlds(
    draw: st.DrawFn, max_states: int = 5, max_actions: int = 3, *, waiting: bool = False
) -> FractionWorld:
    """Draw a world with a goal, maybe an end that is none, traps and loops, and any policy in it.

    Maybe it has one more action, to wait, that earns nothing and that the policy never takes.
    """
    num_states, num_actions = draw(st.integers(2, max_states)), draw(st.integers(1, max_actions))
    goals = frozenset({num_states - 1})
    ended = goals | ({0} if num_states > 2 and draw(st.booleans()) else set())

    def distribution(size: int) -> Chances:
        return _shares(draw(st.lists(st.sampled_from([0, 0, 1, 2, 5]), min_size=size, max_size=size).filter(any)))

    pairs = [(state, action) for state in range(num_states) for action in range(num_actions)]
    outcomes = {(s, a): {s: Fraction(1)} if s in ended else distribution(num_states) for s, a in pairs}
    reward = {pair: Fraction(0 if pair[0] in ended else draw(st.integers(-2, 2))) for pair in pairs}
    policy = {state: distribution(num_actions) for state in range(num_states)}
    if waiting:
        outcomes |= {(state, num_actions): {state: Fraction(1)} for state in range(num_states)}
        reward |= {(state, num_actions): Fraction(0) for state in range(num_states)}
        num_actions += 1
    return FractionWorld(num_actions, outcomes, ended, goals, policy, reward)


def as_mdp(world: FractionWorld) -> StochasticMDP:
    """Return the world as the solvers take it."""
    num_states = len(world.states)
    flags = np.arange(num_states)
    return from_outcomes(
        [f"s{state}" for state in world.states],
        [f"a{action}" for action in range(world.num_actions)],
        [(s, a, after, float(p)) for (s, a), chances in world.outcomes.items() for after, p in chances.items()],
        terminal=np.isin(flags, list(world.ended)),
        goal=np.isin(flags, list(world.goals)),
        start=0,
        reward=np.array(
            [[float(world.reward[s, a]) for a in range(world.num_actions)] for s in world.states],
        ),
    )


def policy_of(world: FractionWorld) -> np.ndarray:
    """Return the policy as `[S, A]`."""
    return np.array([[float(world.policy[s].get(a, 0)) for a in range(world.num_actions)] for s in world.states])


def some_path(world: FractionWorld) -> Trajectory | None:
    """Return a way to the goal that the policy may take, from a state as far off as possible, or None."""
    alive = [state for state in world.states if state not in world.ended]
    steps = {(s, a, after) for s in alive for a in world.policy[s] for after in world.outcomes[s, a]}
    ways: dict[int, Trajectory] = {goal: Trajectory((goal,), ()) for goal in world.goals}
    last = None
    while found := sorted((s, a, after) for s, a, after in steps if s not in ways and after in ways):
        s, a, after = found[0]
        ways[s] = last = Trajectory((s, *ways[after].states), (a, *ways[after].actions))
    return last
