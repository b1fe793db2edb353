"""Breadth-first search in the graph of a sparse matrix, from any number of states at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """States by the least number of steps to them.

    Attributes:
        order: `[N]` states, the nearest first.
        starts: `[L + 1]`, rising from 0 to N: level `k` is `order[starts[k] : starts[k + 1]]`, and none is empty.
    """

    order: NDArray[np.int32]
    starts: NDArray[np.int64]

    @property
    def widths(self) -> NDArray[np.int64]:
        """`[L]`: how many states each level has."""
        return np.diff(self.starts)

    def within(self, inside: NDArray[np.bool_]) -> "Levels":
        """Return the levels without some of the states.

        Args:
            inside: `[S]`, True for the states to keep.
        """
        kept = inside[self.order]
        before = np.append(0, np.cumsum(kept))
        return Levels(self.order[kept], np.unique(before[self.starts]))

    def then(self, further: "Levels") -> "Levels":
        """Return these levels and, behind them, others without the states that are here already."""
        new = np.ones(1 + max(self.order.max(initial=0), further.order.max(initial=0)), dtype=np.bool_)
        new[self.order] = False
        added = further.within(new)
        starts = np.concatenate((self.starts[:-1], len(self.order) + added.starts))
        return Levels(np.concatenate((self.order, added.order)), np.unique(starts))


def reached(edges: csr_array, sources: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return `[S]`: True for the states that the edges lead to from a set, the set itself included.

    Args:
        edges: `[S, S]`: an entry leads from its row to its column, whatever its value.
        sources: `[S]`, the set.
    """
    order, _ = _discover(edges, sources)
    found = np.zeros(len(sources), dtype=np.bool_)
    found[order] = True
    return found


def levels_from(edges: csr_array, sources: NDArray[np.bool_]) -> Levels:
    """Return the states that the edges lead to from a set, by the number of steps; the set itself is the first level.

    Args:
        edges: `[S, S]`: an entry leads from its row to its column, whatever its value.
        sources: `[S]`, the set.
    """
    order, predecessors = _discover(edges, sources)
    place = np.zeros(len(predecessors), dtype=np.int64)
    place[order] = np.arange(1, len(order) + 1)
    # What is found later has no earlier predecessor, so a level ends behind the last state whose predecessor lies in
    # the level before. Place 0 is the node before all sources.
    behind = place[predecessors[order]]
    starts, end = [0], 0
    while end < len(order):
        end = int(behind.searchsorted(end, side="right"))
        starts.append(end)
    return Levels(order, np.array(starts))


def reversed_edges(matrix: csr_array) -> csr_array:
    """Return the graph of a matrix with every edge turned round."""
    columns = matrix.tocsc()
    return csr_array((columns.data, columns.indices, columns.indptr), shape=matrix.shape[::-1])


def _discover(edges: csr_array, sources: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the discovered states in order, and `[S + 1]` predecessors; that of a source is the extra node S."""
    num_states, found = len(sources), np.flatnonzero(sources)
    row_start = np.append(edges.indptr, np.int32(edges.indptr[-1] + len(found)))
    columns = np.concatenate((edges.indices, found.astype(np.int32)))
    graph = csr_array((np.ones(len(columns)), columns, row_start), shape=(num_states + 1, num_states + 1))
    order, predecessors = breadth_first_order(graph, num_states)
    return order[1:], predecessors
