"""What one agent has experienced, and how it is replayed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.learning.encoding import NUM_ACTIONS
from webapp.explainer.learning.settings import TrainingSettings

Codes = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Experience:
    """Transitions, in any shape.

    Attributes:
        pairs: The state and the action, as `Encoding` numbers them.
        next_codes: The next state.
        rewards: Clipped to their sign (Mnih et al. 2015). MiniGrid's reward for the goal falls with the number of
            steps since the episode began, which the observation does not tell; that a shorter way is better follows
            from the discount alone.
        terminated: Whether the goal was reached and the episode ended.
        first: Whether the episode began with this transition.
    """

    pairs: Codes
    next_codes: Codes
    rewards: NDArray[np.float32]
    terminated: Flags
    first: Flags


class Priorities:
    """How much a network needs each state-action pair: a power of its last loss on it, relative to the batch's mean."""

    def __init__(self, num_pairs: int, exponent: float) -> None:
        self._relative = np.ones(num_pairs)
        self._exponent = exponent

    def update(self, pairs: Codes, losses: NDArray[np.float32]) -> None:
        """Note the losses `[N]` of pairs `[N]` that were replayed together."""
        self._relative[pairs] = losses / max(float(losses.mean()), _SMALLEST_MEAN)

    def weights(self, pairs: Codes) -> NDArray[np.float64]:
        """Return positive weights in the shape of the pairs."""
        weights: NDArray[np.float64] = (self._relative[pairs] + _SMALLEST_PRIORITY) ** self._exponent
        return weights


class Replay:
    """The memory of one agent; nothing is forgotten.

    A row holds one transition of each environment. Transitions are drawn such that every state-action pair that was
    met counts the same, however often it was met, or in proportion to its priority (prioritized replay, Schaul et al.
    2016, on pairs instead of transitions). Importance weights are not needed: the world is deterministic, so that
    every way of drawing has the same solution.
    """

    def __init__(self, num_pairs: int, settings: TrainingSettings) -> None:
        shape = (settings.num_warmup_steps + settings.max_iterations, settings.num_environments)
        self._settings = settings
        self._memory = Experience(
            pairs=np.zeros(shape, dtype=np.int64),
            next_codes=np.zeros(shape, dtype=np.int64),
            rewards=np.zeros(shape, dtype=np.float32),
            terminated=np.zeros(shape, dtype=np.bool_),
            first=np.zeros(shape, dtype=np.bool_),
        )
        self._num_rows = 0
        self._counts = np.zeros(num_pairs, dtype=np.int64)

    @property
    def counts(self) -> Codes:
        """`[codes, actions]`: how often each action was taken in each state."""
        return self._counts.reshape(-1, NUM_ACTIONS)

    @property
    def num_transitions(self) -> int:
        """How many transitions are held."""
        return self._num_rows * self._settings.num_environments

    def add(self, row: Experience) -> None:
        """Add one transition of each environment, `[E]`."""
        memory, here = self._memory, self._num_rows
        memory.pairs[here] = row.pairs
        memory.next_codes[here] = row.next_codes
        memory.rewards[here] = row.rewards
        memory.terminated[here] = row.terminated
        memory.first[here] = row.first
        np.add.at(self._counts, row.pairs, 1)
        self._num_rows += 1

    def lottery(self, priorities: Priorities, length: int = 1) -> "Lottery":
        """Weigh what is held now, for drawing until the weights are brought up to date.

        Args:
            priorities: Of the network that learns from the draws.
            length: Only transitions that are followed by `length - 1` more in memory are drawn.
        """
        pairs = self._memory.pairs[: self._num_rows - length + 1]
        even = 1 / self._counts[pairs]
        urgent = even * priorities.weights(pairs)
        share = self._settings.even_share
        weights = share * even / even.sum() + (1 - share) * urgent / urgent.sum()
        return Lottery(np.cumsum(weights), even / even.sum() / weights)

    def at(self, rows: Codes, environments: Codes) -> Experience:
        """Return the transitions at some places of the memory, in the shape of the places."""
        memory = self._memory
        return Experience(
            pairs=memory.pairs[rows, environments],
            next_codes=memory.next_codes[rows, environments],
            rewards=memory.rewards[rows, environments],
            terminated=memory.terminated[rows, environments],
            first=memory.first[rows, environments],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Lottery:
    """Places in a memory, each with its chance.

    Attributes:
        cumulative: `[rows * E]` running sums of the chances, row by row.
        evenness: `[rows, E]`: how much more often a place would be drawn if every pair counted the same. A mean over
            draws, weighted by it, is an unbiased estimate of the mean over even draws.
    """

    cumulative: NDArray[np.float64]
    evenness: NDArray[np.float64]

    def draw(self, count: int, rng: np.random.Generator) -> "Places":
        """Return independent draws `[count]`."""
        tickets = rng.random(count) * self.cumulative[-1]
        places = np.minimum(np.searchsorted(self.cumulative, tickets, side="right"), len(self.cumulative) - 1)
        rows, environments = np.divmod(places, self.evenness.shape[1])
        return Places(rows, environments, self.evenness[rows, environments])


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Drawn places in a memory: `[N]` rows, environments, and `evenness` as in `Lottery`."""

    rows: Codes
    environments: Codes
    evenness: NDArray[np.float64]


_SMALLEST_PRIORITY = 0.02
_SMALLEST_MEAN = 1e-12
