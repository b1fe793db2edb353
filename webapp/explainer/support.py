"""What can follow what in a world of either kind, whatever the chances: the graph of its support."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.stochastic import World

Places = NDArray[np.int64]
"""States of several searches that go on at once: `search * S + state`."""


@dataclass(frozen=True, slots=True, eq=False)
class SupportGraph:
    """An edge from each state to each other state that some action may lead to. It counts once, whatever its chance.

    Attributes:
        first: `[S + 1]`: the edges of state s are `first[s]` up to, not including, `first[s + 1]`.
        heads: `[E]`: the state that each edge leads to, ascending within a state.
    """

    first: NDArray[np.int64]
    heads: NDArray[np.int64]

    @property
    def num_states(self) -> int:
        """S."""
        return len(self.first) - 1

    def successors(self, state: int) -> list[int]:
        """Return the other states that can follow a state."""
        after: list[int] = self.heads[self.first[state] : self.first[state + 1]].tolist()
        return after

    def edges_from(self, places: Places) -> tuple[Places, Places]:
        """Return the edges out of some places: `[N]` where they begin and `[N]` where they end, in the same search."""
        states = places % self.num_states
        first = self.first[states]
        counts = self.first[states + 1] - first
        ends = np.cumsum(counts)
        edges = np.repeat(first - (ends - counts), counts) + np.arange(ends[-1] if len(ends) else 0)
        return np.repeat(places, counts), self.heads[edges] + np.repeat(places - states, counts)


def outcomes(world: World) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return `[N]` origins and `[N]` next states of everything that an action may lead to, one entry per outcome."""
    if isinstance(world, DeterministicMDP):
        return np.repeat(np.arange(world.num_states), world.num_actions), world.next_state.ravel().astype(np.int64)
    rows = np.repeat(np.arange(world.num_states * world.num_actions), np.diff(world.row_start))
    return rows // world.num_actions, world.next_state.astype(np.int64)


def support_graph(world: World) -> SupportGraph:
    """Return the graph under a world. Takes time in proportion to the outcomes, but for sorting them."""
    origins, heads = outcomes(world)
    moves = origins != heads
    edges = np.sort(origins[moves] * world.num_states + heads[moves])
    edges = edges[np.diff(edges, prepend=-1) > 0]
    first = np.searchsorted(edges, np.arange(world.num_states + 1) * world.num_states)
    return SupportGraph(first.astype(np.int64), edges % world.num_states)


def support_note(world: World) -> str:
    """Say what a graph leaves out: nothing where every action has one outcome, else how likely the outcomes are."""
    return "" if isinstance(world, DeterministicMDP) else "of all that may happen, however unlikely"


def once(places: Places, scratch: NDArray[np.int64]) -> Places:
    """Return each place once, in no promised order and without sorting.

    Args:
        places: `[N]`.
        scratch: As long as the largest place; it is written to.
    """
    order = np.arange(len(places))
    scratch[places] = order
    first_of_each: Places = places[scratch[places] == order]
    return first_of_each
