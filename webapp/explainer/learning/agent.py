"""What training leaves behind: an agent's DQN and world model, by themselves."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray

from webapp.explainer.learning.encoding import NUM_ACTIONS, NUM_COMPONENTS, Encoding
from webapp.explainer.learning.networks import Weights, action_values
from webapp.explainer.mdp import DeterministicMDP, Policy, enumerate_mdp
from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState, start_state
from webapp.explainer.worlds.layout import Layout

States = NDArray[np.int64]
"""`[N, 5]`: x, y, heading, has_key, door_open; see `KeyDoorState`."""


class RecurrentPredictor:
    """The world model rolled out: its own predictions are its next inputs, and the hidden state is carried along.

    It is a `webapp.explainer.batched_rollouts.RecurrentWorldModel`.
    """

    num_actions = NUM_ACTIONS

    def __init__(self, encoding: Encoding, weights: Weights) -> None:
        self._encoding = encoding
        num_inputs, num_units = weights["input.weight"].shape
        # On the device "meta" no first weights are drawn from torch's global source, only to be thrown away.
        self._rnn = torch.nn.RNN(num_inputs, num_units, device="meta")
        self._readout = torch.nn.Linear(num_units, encoding.num_outputs, device="meta")
        recurrent = {
            "weight_ih_l0": weights["input.weight"].T.contiguous(),
            "weight_hh_l0": weights["hidden.weight"].T.contiguous(),
            "bias_ih_l0": weights["hidden.bias"][0],
            "bias_hh_l0": torch.zeros(num_units),
        }
        readout = {"weight": weights["readout.weight"].T.contiguous(), "bias": weights["readout.bias"][0]}
        self._rnn.load_state_dict(recurrent, assign=True)
        self._readout.load_state_dict(readout, assign=True)

    def initial(self, batch: int) -> torch.Tensor:
        """Return the zero hidden state `[batch, units]`."""
        return torch.zeros(batch, self._rnn.hidden_size)

    @torch.no_grad()
    def logits(
        self, hidden: torch.Tensor, states: torch.Tensor, actions: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Advance the hidden state and predict.

        Args:
            hidden: `[B, units]`.
            states: `[B, 5]` int64.
            actions: `[B]` int64.

        Returns:
            The next hidden state, and logits `[B, num_outputs]` in the groups of `Encoding.groups`.
        """
        chosen = torch.nn.functional.one_hot(actions, NUM_ACTIONS).float()
        inputs = torch.cat((self._encoding.observe(states), chosen), dim=1)
        _, after = self._rnn(inputs[None], hidden[None])
        return after[0], self._readout(after[0])

    def step(
        self, hidden: torch.Tensor, states: torch.Tensor, actions: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Advance the hidden state and take the most probable value of each component.

        Args:
            hidden: `[B, units]`.
            states: `[B, 5]` int64.
            actions: `[B]` int64.

        Returns:
            The next hidden state, the next states `[B, 5]`, and whether the episode ends there, `[B]`.
        """
        after, logits = self.logits(hidden, states, actions)
        most_probable = torch.stack([logits[:, group].argmax(dim=1) for group in self._encoding.groups], dim=1)
        return after, most_probable[:, :NUM_COMPONENTS], most_probable[:, NUM_COMPONENTS].bool()


@dataclass(frozen=True, eq=False)
class AgentNetworks:
    """The two networks of one map.

    Attributes:
        layout: The map.
        policy_weights: Of the DQN; `[inputs, outputs]` each.
        model_weights: Of the world model; `[inputs, outputs]` each.
    """

    layout: Layout
    policy_weights: Weights
    model_weights: Weights

    @cached_property
    def encoding(self) -> Encoding:
        """How this map's observations are written."""
        return Encoding.of(self.layout)

    @property
    def num_parameters(self) -> int:
        """Of both networks together."""
        return sum(tensor.numel() for tensor in (*self.policy_weights.values(), *self.model_weights.values()))

    def action_values(self, states: States) -> NDArray[np.float32]:
        """Return the DQN's values `[N, 5]`, one per action."""
        stacked = {name: tensor[None] for name, tensor in self.policy_weights.items()}
        observations = self.encoding.observe(torch.from_numpy(states))
        with torch.no_grad():
            values: NDArray[np.float32] = action_values(stacked, observations[None])[0].numpy()
        return values

    def policy(self, mdp: DeterministicMDP) -> Policy:
        """Return the greedy policy `[S]` on a world whose labels are `KeyDoorState`s; ties to the lowest action."""
        greedy: Policy = self.action_values(np.array(mdp.states, dtype=np.int64)).argmax(axis=1).astype(np.int32)
        return greedy

    def recurrent_model(self) -> RecurrentPredictor:
        """Return the world model for rollouts."""
        return RecurrentPredictor(self.encoding, self.model_weights)

    def predict(self, states: States, actions: NDArray[np.int64]) -> tuple[States, NDArray[np.bool_]]:
        """Ask the world model for single transitions, each from a zero hidden state.

        Args:
            states: `[N, 5]`.
            actions: `[N]`.

        Returns:
            The most probable next states `[N, 5]`, and `[N]` whether the episode ends there.
        """
        model = self.recurrent_model()
        asked = torch.from_numpy(states), torch.from_numpy(actions)
        _, after, ended = model.step(model.initial(len(states)), *asked)
        return after.numpy(), ended.numpy()

    def tabulate(self) -> DeterministicMDP:
        """Enumerate the world as the world model has it, by one query per state and action from a zero hidden state.

        Raises:
            ValueError: By the model a state ends the episode on one way in and not on another.
        """
        encoding = self.encoding
        states = np.repeat(encoding.states, NUM_ACTIONS, axis=0)
        after, ended = self.predict(states, np.tile(np.arange(NUM_ACTIONS), encoding.num_codes))
        labels, ends = after.tolist(), ended.tolist()

        def step(state: KeyDoorState, action: int) -> tuple[KeyDoorState, bool]:
            pair = int(encoding.code(np.array(state))) * NUM_ACTIONS + action
            return KeyDoorState(*labels[pair]), ends[pair]

        return enumerate_mdp(start_state(self.layout), ACTIONS, step)


@dataclass(frozen=True, eq=False)
class TrainedAgent(AgentNetworks):
    """An agent at the first checkpoint at which it passed the stop test.

    Attributes:
        seed: Of its training.
        num_iterations: Iterations until then.
        num_episodes: Episodes until then.
        num_visited_starts: How many of those began in a visited state; at most half.
        num_steps: Actions in the environment until then.
        policy_loss: The mean loss of the DQN (squared temporal-difference error) over the last window.
        model_loss: The mean loss of the world model (cross-entropy in nats, all components) over the last window.
    """

    seed: int
    num_iterations: int
    num_episodes: int
    num_visited_starts: int
    num_steps: int
    policy_loss: float
    model_loss: float

    @property
    def facts(self) -> Mapping[str, int | float]:
        """What a report says about the training, by name."""
        own = {field.name for field in fields(self)} - {field.name for field in fields(AgentNetworks)}
        return {name: getattr(self, name) for name in sorted(own)}
