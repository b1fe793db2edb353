"""The finite Markov decision process whose actions have chances instead of certain outcomes.

Sakai et al. 2021, section 2, as printed: `P(s' | s, a)`. Only transitions that can happen are stored, so memory grows
with their number and not with the square of the states.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from webapp.explainer.labels import are_distinct, made_distinct
from webapp.explainer.mdp import DeterministicMDP, Policy, check_reward

StochasticPolicy = NDArray[np.float64]
"""`[S, A]`: the probability of each action in each state. The rows of terminal states are never used."""
AnyPolicy = Policy | StochasticPolicy
"""One action per state, `[S]`, or a probability per action, `[S, A]`."""

_TOLERANCE = 1e-9
"""So far may a sum of probabilities lie from 1."""


@dataclass(frozen=True, eq=False)
class StochasticMDP:
    """States `0 .. S - 1`, actions `0 .. A - 1`, and the chances of where each action leads.

    The outcomes of action `a` in state `s` are the entries `row_start[s * A + a]` up to, not including,
    `row_start[s * A + a + 1]` of `next_state` and `probability`. `from_outcomes` builds these arrays from a list.

    Attributes:
        states: `S` distinct labels, in the order of their indices. A `range`, or a sequence whose attribute `distinct`
            is true, is distinct by construction and is not read.
        actions: `A` names, in the order of their indices.
        row_start: `[S * A + 1]`, from 0 to N, never falling.
        next_state: `[N]` state indices, ascending within a row.
        probability: `[N]`, above 0; each row sums to 1 within 1e-9.
        terminal: `[S]`, True where the episode has ended. Every action of a terminal state leads back to it.
        goal: `[S]`, True for the terminal states that count as reaching the target.
        start: The index of the state in which an episode begins.
        reward: `[S, A]`, the expected reward of an action, 0 in terminal states; or None where only the goal counts.

    Raises:
        ValueError: The parts do not fit together; the message names the first that does not.

    Example:
        >>> import numpy as np
        >>> from webapp.explainer import from_outcomes
        >>> last = np.array([False, True])
        >>> sending = [(0, 0, 1, 0.75), (0, 0, 0, 0.25)]
        >>> world = from_outcomes(("unsent", "sent"), ("send",), sending, terminal=last, goal=last, start=0)
        >>> world.row_start.tolist(), world.next_state.tolist(), world.probability.tolist()
        ([0, 2, 3], [0, 1, 1], [0.25, 0.75, 1.0])
    """

    states: Sequence[Hashable]
    actions: tuple[str, ...]
    row_start: NDArray[np.int64]
    next_state: NDArray[np.int32]
    probability: NDArray[np.float64]
    terminal: NDArray[np.bool_]
    goal: NDArray[np.bool_]
    start: int
    reward: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if not self.num_states or not self.num_actions:
            raise ValueError(f"an MDP needs states and actions, not {self.num_states} and {self.num_actions}")
        if not are_distinct(self.states):
            raise ValueError("the state labels are not distinct")
        for name in ("terminal", "goal"):
            flags = getattr(self, name)
            if flags.shape != (self.num_states,) or flags.dtype != np.bool_:
                raise ValueError(f"{name} must be [{self.num_states}] booleans, not {flags.shape} of {flags.dtype}")
        if np.any(self.goal & ~self.terminal):
            raise ValueError(f"a goal state must be terminal, and {self._first(self.goal & ~self.terminal)!r} is not")
        if not 0 <= self.start < self.num_states:
            raise ValueError(f"start must be a state index from 0 to {self.num_states - 1}, not {self.start}")
        self._check_rows()
        self._check_outcomes()
        check_reward(self.reward, (self.num_states, self.num_actions), self.terminal)

    def _first(self, flags: NDArray[np.bool_]) -> Hashable:
        return self.states[int(np.argmax(flags))]

    def _check_rows(self) -> None:
        num_rows, num_outcomes = self.num_states * self.num_actions, len(self.next_state)
        if self.row_start.shape != (num_rows + 1,):
            raise ValueError(f"row_start must have shape {(num_rows + 1,)}, not {self.row_start.shape}")
        if self.row_start[0] != 0 or self.row_start[-1] != num_outcomes or np.any(np.diff(self.row_start) < 0):
            raise ValueError(f"row_start must rise from 0 to the number of outcomes, {num_outcomes}")
        if self.next_state.shape != (num_outcomes,) or self.probability.shape != (num_outcomes,):
            raise ValueError(f"{self.next_state.shape} next states need as many chances, not {self.probability.shape}")
        for name in ("row_start", "next_state"):
            if not np.issubdtype(getattr(self, name).dtype, np.integer):
                raise ValueError(f"{name} must hold integers, not {getattr(self, name).dtype}")

    def _check_outcomes(self) -> None:
        rows = self._row_of_outcome()
        if np.any((self.next_state < 0) | (self.next_state >= self.num_states)):
            raise ValueError(f"next_state must hold state indices from 0 to {self.num_states - 1}")
        _refuse_negative(self.probability)
        if np.any(self.probability == 0):
            raise ValueError("what cannot happen is left out: a stored probability must be above 0")
        if np.any((np.diff(rows) == 0) & (np.diff(self.next_state) <= 0)):
            raise ValueError("the next states of one action must ascend, each named once")
        sums = np.bincount(rows, weights=self.probability, minlength=len(self.row_start) - 1)
        wrong = np.abs(sums - 1) > _TOLERANCE
        if np.any(wrong):
            state, action = divmod(int(np.argmax(wrong)), self.num_actions)
            raise ValueError(
                f"the probabilities after {self.actions[action]!r} in {self.states[state]!r} must sum to 1, "
                f"not {sums[np.argmax(wrong)]}"
            )
        origin = rows // self.num_actions
        leaves = self.terminal[origin] & (self.next_state != origin)
        if np.any(leaves):
            raise ValueError(
                f"every action of a terminal state must lead back to it, not out of {self.states[origin[leaves][0]]!r}"
            )

    def _row_of_outcome(self) -> NDArray[np.int64]:
        return np.repeat(np.arange(len(self.row_start) - 1), np.diff(self.row_start))

    @property
    def num_states(self) -> int:
        """S."""
        return len(self.states)

    @property
    def num_actions(self) -> int:
        """A."""
        return len(self.actions)

    @cached_property
    def index(self) -> dict[Hashable, int]:
        """The index of each state label."""
        return {label: i for i, label in enumerate(self.states)}

    @cached_property
    def selectable(self) -> NDArray[np.bool_]:
        """`[S, A]`: the actions a random step chooses from.

        Those that may change the state and cannot end the episode (Sakai et al. 2021, section 4.2.1, made precise:
        `P(s' != s) > 0` and `P(episode ends) = 0`).
        """
        rows = self._row_of_outcome()
        moves = np.zeros(self.num_states * self.num_actions, dtype=np.bool_)
        ends = moves.copy()
        moves[rows[self.next_state != rows // self.num_actions]] = True
        ends[rows[self.terminal[self.next_state]]] = True
        return (moves & ~ends).reshape(self.num_states, self.num_actions)

    @cached_property
    def goal_chance(self) -> NDArray[np.float64]:
        """`[S, A]`: the probability that an action enters a goal at once, 0 in terminal states.

        The expected reward of a world that pays 1 for the goal and nothing else.
        """
        rows = self._row_of_outcome()
        enters = self.goal[self.next_state] & ~self.terminal[rows // self.num_actions]
        chances = np.zeros(self.num_states * self.num_actions)
        np.add.at(chances, rows[enters], self.probability[enters])
        return chances.reshape(self.num_states, self.num_actions)


World = DeterministicMDP | StochasticMDP


def from_outcomes(
    states: Sequence[Hashable],
    actions: Sequence[str],
    outcomes: ArrayLike,
    *,
    terminal: NDArray[np.bool_],
    goal: NDArray[np.bool_],
    start: int,
    reward: NDArray[np.float64] | None = None,
) -> StochasticMDP:
    """Build a world from a list of what can happen.

    Args:
        states: `S` distinct labels.
        actions: `A` names.
        outcomes: `[N, 4]`: state, action, next state and probability, in any order. Outcomes named more than once add
            up; those of probability 0 are dropped. Terminal states need none.
        terminal: `[S]`.
        goal: `[S]`.
        start: A state's index.
        reward: `[S, A]`, or None.

    Raises:
        ValueError: The parts do not fit together; the message names the first that does not.

    Example:
        >>> import numpy as np
        >>> from webapp.explainer import from_outcomes
        >>> last, outcomes = np.array([False, True]), [(0, 0, 0, 0.25), (0, 0, 1, 0.75)]
        >>> from_outcomes(("unsent", "sent"), ("send",), outcomes, terminal=last, goal=last, start=0).goal_chance
        array([[0.75],
               [0.  ]])
    """
    table = np.asarray(outcomes, dtype=np.float64).reshape(-1, 4)
    _refuse_negative(table[:, 3])
    _check_indices("state", table[:, 0], len(states))
    _check_indices("action", table[:, 1], len(actions))
    _check_indices("next state", table[:, 2], len(states))
    origin, action, after = table[:, :3].T.astype(np.int64)
    ended = np.repeat(np.setdiff1d(np.flatnonzero(terminal), origin), len(actions))
    origin = np.concatenate((origin, ended))
    action = np.concatenate((action, np.arange(len(ended)) % len(actions)))
    after = np.concatenate((after, ended))
    probability = np.concatenate((table[:, 3], np.ones(len(ended))))
    possible = probability != 0
    keys = ((origin * len(actions) + action) * len(states) + after)[possible]
    distinct, places = np.unique(keys, return_inverse=True)
    chances = np.zeros(len(distinct))
    np.add.at(chances, places, probability[possible])
    rows, next_state = np.divmod(distinct, len(states))
    return StochasticMDP(
        states=states if made_distinct(states) else tuple(states),
        actions=tuple(actions),
        row_start=np.searchsorted(rows, np.arange(len(states) * len(actions) + 1)).astype(np.int64),
        next_state=next_state.astype(np.int32),
        probability=chances,
        terminal=terminal,
        goal=goal,
        start=start,
        reward=reward,
    )


def from_deterministic(mdp: DeterministicMDP, reward: NDArray[np.float64] | None = None) -> StochasticMDP:
    """Return the same world with every outcome certain.

    Args:
        mdp: The world.
        reward: `[S, A]`, the reward of each action; the world's own when left out.
    """
    num_rows = mdp.next_state.size
    return StochasticMDP(
        states=mdp.states,
        actions=mdp.actions,
        row_start=np.arange(num_rows + 1, dtype=np.int64),
        next_state=mdp.next_state.ravel(),
        probability=np.ones(num_rows),
        terminal=mdp.terminal,
        goal=mdp.goal,
        start=mdp.start,
        reward=mdp.reward if reward is None else reward,
    )


def action_probabilities(mdp: World, policy: AnyPolicy) -> StochasticPolicy:
    """Return `[S, A]`: how likely the policy takes each action, one shape for both kinds of policy.

    Raises:
        ValueError: The policy does not fit the world, or a row of it is no probability distribution.
    """
    shape = (mdp.num_states, mdp.num_actions)
    alive = ~mdp.terminal
    if policy.shape == shape[:1]:
        chosen = policy[alive]
        if not np.issubdtype(policy.dtype, np.integer) or np.any((chosen < 0) | (chosen >= mdp.num_actions)):
            raise ValueError(f"a policy must hold action indices from 0 to {mdp.num_actions - 1}")
        chances = np.zeros(shape)
        chances[np.flatnonzero(alive), chosen] = 1.0
        return chances
    if policy.shape != shape:
        raise ValueError(f"a policy must have shape {shape[:1]} or {shape}, not {policy.shape}")
    _refuse_negative(policy[alive].astype(np.float64))
    wrong = alive & (np.abs(np.where(alive[:, None], policy, 0.0).sum(axis=1) - 1) > _TOLERANCE)
    if np.any(wrong):
        state = mdp.states[int(np.argmax(wrong))]
        raise ValueError(f"the policy's probabilities in {state!r} must sum to 1, not {policy[np.argmax(wrong)].sum()}")
    return np.where(alive[:, None], policy, 0.0).astype(np.float64)


def _refuse_negative(probability: NDArray[np.float64]) -> None:
    wrong = ~np.isfinite(probability) | (probability < 0)
    if np.any(wrong):
        raise ValueError(f"a probability must be a number from 0 to 1, not {probability[wrong][0]}")


def _check_indices(name: str, values: NDArray[np.float64], count: int) -> None:
    wrong = (values != np.floor(values)) | (values < 0) | (values >= count)
    if np.any(wrong):
        raise ValueError(f"an outcome's {name} must be an index from 0 to {count - 1}, not {values[wrong][0]}")
