"""What the states of a block can surely do next, for a division of a world's states into blocks.

Only the graph of a world matters here, not its chances: whether a policy reaches a set with probability 1 is decided by
which outcomes are possible (de Alfaro 1997).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.stochastic import World

Able = Mapping[tuple[int, int], NDArray[np.bool_]]
"""For a block and another one: which members of the first, ascending, can surely leave it for the second."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcomes:
    """Everything that can follow an action, whatever its chance.

    Attributes:
        num_actions: A.
        origin: `[N]`, the state before.
        row: `[N]`, state times A plus action; ascending.
        after: `[N]`, the state after.
    """

    num_actions: int
    origin: NDArray[np.int64]
    row: NDArray[np.int64]
    after: NDArray[np.int32]

    @classmethod
    def of(cls, world: World) -> "Outcomes":
        """List the outcomes of a world."""
        if isinstance(world, DeterministicMDP):
            row = np.arange(world.next_state.size)
            after = world.next_state.ravel()
        else:
            row = np.repeat(np.arange(len(world.row_start) - 1), np.diff(world.row_start))
            after = world.next_state
        return cls(world.num_actions, row // world.num_actions, row, after)

    def reachable(self, start: int, num_states: int) -> NDArray[np.bool_]:
        """Return `[S]`: True for the states that some actions may lead to from a start, itself included."""
        order = np.argsort(self.origin, kind="stable")
        first = np.searchsorted(self.origin[order], np.arange(num_states + 1)).tolist()
        after = self.after[order].tolist()
        found = np.zeros(num_states, dtype=np.bool_)
        found[start] = True
        stack = [start]
        while stack:
            state = stack.pop()
            for new in after[first[state] : first[state + 1]]:
                if not found[new]:
                    found[new] = True
                    stack.append(new)
        return found

    def exits(self, block_of: NDArray[np.int32], blocks: list[NDArray[np.int64]]) -> Able:
        """Return which states can surely leave their block for another one without passing through a third.

        Args:
            block_of: `[S]`, the block of each state.
            blocks: The members of each block, ascending. What leads out of a terminal state does not exist.

        Returns:
            For each pair of blocks, in ascending order, where at least one state can: `[members]` booleans.
        """
        able: dict[tuple[int, int], NDArray[np.bool_]] = {}
        for block, members in enumerate(blocks):
            entries = _ranges(np.searchsorted(self.origin, members), np.searchsorted(self.origin, members, "right"))
            after, row = self.after[entries], self.row[entries]
            origin = np.searchsorted(members, self.origin[entries])
            inside = block_of[after] == block
            place = np.where(inside, np.searchsorted(members, after), 0)
            rows = np.unique(row, return_inverse=True)[1]
            for other in np.unique(block_of[after[~inside]]).tolist():
                arrives = block_of[after] == other
                can = _surely(len(members), origin, rows, inside, place, arrives)
                if np.any(can):
                    able[block, other] = can
        return able


def members_of(block_of: NDArray[np.int32], reachable: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Return the states of each block, ascending; only those that can be reached."""
    states = np.flatnonzero(reachable)
    order = states[np.argsort(block_of[states], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(block_of[order])) + 1)


def _surely(
    num_members: int,
    origin: NDArray[np.int64],
    row: NDArray[np.int64],
    inside: NDArray[np.bool_],
    place: NDArray[np.int64],
    arrives: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return which members some policy leads out by the wanted way with probability 1.

    The largest set of members that can reach the way out by actions that never leave the set in another way. Where
    every action has one outcome the first round finds it.
    """
    candidates = np.ones(num_members, dtype=np.bool_)
    while True:
        astray = ~arrives & ~(inside & candidates[place])
        safe = ~np.isin(row, row[astray])
        can = np.zeros(num_members, dtype=np.bool_)
        can[origin[safe & arrives]] = True
        before, after = origin[safe & inside], place[safe & inside]
        while np.any(new := can[after] & ~can[before]):
            can[before[new]] = True
        if np.array_equal(can, candidates):
            return can
        candidates = can


def _ranges(starts: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the numbers of several ranges, one range after the other."""
    counts = ends - starts
    offsets = np.repeat(starts - np.concatenate(([0], np.cumsum(counts)[:-1])), counts)
    return offsets + np.arange(len(offsets))
