"""The networks of all agents, stacked along the first axis, and the optimizer that treats each agent by itself.

One batched matrix product serves every agent. An agent's map may be smaller than the largest: the columns that only
larger maps have are never an input of it, and its world model gives them probability 0.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import torch

from webapp.explainer.learning.encoding import NUM_ACTIONS, Encoding

Weights = dict[str, torch.Tensor]
"""By name; `[A, inputs, outputs]` in a stack, `[inputs, outputs]` for one agent. Biases have one row."""


def new_policy_weights(encoding: Encoding, num_units: int, generator: torch.Generator) -> Weights:
    """Draw the first weights of one agent's DQN: two hidden layers of rectified units, one value per action."""
    num_inputs, num_active = encoding.num_inputs, len(encoding.sizes)
    return {
        "first.weight": _uniform(num_inputs, num_units, num_active, generator),
        "first.bias": _uniform(1, num_units, num_active, generator),
        "second.weight": _uniform(num_units, num_units, num_units, generator),
        "second.bias": _uniform(1, num_units, num_units, generator),
        "values.weight": _uniform(num_units, NUM_ACTIONS, num_units, generator),
        "values.bias": _uniform(1, NUM_ACTIONS, num_units, generator),
    }


def new_model_weights(
    encoding: Encoding, num_units: int, recurrent_scale: float, generator: torch.Generator
) -> Weights:
    """Draw the first weights of one agent's world model: `torch.nn.RNN` and a linear readout."""
    num_active = len(encoding.sizes) + 1
    return {
        "input.weight": _uniform(encoding.num_inputs + NUM_ACTIONS, num_units, num_active, generator),
        "hidden.weight": _uniform(num_units, num_units, num_units, generator) * recurrent_scale,
        "hidden.bias": _uniform(1, num_units, num_active, generator),
        "readout.weight": _uniform(num_units, encoding.num_outputs, num_units, generator),
        "readout.bias": _uniform(1, encoding.num_outputs, num_units, generator),
    }


def action_values(weights: Weights, observations: torch.Tensor) -> torch.Tensor:
    """Return the DQN's values `[A, N, 5]` of one-hot observations `[A, N, num_inputs]`."""
    hidden = torch.relu(torch.baddbmm(weights["first.bias"], observations, weights["first.weight"]))
    hidden = torch.relu(torch.baddbmm(weights["second.bias"], hidden, weights["second.weight"]))
    return torch.baddbmm(weights["values.bias"], hidden, weights["values.weight"])


def unroll(
    weights: Weights, sequences: torch.Tensor, keep: torch.Tensor, singles: torch.Tensor, num_borrowed: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Run the world models over sequences and over single queries.

    Sequences begin with a zero hidden state, and so do single queries but for the last `num_borrowed`: those begin
    with hidden states that the sequences have just reached in other places. Whatever is carried along, the next
    observation follows from this one and the action.

    Args:
        weights: Of the world models.
        sequences: `[A, L, B, num_inputs + 5]` one-hot observations and actions.
        keep: `[A, L, B, 1]`, 0 where an episode begins and the hidden state is set back to zero, else 1.
        singles: `[A, N, num_inputs + 5]`.
        num_borrowed: At most `N` and `L * B`. The latest steps lend first; no gradient flows back into them.

    Returns:
        The logits `[A, L * B, num_outputs]` of the sequences, step by step, and `[A, N, num_outputs]` of the singles.
    """
    num_agents, length, num_sequences, _ = sequences.shape
    num_steps = length * num_sequences
    inputs = torch.cat((sequences.flatten(1, 2), singles), dim=1)
    drive = torch.baddbmm(weights["hidden.bias"], inputs, weights["input.weight"])
    steps = drive[:, :num_steps].view(num_agents, length, num_sequences, -1)
    hidden = [torch.tanh(steps[:, 0])]
    for step in range(1, length):
        carried = hidden[-1] * keep[:, step]
        hidden.append(torch.tanh(torch.baddbmm(steps[:, step], carried, weights["hidden.weight"])))
    reached = torch.cat(hidden, dim=1)
    borrows = drive.shape[1] - num_borrowed
    borrowed = reached[:, num_steps - num_borrowed :].detach()
    borrowing = torch.baddbmm(drive[:, borrows:], borrowed, weights["hidden.weight"])
    everything = torch.cat((reached, torch.tanh(drive[:, num_steps:borrows]), torch.tanh(borrowing)), dim=1)
    logits = torch.baddbmm(weights["readout.bias"], everything, weights["readout.weight"])
    return logits[:, :num_steps], logits[:, num_steps:]


def stack(weights: Sequence[Weights], own: Sequence[Encoding], common: Encoding) -> Weights:
    """Stack the weights of several agents, those of smaller maps padded with zeros.

    Args:
        weights: One per agent.
        own: The encoding of each agent's map.
        common: The encoding of the stack.
    """
    padded = [
        {name: _pad(name, tensor, encoding, common) for name, tensor in agent.items()}
        for agent, encoding in zip(weights, own, strict=True)
    ]
    return {name: torch.stack([agent[name] for agent in padded]).requires_grad_() for name in padded[0]}


def unstack(weights: Weights, agent: int, own: Encoding, common: Encoding) -> Weights:
    """Copy the weights of one agent out of a stack, without the padding."""
    return {name: _trim(name, tensor.detach()[agent], own, common) for name, tensor in weights.items()}


def padding_mask(own: Iterable[Encoding], common: Encoding) -> torch.Tensor:
    """Return `[A, 1, num_outputs]`: 0 at the outputs that an agent's map has, minus infinity at the others."""
    rows = []
    for encoding in own:
        row = torch.full((common.num_outputs,), -math.inf)
        row[encoding.columns_in(common)] = 0.0
        rows.append(row)
    return torch.stack(rows)[:, None]


@dataclass(eq=False)
class StackedAdam:
    """Adam (Kingma and Ba 2015) on stacked weights; gradients are clipped for each agent by itself.

    Attributes:
        weights: The stack that is trained.
        max_norm: Of each agent's gradient.
    """

    weights: Weights
    max_norm: float

    def __post_init__(self) -> None:
        self._means = {name: torch.zeros_like(tensor) for name, tensor in self.weights.items()}
        self._squares = {name: torch.zeros_like(tensor) for name, tensor in self.weights.items()}
        self._num_steps = 0

    @torch.no_grad()
    def step(self, rate: float) -> None:
        """Move the weights along their gradients, then forget the gradients."""
        self._num_steps += 1
        size = rate / (1 - _MEAN_DECAY**self._num_steps)
        correction = math.sqrt(1 - _SQUARE_DECAY**self._num_steps)
        gradients = {name: _gradient(tensor) for name, tensor in self.weights.items()}
        scale = self._clip(gradients.values())
        for name, tensor in self.weights.items():
            gradient = gradients[name] * scale
            mean, square = self._means[name], self._squares[name]
            mean.lerp_(gradient, 1 - _MEAN_DECAY)
            square.mul_(_SQUARE_DECAY).addcmul_(gradient, gradient, value=1 - _SQUARE_DECAY)
            tensor.addcdiv_(mean, square.sqrt().div_(correction).add_(_EPSILON), value=-size)
            tensor.grad = None

    def select(self, agents: Sequence[int]) -> "StackedAdam":
        """Return the optimizer of some of the agents, where they are now."""
        rows = list(agents)
        chosen = StackedAdam(select(self.weights, rows), self.max_norm)
        chosen._means = {name: tensor[rows] for name, tensor in self._means.items()}
        chosen._squares = {name: tensor[rows] for name, tensor in self._squares.items()}
        chosen._num_steps = self._num_steps
        return chosen

    def _clip(self, gradients: Iterable[torch.Tensor]) -> torch.Tensor:
        squares = torch.stack([gradient.square().sum(dim=(1, 2)) for gradient in gradients])
        norms = squares.sum(dim=0).sqrt()
        return (self.max_norm / (norms + _EPSILON)).clamp(max=1.0)[:, None, None]


def select(weights: Weights, agents: Sequence[int]) -> Weights:
    """Copy some agents' weights out of a stack into a smaller one."""
    rows = list(agents)
    return {name: tensor.detach()[rows].requires_grad_(tensor.requires_grad) for name, tensor in weights.items()}


_MEAN_DECAY, _SQUARE_DECAY, _EPSILON = 0.9, 0.999, 1e-8
_INPUT_WEIGHTS = frozenset({"first.weight", "input.weight"})
_OUTPUT_WEIGHTS = frozenset({"readout.weight", "readout.bias"})


def _uniform(rows: int, columns: int, num_active: int, generator: torch.Generator) -> torch.Tensor:
    """Draw as `torch.nn.Linear` does, but for the number of inputs that are not 0 at once."""
    return (torch.rand(rows, columns, generator=generator) * 2 - 1) / math.sqrt(num_active)


def _gradient(tensor: torch.Tensor) -> torch.Tensor:
    if tensor.grad is None:
        raise ValueError("a weight has no gradient; call backward before each step")
    return tensor.grad


def _pad(name: str, tensor: torch.Tensor, own: Encoding, common: Encoding) -> torch.Tensor:
    rows, columns = _places(name, tensor, own, common)
    is_input, is_output = name in _INPUT_WEIGHTS, name in _OUTPUT_WEIGHTS
    padded = torch.zeros(
        tensor.shape[0] + (common.num_inputs - own.num_inputs) * is_input,
        tensor.shape[1] + (common.num_outputs - own.num_outputs) * is_output,
    )
    padded[rows[:, None], columns] = tensor
    return padded


def _trim(name: str, tensor: torch.Tensor, own: Encoding, common: Encoding) -> torch.Tensor:
    rows, columns = _places(name, tensor, own, common)
    return tensor[rows[:, None], columns]


def _places(name: str, tensor: torch.Tensor, own: Encoding, common: Encoding) -> tuple[torch.Tensor, torch.Tensor]:
    """Return which rows and columns of a stacked weight are an agent's; `tensor` tells its size where none is padded.

    Rows of one-hot inputs that follow the observation belong to the actions.
    """
    columns = own.columns_in(common)
    num_actions = NUM_ACTIONS if name == "input.weight" else 0
    inputs = torch.cat((columns[: own.num_inputs], common.num_inputs + torch.arange(num_actions)))
    return (
        inputs if name in _INPUT_WEIGHTS else torch.arange(tensor.shape[0]),
        columns if name in _OUTPUT_WEIGHTS else torch.arange(tensor.shape[1]),
    )
