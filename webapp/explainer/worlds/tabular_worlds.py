"""Gymnasium environments that hold a table of their model: FrozenLake, Taxi, CliffWalking and others with a `P`.

`P[state][action]` lists what can happen as `(probability, next state, reward, terminated)`, so nothing is sampled.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import gymnasium
from gymnasium.envs.toy_text.cliffwalking import CliffWalkingEnv
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv
from gymnasium.envs.toy_text.taxi import TaxiEnv

from webapp.explainer.seeding import stream
from webapp.explainer.worlds.finite import GUIDE, NotFinite, Outcome
from webapp.explainer.worlds.spaces import action_names

_NUM_WALKED = 200
"""So many steps are taken to see whether the table and the environment say the same."""


class CellState(NamedTuple):
    """A place on FrozenLake's or CliffWalking's map.

    Attributes:
        row: From 0 at the top.
        column: From 0 at the left.
    """

    row: int
    column: int


class TaxiState(NamedTuple):
    """What there is to know in Taxi.

    Attributes:
        row: Of the taxi, from 0 at the top.
        column: Of the taxi, from 0 at the left.
        passenger: The stand where the passenger waits, red, green, yellow or blue, or "in the taxi".
        destination: The stand to which the passenger wants to go.
    """

    row: int
    column: int
    passenger: str
    destination: str


@dataclass(frozen=True, slots=True)
class _Wording:
    """How an environment's numbers are put into words.

    Attributes:
        actions: The names of the actions, or None where they have none.
        label: Makes a label of a state's number.
        describe: Puts a label into words.
        is_goal: Says whether a label is a goal, where the map shows it better than the rewards of ends in reach.
    """

    actions: tuple[str, ...] | None
    label: Callable[[Any, int], Hashable]
    describe: Callable[[Any, Any], str]
    is_goal: Callable[[Any, Any], bool] | None = None


class TableWorld:
    """The world of an environment with a table `P`.

    Attributes:
        name: What to call it in messages.
        actions: The names of its actions.
        start: The state in which `reset` begins.
        least_goal_reward: The most that any end in the table pays, within reach or not: only such an end is a goal. On
            FrozenLake the map tells which cell is.

    Args:
        env: The environment, without wrappers.
        seed: Of `reset`.
        name: What to call it in messages.

    Raises:
        NotFinite: The table is not the whole truth about the environment.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int, name: str) -> None:
        if getattr(env, "fickle_passenger", False):
            raise NotFinite(
                f"{name} with a fickle passenger keeps a memory that its table leaves out; take fickle_passenger=false"
            )
        self.name = name
        self._env = env
        self._wording = next((words for kind, words in _WORDINGS if isinstance(env, kind)), _PLAIN)
        self.actions: Sequence[str] = action_names(env, name, self._wording.actions)
        self._table: Any = env.P  # type: ignore[attr-defined]  # Whoever calls this has seen it.
        states = list(self._table) if isinstance(self._table, Mapping) else range(len(self._table))
        self._labels = {int(state): self._wording.label(env, int(state)) for state in states}
        self._numbers = {label: state for state, label in self._labels.items()}
        start = int(env.reset(seed=seed)[0])
        self.start: Hashable = self._labels[start]
        self.least_goal_reward = self._best_end(states)
        if self._wording.is_goal is not None:
            self.is_goal: Callable[[Hashable], bool] = partial(self._wording.is_goal, env)
        self._compare_with_steps(start, seed)

    def outcomes(self, state: Hashable, action: int) -> Iterable[Outcome]:
        """Return what the table says."""
        for probability, after, reward, ended in self._table[self._numbers[state]][action]:
            yield Outcome(float(probability), self._labels[int(after)], float(reward), bool(ended))

    def describe(self, state: Hashable) -> str:
        """Put a state into words."""
        return self._wording.describe(self._env, state)

    def _best_end(self, states: Iterable[int]) -> float:
        rows = (self._table[state][action] for state in states for action in range(len(self.actions)))
        ends = [float(reward) for row in rows for _, _, reward, ended in row if ended]
        return max(ends, default=0.0)

    def _compare_with_steps(self, start: int, seed: int) -> None:
        """Refuse a table that does not hold what the environment does.

        Raises:
            NotFinite: A step did something that the table lacks.
        """
        env, state, rng = self._env, start, stream(seed, "worlds", "table")
        for _ in range(_NUM_WALKED):
            action = int(rng.integers(len(self.actions)))
            observation, reward, ended, truncated, _ = env.step(action)
            seen = int(observation), float(reward), bool(ended)
            rows = self._table[state][action]
            if seen not in [(int(after), float(paid), bool(end)) for _, after, paid, end in rows]:
                raise NotFinite(
                    f"{self.name} holds a table P that is not what its steps do: {self.actions[action]!r} in "
                    f"{self._labels[state]!r} led to {seen}; bring the right table through the protocol of {GUIDE}"
                )
            state = int(env.reset(seed=seed)[0]) if ended or truncated else seen[0]


def _cell(env: Any, state: int) -> CellState:  # noqa: ANN401 - two classes that share no type.
    columns = env.ncol if isinstance(env, FrozenLakeEnv) else env.shape[1]
    return CellState(*divmod(state, int(columns)))


def _taxi(env: TaxiEnv, state: int) -> TaxiState:
    row, column, passenger, destination = env.decode(state)
    return TaxiState(row, column, _PLACES[passenger], _PLACES[destination])


def _describe_lake(env: Any, state: CellState) -> str:  # noqa: ANN401 - its map is typed as what it is made from.
    ground = {b"S": "the start", b"F": "ice", b"H": "a hole", b"G": "the goal"}[
        bytes(env.desc[state.row, state.column])
    ]
    return f"row {state.row}, column {state.column}: {ground}"


def _is_lake_goal(env: Any, state: CellState) -> bool:  # noqa: ANN401 - as above.
    return bytes(env.desc[state.row, state.column]) == b"G"


def _describe_taxi(_: TaxiEnv, state: TaxiState) -> str:
    riding = state.passenger == _PLACES[-1]
    passenger = "in it" if riding else f"at the {state.passenger} stand"
    return f"taxi in row {state.row}, column {state.column}, passenger {passenger}, bound for {state.destination}"


_PLACES = ("red", "green", "yellow", "blue", "in the taxi")

_PLAIN = _Wording(None, lambda _, state: state, lambda _, label: f"state {label}")
_WORDINGS: tuple[tuple[type, _Wording], ...] = (
    (FrozenLakeEnv, _Wording(("left", "down", "right", "up"), _cell, _describe_lake, _is_lake_goal)),
    (
        CliffWalkingEnv,
        _Wording(("up", "right", "down", "left"), _cell, lambda _, cell: f"row {cell.row}, column {cell.column}"),
    ),
    (TaxiEnv, _Wording(("south", "north", "east", "west", "pickup", "dropoff"), _taxi, _describe_taxi)),
)
