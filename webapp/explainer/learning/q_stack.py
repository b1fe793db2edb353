"""The Q-networks of many agents in one stack: independent weights, optimizer states and target values.

One batched matrix product serves all slots of the stack; whatever else happens, happens for each slot by itself. So
what one agent learns does not depend on who sits beside it.
"""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from webapp.explainer.learning.fresh_settings import FreshSettings

Codes = NDArray[np.int64]


class QStack:
    """A DQN per slot (Mnih et al. 2015): two hidden layers of rectified units, one value per action.

    The world is finite and a target network rests between two copies, so its values are kept as a table over all
    states, worked out once per copy.

    Args:
        observations: `[S, I]`: what an agent observes in each state, 0 or 1.
        next_state: `[S * A]`: where each state-action pair, written `state * A + action`, leads.
        terminal: `[S]`, True where the episode has ended.
        settings: How the agents learn.
    """

    def __init__(
        self,
        observations: NDArray[np.float32],
        next_state: Codes,
        terminal: NDArray[np.bool_],
        settings: FreshSettings,
    ) -> None:
        self._settings = settings
        self._observations = torch.from_numpy(observations)
        self._next_state = next_state
        self._num_actions = len(next_state) // len(terminal)
        self._goes_on = (~terminal).astype(np.float32)
        num_inputs, units = observations.shape[1], settings.units
        self._shapes = [
            (num_inputs, units),
            (1, units),
            (units, units),
            (1, units),
            (self._num_actions, units),
            (1, self._num_actions),
        ]
        # As torch.nn.Linear does, but for the number of inputs that are not 0 at once.
        self._fans = [int(observations[0].sum())] * 2 + [units] * 4
        num_slots = settings.num_slots
        length = -(-sum(rows * columns for rows, columns in self._shapes) // _ROW_MULTIPLE) * _ROW_MULTIPLE
        flat = torch.zeros(num_slots, length)
        self._gradients = torch.zeros(num_slots, length)
        self._layers = self._cut(flat)
        self._gradient_layers = self._cut(self._gradients)
        self._rows = [torch.nn.Parameter(flat[slot]) for slot in range(num_slots)]
        self._optimizer = torch.optim.Adam(self._rows, lr=settings.learning_rate, fused=True)
        self._ahead = np.zeros((num_slots, len(terminal)), dtype=np.float32)

    def admit(self, slot: int, rng: np.random.Generator) -> None:
        """Put a new agent into a slot; its first weights are drawn from its own stream."""
        row = self._rows[slot]
        self._optimizer.state.pop(row, None)
        for layer, fan in zip(self._layers, self._fans, strict=True):
            drawn = rng.random(tuple(layer.shape[1:]), dtype=np.float32) * 2 - 1
            layer[slot] = torch.from_numpy(drawn) / fan**0.5
        self.renew_target(slot)

    def greedy(self, states: Codes) -> Codes:
        """Return the action of the highest value `[W]` in each slot's state `[W]`, the lowest if they are equal."""
        _, _, values = _activations(self._layers, self._observations[torch.from_numpy(states)][:, None])
        actions: Codes = values[:, 0].argmax(dim=1).numpy()
        return actions

    def values(self, slot: int) -> torch.Tensor:
        """Return one agent's values `[S, A]`."""
        own = [layer[slot : slot + 1] for layer in self._layers]
        return _activations(own, self._observations[None])[2][0]

    def policy(self, slot: int) -> Codes:
        """Return the greedy action `[S]` of one agent in every state."""
        actions: Codes = self.values(slot).argmax(dim=1).numpy()
        return actions

    def renew_target(self, slot: int) -> None:
        """Copy one agent's network into its target network."""
        self._ahead[slot] = self.values(slot).amax(dim=1).numpy() * self._goes_on

    def update(self, slots: Sequence[int], pairs: NDArray[np.int32], rewards: NDArray[np.float32]) -> None:
        """Make one update of the agents in some slots.

        Args:
            slots: Whose turn it is; all others keep their weights.
            pairs: `[W, B]` replayed state-action pairs of every slot, those whose turn it is not included.
            rewards: `[W, B]`.
        """
        codes = pairs.astype(np.int64)
        every = np.arange(len(codes))[:, None]
        targets = rewards + np.float32(self._settings.discount) * self._ahead[every, self._next_state[codes]]
        states, actions = np.divmod(codes, self._num_actions)
        self._backpropagate(states, actions, targets)
        norms = torch.linalg.vector_norm(self._gradients, dim=1, keepdim=True)
        self._gradients.mul_((self._settings.max_gradient_norm / (norms + _TINY)).clamp_(max=1.0))
        for slot in slots:
            self._rows[slot].grad = self._gradients[slot]
        self._optimizer.step()
        self._optimizer.zero_grad()

    def _backpropagate(self, states: Codes, actions: Codes, targets: NDArray[np.float32]) -> None:
        """Leave in `_gradients` those of the mean Huber loss of `[W, B]` transitions, by the chain rule.

        Written out, because agents learn about a third faster than by `torch.autograd` with networks as small as these.
        """
        observed = self._observations[torch.from_numpy(states)]
        first, second, values = _activations(self._layers, observed)
        taken = torch.from_numpy(actions)[..., None]
        errors = values.gather(2, taken) - torch.from_numpy(targets)[..., None]
        slopes = torch.zeros_like(values).scatter_(2, taken, errors.clamp_(-1.0, 1.0).div_(states.shape[1]))
        self._write(_LAST, slopes.mT, second, slopes)
        slopes = torch.bmm(slopes, self._layers[_LAST]).mul_(second.sign_())
        self._write(_SECOND, first.mT, slopes, slopes)
        slopes = torch.bmm(slopes, self._layers[_SECOND].mT).mul_(first.sign_())
        self._write(_FIRST, observed.mT, slopes, slopes)

    def _write(self, layer: int, left: torch.Tensor, right: torch.Tensor, slopes: torch.Tensor) -> None:
        """Write the gradients of a layer's weights, `left @ right`, and of its biases, summed over the batch."""
        torch.bmm(left, right, out=self._gradient_layers[layer])
        torch.sum(slopes, dim=1, keepdim=True, out=self._gradient_layers[layer + 1])

    def _cut(self, flat: torch.Tensor) -> list[torch.Tensor]:
        """Return the layers `[W, rows, columns]` that share the memory of `[W, length]`."""
        lengths = [rows * columns for rows, columns in self._shapes]
        ends = np.cumsum(lengths).tolist()
        return [
            flat[:, end - length : end].view(len(flat), *shape)
            for end, length, shape in zip(ends, lengths, self._shapes, strict=True)
        ]


def _activations(
    layers: Sequence[torch.Tensor], observations: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return both hidden layers `[W, N, units]` and the values `[W, N, A]` of observations `[W, N, I]`."""
    first = torch.baddbmm(layers[_FIRST + 1], observations, layers[_FIRST]).relu_()
    second = torch.baddbmm(layers[_SECOND + 1], first, layers[_SECOND]).relu_()
    return first, second, torch.baddbmm(layers[_LAST + 1], second, layers[_LAST].mT)


_FIRST, _SECOND, _LAST = 0, 2, 4
"""Where the weights of each layer stand, its biases behind them. The last layer's lie the other way round: products
with so few columns are slow.
"""
_ROW_MULTIPLE = 16
"""A slot's weights begin at multiples of so many numbers, so that all slots lie alike in memory."""
_TINY = 1e-6
