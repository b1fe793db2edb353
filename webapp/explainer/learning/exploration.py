"""Gathering experience: one agent acts in copies of its world, side by side."""

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.learning.encoding import NUM_ACTIONS, Encoding
from webapp.explainer.learning.replay import Codes, Experience, Replay
from webapp.explainer.learning.settings import TrainingSettings
from webapp.explainer.worlds.environment import KeyDoorEnv
from webapp.explainer.worlds.key_door import KeyDoorState
from webapp.explainer.worlds.layout import Layout


class Explorer:
    """One agent's environments, and how it acts in them.

    Part of the environments only explore; the others take the DQN's actions, too. An exploring action is any action,
    or the least tried one of the state. Each environment's first episode begins at the start; from then on a declared
    share of them, at most half, begins in a visited state, most often in one of which some action was rarely tried.
    """

    def __init__(
        self, layout: Layout, encoding: Encoding, replay: Replay, settings: TrainingSettings, rng: np.random.Generator
    ) -> None:
        self._encoding, self._replay, self._settings, self._rng = encoding, replay, settings, rng
        self._environments = [KeyDoorEnv(layout) for _ in range(settings.num_environments)]
        self._exploration = _exploration_shares(settings)
        self._num_begun = [0] * settings.num_environments
        self._num_steps = np.zeros(settings.num_environments, dtype=np.int64)
        self.num_visited_starts = 0
        self.codes: Codes = np.array([self._begin(index) for index in range(settings.num_environments)])

    @property
    def num_episodes(self) -> int:
        """How many episodes have begun, those in visited states included."""
        return sum(self._num_begun)

    def act(self, greedy: Codes) -> None:
        """Take one action in every environment and remember what happened.

        Args:
            greedy: `[E]`: the DQN's actions in the current states, `codes`.
        """
        actions = self._choose(greedy)
        first = self._num_steps == 0
        outcomes = [self._step(index, int(action)) for index, action in enumerate(actions)]
        after = self._encoding.code(np.array([outcome[0] for outcome in outcomes]))
        terminated = np.array([outcome[2] for outcome in outcomes])
        experience = Experience(
            pairs=self.codes * NUM_ACTIONS + actions,
            next_codes=after,
            rewards=np.sign(np.array([outcome[1] for outcome in outcomes], dtype=np.float32)),
            terminated=terminated,
            first=first,
        )
        self._replay.add(experience)
        self.codes = after.copy()
        over = terminated | np.array([outcome[3] for outcome in outcomes])
        for index in np.flatnonzero(over).tolist():
            self.codes[index] = self._begin(index)

    def _choose(self, greedy: Codes) -> Codes:
        settings, size = self._settings, len(greedy)
        draws = self._rng.random((size, 2))
        noise = self._rng.random((size, NUM_ACTIONS))
        least_tried = (self._replay.counts[self.codes] + noise).argmin(axis=1)
        exploring = np.where(draws[:, 1] < settings.least_tried_share, least_tried, noise.argmin(axis=1))
        actions: Codes = np.where(draws[:, 0] < self._exploration, exploring, greedy)
        return actions

    def _step(self, index: int, action: int) -> tuple[NDArray[np.int64], float, bool, bool]:
        observation, reward, terminated, truncated, _ = self._environments[index].step(action)
        self._num_steps[index] += 1
        truncated = truncated or bool(self._num_steps[index] >= self._settings.max_episode_steps)
        return observation, float(reward), terminated, truncated

    def _begin(self, index: int) -> int:
        share, number = self._settings.visited_start_share, self._num_begun[index] + 1
        from_visited = int(number * share) > int((number - 1) * share)
        options = {"state": self._visited_state()} if from_visited else None
        observation, _ = self._environments[index].reset(options=options)
        self._num_begun[index] = number
        self._num_steps[index] = 0
        self.num_visited_starts += from_visited
        return int(self._encoding.code(observation))

    def _visited_state(self) -> KeyDoorState:
        """Draw a visited state in proportion to one over the number of times its least tried action was tried."""
        counts = self._replay.counts
        visited = np.flatnonzero(counts.any(axis=1))
        weights = 1 / np.maximum(counts[visited].min(axis=1), 0.5)
        code = self._rng.choice(visited, p=weights / weights.sum())
        return KeyDoorState(*self._encoding.states[code].tolist())


def _exploration_shares(settings: TrainingSettings) -> NDArray[np.float64]:
    """Return `[E]`: the share of exploring actions in each environment."""
    num_acting = settings.num_environments - settings.num_exploring_environments
    acting = np.linspace(settings.most_exploration, settings.least_exploration, num_acting)
    return np.concatenate((np.ones(settings.num_exploring_environments), acting))
