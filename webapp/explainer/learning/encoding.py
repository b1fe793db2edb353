"""States as numbers and as one-hot vectors, for maps of different sizes in one stack."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray

from webapp.explainer.worlds.key_door import ACTIONS
from webapp.explainer.worlds.layout import Layout

NUM_ACTIONS = len(ACTIONS)
NUM_COMPONENTS = 5
"""x, y, heading, has_key, door_open; see `KeyDoorState`."""

_LATER_SIZES = (4, 2, 2)
_NUM_ENDS = 2


@dataclass(frozen=True)
class Encoding:
    """The observations of every map of at most this size.

    A code is a state as one number, from 0 to `num_codes - 1`; the last component counts fastest. A pair, a state and
    an action as one number, is `code * NUM_ACTIONS + action`.

    Attributes:
        width: Number of columns.
        height: Number of rows.
    """

    width: int
    height: int

    @classmethod
    def of(cls, *layouts: Layout) -> "Encoding":
        """Return the smallest encoding that holds all of these maps."""
        return cls(max(layout.width for layout in layouts), max(layout.height for layout in layouts))

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many values each component of a state has."""
        return (self.width, self.height, *_LATER_SIZES)

    @property
    def num_inputs(self) -> int:
        """The length of a one-hot observation."""
        return sum(self.sizes)

    @property
    def num_outputs(self) -> int:
        """The world model's outputs: one per value of each component, then `goes on` and `episode ends`."""
        return self.num_inputs + _NUM_ENDS

    @property
    def num_codes(self) -> int:
        """How many states can be written, reachable or not."""
        return int(np.prod(self.sizes))

    @cached_property
    def states(self) -> NDArray[np.int64]:
        """`[num_codes, 5]`: the state of each code."""
        return np.stack(np.unravel_index(np.arange(self.num_codes), self.sizes), axis=-1)

    @cached_property
    def one_hot(self) -> torch.Tensor:
        """`[num_codes, num_inputs]`: the one-hot observation of each code."""
        return self.observe(torch.from_numpy(self.states))

    @cached_property
    def one_hot_pairs(self) -> torch.Tensor:
        """`[num_codes * NUM_ACTIONS, num_inputs + NUM_ACTIONS]`: the one-hot observation and action of each pair."""
        observations = self.one_hot.repeat_interleave(NUM_ACTIONS, dim=0)
        return torch.cat((observations, torch.eye(NUM_ACTIONS).repeat(self.num_codes, 1)), dim=1)

    @cached_property
    def groups(self) -> tuple[slice, ...]:
        """The world model's outputs that belong together: one slice per component, and one for the episode's end."""
        ends = np.cumsum((*self.sizes, _NUM_ENDS)).tolist()
        return tuple(slice(start, end) for start, end in zip([0, *ends], ends, strict=False))

    def code(self, states: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the codes `[...]` of states `[..., 5]`."""
        codes: NDArray[np.int64] = np.ravel_multi_index(tuple(np.moveaxis(states, -1, 0)), self.sizes).astype(np.int64)
        return codes

    def observe(self, states: torch.Tensor) -> torch.Tensor:
        """Return the one-hot observations `[..., num_inputs]` of states `[..., 5]`."""
        parts = [torch.nn.functional.one_hot(states[..., i], size) for i, size in enumerate(self.sizes)]
        return torch.cat(parts, dim=-1).float()

    def columns_in(self, larger: "Encoding") -> torch.Tensor:
        """Return `[num_outputs]`: where this encoding's outputs stand among those of a larger one.

        The first `num_inputs` of them are the places of its inputs, too.
        """
        pairs = zip((*self.sizes, _NUM_ENDS), larger.groups, strict=True)
        return torch.cat([torch.arange(group.start, group.start + size) for size, group in pairs])
