"""Draws of the next state from urns, for many walkers at once."""

from collections.abc import Iterator
from functools import lru_cache

import torch

from webapp.explainer.urns import Urns

_LARGEST_BLOCK, _LARGEST_TABLE = 1 << 17, 1 << 21
"""The joint outcomes of several steps are looked up at once while what is used together fits a processor's cache."""
_LARGEST_PAIR = 1 << 16
"""Two numbers are made of one draw below this. Torch draws the remainder of 32 bits, even to `1 / 2^16` of a chance."""
_MOST_STEPS = 8
"""So many steps at most are looked up at once."""


class Drawer:
    """Urns on a device, one row per state; further rows may follow for states under other rules.

    Attributes:
        certain: `[R]`, the only token of each urn, where each holds one; else None.
    """

    def __init__(self, urns: Urns, device: torch.device, num_blocks: int = 1) -> None:
        """Put urns on a device.

        Args:
            urns: The urns.
            device: Where the walkers are.
            num_blocks: The rows are that many blocks, and walkers that stand side by side use the same block.
        """
        num_rows = len(urns.row_start) - 1
        self._block_size = num_rows // num_blocks
        self._width = urns.width
        self._token = torch.from_numpy(urns.token).to(device)
        self.certain = self._token if self._width == 1 else None
        if urns.keep is None:
            self._tables = [self._token.view(num_rows, -1)]
            return
        # MPS knows no doubles. A float draws from an urn of n tokens with an error of n / 2^24.
        self._real = torch.float32 if device.type == "mps" else torch.float64
        sizes = torch.from_numpy(urns.row_start).diff()
        self._first = torch.from_numpy(urns.row_start[:-1]).to(torch.int32).to(device)
        self._size = sizes.to(self._real).to(device)
        self._last = (sizes - 1).to(torch.int32).to(device)
        self._keep = torch.from_numpy(urns.keep).to(self._real).to(device)
        self._other = torch.from_numpy(urns.other).to(device)

    def draw(self, rows: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        """Draw the next state of each walker, `[N]` int32, from the urns in these rows, `[N]` int32."""
        if self._width is not None:
            return self._look_up(rows, 1, 1, generator)
        place = torch.rand(len(rows), generator=generator, device=rows.device, dtype=self._real)
        place *= self._size.index_select(0, rows)
        # A product may round up to the size itself.
        number = torch.minimum(place.to(torch.int32), self._last.index_select(0, rows))
        entry = self._first.index_select(0, rows) + number
        itself = place.sub_(number) < self._keep.index_select(0, entry)
        return torch.where(itself, self._token.index_select(0, entry), self._other.index_select(0, entry))

    def walk(self, states: torch.Tensor, num_steps: int, generator: torch.Generator) -> torch.Tensor:
        """Draw one state after the other, `num_steps` times, and return the last of each walker, `[N]` int32."""
        if self._width is None:
            for _ in range(num_steps):
                states = self.draw(states, generator)
            return states
        return self._look_up(states, num_steps, self._steps_at_once(self._width), generator)

    def _steps_at_once(self, width: int) -> int:
        most = min(_LARGEST_BLOCK // self._block_size, _LARGEST_TABLE // len(self._tables[0]))
        steps = 1
        while steps < _MOST_STEPS and width ** (steps + 1) <= most:
            steps += 1
        return steps

    def _look_up(self, rows: torch.Tensor, num_steps: int, at_once: int, generator: torch.Generator) -> torch.Tensor:
        """Take steps, some at once by one draw among all their joint outcomes."""
        turns, rest = divmod(num_steps, at_once)
        states = rows
        for table, times in ((self._table(at_once), turns), (self._table(rest or 1), 1 if rest else 0)):
            for number in whole_numbers(table.shape[1], times, rows, generator):
                place = number.add_(states, alpha=table.shape[1])
                # What was given is left as it was; what was made here is written over.
                states = torch.index_select(table.view(-1), 0, place, out=None if states is rows else states)
        return states

    def _table(self, num_steps: int) -> torch.Tensor:
        """Return `[R, ...]` int32: where each of the equally likely joint outcomes of some steps leads."""
        while len(self._tables) < num_steps:
            # Behind every outcome of the steps so far stand those of one step more.
            longest = self._tables[-1]
            self._tables.append(self._tables[0][longest.flatten().long()].view(len(longest), -1))
        return self._tables[num_steps - 1]


def whole_numbers(below: int, num_draws: int, like: torch.Tensor, generator: torch.Generator) -> Iterator[torch.Tensor]:
    """Yield as many times `[N]` int32 numbers, uniform from 0 up to, not including, `below`.

    What was yielded is written over by the next draw but one.

    Args:
        below: At least 1.
        num_draws: At least 0.
        like: `[N]`, of the shape and on the device of the walkers.
        generator: The stream of the draws, on that device.
    """
    drawn, pairs = torch.empty_like(like), num_draws // 2 if below**2 <= _LARGEST_PAIR else 0
    for _ in range(pairs):
        drawn.random_(0, below**2, generator=generator)
        tens = _tens(below, like.device).index_select(0, drawn)
        yield drawn.sub_(tens, alpha=below)
        yield tens
    for _ in range(num_draws - 2 * pairs):
        yield drawn.random_(0, below, generator=generator)


@lru_cache(maxsize=8)
def _tens(below: int, device: torch.device) -> torch.Tensor:
    """Return `[below^2]` int32 quotients; to look them up is faster than to divide."""
    return torch.arange(below, dtype=torch.int32, device=device).repeat_interleave(below)
