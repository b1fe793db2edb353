"""One random action as a table of predecessors, through which many distributions are pushed at once.

The table is sparse: a state has few predecessors. Gathering the mass from them runs at the speed of copying memory, and
needs neither a linear algebra library nor a sort.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.integer[Any]]
Mass = NDArray[np.float64]
"""`[B, N]`: in each column a distribution over `B` states."""

_MAX_LAYERS_PER_ACTION = 2
"""Predecessors beyond so many per action are kept apart, so that a state that everything leads to, such as a start that
every fall leads back to, does not make a layer for each of them."""


@dataclass(frozen=True, slots=True, eq=False)
class RandomStep:
    """A random action in each of `B` states, uniform over the selectable ones; where there is none the state stays.

    The states are sorted by falling number of predecessors. So those that have a first predecessor come first, and of
    them those that have a second one, and so on: adding up is done in a few long strokes without gaps.

    Attributes:
        order: `[B]`: the states in this order. All that follows counts places in it.
        place: `[B]`: the place of each state.
        share: `[B]`: the part of a state's mass that each of its selectable actions moves; 1 where it stays.
        layers: Of the states that have a first, second, ... predecessor, that one; once for each of its actions.
        crowd: The predecessors that are left over, of the states that have more than there are layers: the first ones.
        crowd_start: Where each of these states' begin in `crowd`.
    """

    order: Indices
    place: Indices
    share: NDArray[np.float64]
    layers: tuple[Indices, ...]
    crowd: Indices
    crowd_start: Indices

    @classmethod
    def of(cls, next_state: Indices, selectable: NDArray[np.bool_]) -> Self:
        """Turn the table of what follows around.

        Args:
            next_state: `[B, A]` indices from 0 to B; B stands for all states that are not among the `B`, and what moves
                there is lost.
            selectable: `[B, A]`.
        """
        num_states, num_actions = next_state.shape
        num_selectable = selectable.sum(axis=1)
        origin, action = np.nonzero(selectable & (next_state < num_states))
        stays = np.flatnonzero(num_selectable == 0)
        target = np.concatenate((next_state[origin, action], stays))
        num_before = np.bincount(target, minlength=num_states)
        order = np.argsort(-num_before, kind="stable")
        place = np.empty(num_states, dtype=np.int64)
        place[order] = np.arange(num_states)
        before = place[np.concatenate((origin, stays))][np.argsort(place[target], kind="stable")]
        counts = num_before[order]
        rank = np.arange(len(before)) - np.repeat(np.cumsum(counts) - counts, counts)
        num_layers = min(int(counts.max(initial=0)), _MAX_LAYERS_PER_ACTION * num_actions)
        excess = counts[counts > num_layers] - num_layers
        return cls(
            order=order,
            place=place,
            share=1 / np.maximum(num_selectable, 1)[order],
            layers=tuple(before[rank == number] for number in range(num_layers)),
            crowd=before[rank >= num_layers],
            crowd_start=np.cumsum(excess) - excess,
        )

    def push(self, starts: Indices, num_steps: int, change: Mass | None = None) -> Mass:
        """Return where each of `N` walkers is after random actions.

        Args:
            starts: `[N]`: where each walker starts.
            num_steps: How many random actions.
            change: `[B, N]`: what is added to the distribution after a step, per unit of mass at the walker's start:
                how the start's own actions differ for that walker. Its columns sum to 0.

        Returns:
            `[B, N]`.

        Raises:
            ValueError: The number of actions is negative.
        """
        check_num_steps(num_steps)
        shape = len(self.order), len(starts)
        own = self.place[starts], np.arange(len(starts))
        change = None if change is None else change[self.order]
        mass, shares, gathered = np.zeros(shape), np.empty(shape), np.empty(shape)
        mass[own] = 1.0
        share = np.repeat(self.share, len(starts)).reshape(shape)
        first, *others = self.layers or (self.place[:0],)
        reached, unreached = mass[: len(first)], mass[len(first) :]
        strokes = [(layer, gathered[: len(layer)], mass[: len(layer)]) for layer in others]
        for _ in range(num_steps):
            changed = None if change is None else change * mass[own]
            np.multiply(mass, share, out=shares)
            # Every index is in range; `clip` spares NumPy a copy of the result that `raise` would need.
            shares.take(first, 0, reached, "clip")
            unreached.fill(0.0)
            for layer, part, total in strokes:
                shares.take(layer, 0, part, "clip")
                np.add(total, part, total)
            if len(self.crowd):
                mass[: len(self.crowd_start)] += np.add.reduceat(shares[self.crowd], self.crowd_start, axis=0)
            if changed is not None:
                mass += changed
        return mass.take(self.place, axis=0)


def check_num_steps(num_steps: int) -> None:
    """Refuse a random phase that cannot be.

    Raises:
        ValueError: The number of actions is negative.
    """
    if num_steps < 0:
        raise ValueError(f"the number of random actions must be 0 or larger, not {num_steps}")
