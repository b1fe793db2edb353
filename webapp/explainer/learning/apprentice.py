"""One agent while it learns: all of it but the weights, which stand in the stack."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.learning.agent import AgentNetworks, TrainedAgent
from webapp.explainer.learning.encoding import NUM_ACTIONS, Encoding
from webapp.explainer.learning.exploration import Explorer
from webapp.explainer.learning.networks import Weights
from webapp.explainer.learning.replay import Codes, Experience, Lottery, Priorities, Replay
from webapp.explainer.learning.settings import TrainingSettings
from webapp.explainer.learning.stop_test import Verdict, has_flattened, judge
from webapp.explainer.seeding import stream
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import Layout

NetworkName = Literal["policy", "model"]


class Apprentice:
    """One agent's experience, what it replays next, its losses, and its stop test.

    Its random streams depend on its seed and its map alone, not on who else is in the stack.

    Attributes:
        encoding: Of its own map.
    """

    def __init__(self, layout: Layout, seed: int, common: Encoding, settings: TrainingSettings) -> None:
        self.encoding = Encoding.of(layout)
        self._layout, self._seed, self._settings = layout, seed, settings
        self._table = tabulate(layout)
        num_pairs = common.num_codes * NUM_ACTIONS
        self._replay = Replay(num_pairs, settings)
        self._explorer = Explorer(layout, common, self._replay, settings, self.rng("exploration"))
        self._draws: dict[NetworkName, np.random.Generator] = {
            "policy": self.rng("replay for the policy"),
            "model": self.rng("replay for the model"),
        }
        self._priorities: dict[NetworkName, Priorities] = {
            "policy": Priorities(num_pairs, settings.policy_priority_exponent),
            "model": Priorities(num_pairs, settings.model_priority_exponent),
        }
        self._losses: dict[NetworkName, list[float]] = {"policy": [], "model": []}
        self._lotteries: dict[NetworkName, Lottery] = {}

    @property
    def codes(self) -> Codes:
        """`[E]`: the states in which it is to act."""
        return self._explorer.codes

    def rng(self, purpose: str) -> np.random.Generator:
        """Return the stream of one purpose."""
        return stream(self._seed, "learning", str(self._layout), purpose)

    def act(self, greedy: Codes) -> None:
        """Take one action in every environment; see `Explorer.act`."""
        self._explorer.act(greedy)

    def refresh(self) -> None:
        """Bring up to date what is replayed how often."""
        length = self._settings.sequence_length
        self._lotteries = {
            "policy": self._replay.lottery(self._priorities["policy"]),
            "model": self._replay.lottery(self._priorities["model"], length),
        }

    def transitions(self) -> tuple[Experience, NDArray[np.float64]]:
        """Draw the transitions `[B]` of one update of the DQN; their evenness `[B]` is that of `Lottery`."""
        places = self._lotteries["policy"].draw(self._settings.policy_batch, self._draws["policy"])
        return self._replay.at(places.rows, places.environments), places.evenness

    def sequences(self) -> tuple[Experience, Experience, NDArray[np.float64]]:
        """Draw the sequences `[L, B]` and the single transitions `[N]` of one update of the world model.

        Their evenness `[B + N]` is that of the first transition of each.
        """
        num_sequences = self._settings.num_sequences
        count = num_sequences + self._settings.num_single_queries + self._settings.num_borrowed_queries
        places = self._lotteries["model"].draw(count, self._draws["model"])
        steps = np.arange(self._settings.sequence_length)[:, None]
        rows, environments = places.rows[:num_sequences] + steps, places.environments[:num_sequences] + 0 * steps
        singles = self._replay.at(places.rows[num_sequences:], places.environments[num_sequences:])
        return self._replay.at(rows, environments), singles, places.evenness

    def note(self, network: NetworkName, pairs: Codes, losses: NDArray[np.float32]) -> None:
        """Remember the losses `[N]` of one update on pairs `[N]` as priorities."""
        self._priorities[network].update(pairs, losses)

    def close_iteration(self, policy_loss: float, model_loss: float) -> None:
        """Remember the mean losses of one iteration."""
        self._losses["policy"].append(policy_loss)
        self._losses["model"].append(model_loss)

    @property
    def has_flattened(self) -> bool:
        """Whether both losses have."""
        window, change = self._settings.window_iterations, self._settings.max_relative_change
        return all(has_flattened(np.array(losses[-2 * window :]), window, change) for losses in self._losses.values())

    def judge(self, networks: AgentNetworks) -> Verdict:
        """Compare networks with the world's table."""
        return judge(networks, self._table)

    def networks(self, policy_weights: Weights, model_weights: Weights) -> AgentNetworks:
        """Return its networks from its weights, without padding."""
        return AgentNetworks(self._layout, policy_weights, model_weights)

    def graduate(self, networks: AgentNetworks) -> TrainedAgent:
        """Return the agent as it is now."""
        window = self._settings.window_iterations
        return TrainedAgent(
            layout=self._layout,
            policy_weights=networks.policy_weights,
            model_weights=networks.model_weights,
            seed=self._seed,
            num_iterations=len(self._losses["policy"]),
            num_episodes=self._explorer.num_episodes,
            num_visited_starts=self._explorer.num_visited_starts,
            num_steps=self._replay.num_transitions,
            policy_loss=float(np.mean(self._losses["policy"][-window:])),
            model_loss=float(np.mean(self._losses["model"][-window:])),
        )
