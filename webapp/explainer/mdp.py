"""The finite, deterministic Markov decision process that every explanation is computed on.

Sakai et al. 2021, section 2, with `P(s' | s, a)` concentrated on one state: this is what the exact table of a
key-door world and the most probable predictions of a learned world model have in common.
"""

from collections import deque
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.labels import are_distinct
from webapp.explainer.random_step import RandomStep

StateLabel = TypeVar("StateLabel", bound=Hashable)
Policy = NDArray[np.int32]
"""`[S]`: the index of the action taken in each state. The entries of terminal states are never used."""
StateAction = tuple[int, int]
"""A state's index and an action's index."""


@dataclass(frozen=True, eq=False)
class DeterministicMDP:
    """States `0 .. S - 1`, actions `0 .. A - 1`, and where each action leads.

    Attributes:
        states: `S` distinct labels, in the order of their indices: a tuple, or `RowLabels` where they are many.
        actions: `A` names, in the order of their indices; ties are broken by the lowest index.
        next_state: `[S, A]`, the index of the state that follows. An action that cannot act, and every action of a
            terminal state, leads back to the same state.
        terminal: `[S]`, True where the episode has ended.
        goal: `[S]`, True for the terminal states that count as reaching the target.
        start: The index of the state in which an episode begins.
        reward: `[S, A]`, the reward of an action, 0 in terminal states; or None where only the goal counts.

    Raises:
        ValueError: The parts do not fit together; the message names the first that does not.

    Example:
        >>> import numpy as np
        >>> from webapp.explainer import DeterministicMDP
        >>> last = np.array([False, False, True])
        >>> world = DeterministicMDP(
        ...     ("cold", "hot", "served"), ("heat", "serve"), np.array([[1, 0], [1, 2], [2, 2]], dtype=np.int32),
        ...     terminal=last, goal=last, start=0)
        >>> world.index["served"], world.selectable.tolist()
        (2, [[True, False], [False, False], [False, False]])
    """

    states: Sequence[Hashable]
    actions: tuple[str, ...]
    next_state: NDArray[np.int32]
    terminal: NDArray[np.bool_]
    goal: NDArray[np.bool_]
    start: int
    reward: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        num_states, num_actions = len(self.states), len(self.actions)
        if num_states == 0 or num_actions == 0:
            raise ValueError(f"an MDP needs states and actions, not {num_states} and {num_actions}")
        if not are_distinct(self.states):
            raise ValueError("the state labels are not distinct")
        if self.next_state.shape != (num_states, num_actions):
            raise ValueError(f"next_state must have shape {(num_states, num_actions)}, not {self.next_state.shape}")
        if self.next_state.min() < 0 or self.next_state.max() >= num_states:
            raise ValueError(f"next_state must hold state indices from 0 to {num_states - 1}")
        for name in ("terminal", "goal"):
            shape = getattr(self, name).shape
            if shape != (num_states,):
                raise ValueError(f"{name} must have shape {(num_states,)}, not {shape}")
        if np.any(self.goal & ~self.terminal):
            raise ValueError("a goal state must be terminal")
        if np.any(self.next_state[self.terminal] != np.flatnonzero(self.terminal)[:, None]):
            raise ValueError("every action of a terminal state must lead back to it")
        if not 0 <= self.start < num_states:
            raise ValueError(f"start must be a state index from 0 to {num_states - 1}, not {self.start}")
        check_reward(self.reward, (num_states, num_actions), self.terminal)

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
        """The index of each state label. It is made when first asked for, and then holds every label."""
        return {label: i for i, label in enumerate(self.states)}

    @cached_property
    def selectable(self) -> NDArray[np.bool_]:
        """`[S, A]`: the actions a random step chooses from.

        Those that change the state and do not end the episode (Sakai et al. 2021, section 4.2.1, made precise:
        `P(s' != s) > 0` and `P(episode ends) = 0`).
        """
        own = np.arange(self.num_states, dtype=self.next_state.dtype)[:, None]
        allowed: NDArray[np.bool_] = (self.next_state != own) & ~self.terminal[self.next_state]
        return allowed

    @cached_property
    def random_step(self) -> RandomStep:
        """One random action from every state, for worlds small enough to push distributions over all of them."""
        return RandomStep.of(self.next_state, self.selectable)


def check_reward(reward: NDArray[np.float64] | None, shape: tuple[int, int], terminal: NDArray[np.bool_]) -> None:
    """Refuse rewards that do not fit a world; None is a world where only the goal counts.

    Raises:
        ValueError: They have another shape, one is no finite number, or there is something to earn in a terminal state.
    """
    if reward is None:
        return
    if reward.shape != shape:
        raise ValueError(f"reward must have shape {shape}, not {reward.shape}")
    if not np.all(np.isfinite(reward)):
        raise ValueError("a reward must be a finite number")
    if np.any(reward[terminal] != 0):
        raise ValueError("there is nothing to earn in a terminal state: its rewards must be 0")


def enumerate_mdp(
    start: StateLabel,
    actions: Sequence[str],
    step: Callable[[StateLabel, int], tuple[StateLabel, bool]],
    *,
    max_states: int = 1_000_000,
) -> DeterministicMDP:
    """Enumerate the states that can be reached from a start, breadth first and actions in order.

    Args:
        start: The label of the start state, which must not be terminal.
        actions: The names of the actions.
        step: Maps a state's label and an action's index to the next label and whether the episode ends there. The
            end is taken to be the goal.
        max_states: Refuse to enumerate more states than this.

    Raises:
        ValueError: There are more than `max_states` states.
    """
    index = {start: 0}
    terminal = [False]
    rows: list[list[int]] = []
    queue = deque([start])
    while queue:
        label = queue.popleft()
        here = index[label]
        if terminal[here]:
            rows.append([here] * len(actions))
            continue
        row = []
        for action in range(len(actions)):
            after, ended = step(label, action)
            if after not in index:
                if len(index) == max_states:
                    raise ValueError(f"more than {max_states} states can be reached; raise the limit or abstract them")
                index[after] = len(index)
                terminal.append(ended)
                queue.append(after)
            elif ended and not terminal[index[after]]:
                raise ValueError(f"state {after!r} ends the episode on one way in and not on another")
            row.append(index[after])
        rows.append(row)
    ends = np.array(terminal)
    return DeterministicMDP(
        states=tuple(index),
        actions=tuple(actions),
        next_state=np.array(rows, dtype=np.int32),
        terminal=ends,
        goal=ends.copy(),
        start=0,
    )
