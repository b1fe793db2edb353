"""An approximate inverse of `I - Q` for the chain of a policy that mostly gets its way: one sweep against the policy.

The states are cut into levels by the number of likely moves that lead to absorption. A state depends on the levels
before it by its likely moves alone; all other moves are slips. A Gauss-Seidel sweep from the first level to the last
would leave the slips out, and its iteration needs as many sweeps as there are slips on a long way. This one is
modified as incomplete factors are (Gustafsson 1978, "A class of first order factorization methods"): a slip is taken
to lead to where the state itself is. What is left out is then but a difference between neighbours, and a constant is
inverted exactly.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import _sparsetools, csr_array, eye_array
from scipy.sparse.linalg import splu

from webapp.explainer.breadth_first import Levels, levels_from, reversed_edges

Vector = NDArray[np.float64]
_LIKELY = 0.5
"""A move is likely if its chance is at least this share of the mean chance of the moves made in its state."""


class NeverAbsorbed(ArithmeticError):
    """There is a state from which the chain is never absorbed."""


@dataclass(frozen=True, slots=True, eq=False)
class PolicyGraph:
    """What a chain mostly does.

    Attributes:
        likely: Which entries of the chain are likely moves.
        levels: States by the likely moves that lead to absorption.
    """

    likely: NDArray[np.bool_]
    levels: Levels


class PolicySweep:
    """The system `diag(escape + moves to others) - moves` among some states of a chain, and its approximate inverse.

    Waiting is left out on both sides. All vectors are in the order of the levels.

    Args:
        chain: `[S, S]`: the chances of the next state.
        graph: The likely moves, and the N states of the system in levels. Each escapes or has a move down.
        escape: `[S]`: the chance of being absorbed at once.
        modified: Whether a slip is taken to lead to where the state is; else it is left out, as Gauss and Seidel do,
            which needs more sweeps but converges where slips are too common for the other.

    Attributes:
        order: `[N]`: which state of the chain is which of the system.
        diagonal: `[N]`: the chance of leaving a state.
        steps: `[N]`: the number of the level, from 1.
    """

    def __init__(self, chain: csr_array, graph: PolicyGraph, escape: Vector, *, modified: bool = True) -> None:
        levels = graph.levels
        self.order = levels.order
        self.steps = np.repeat(np.arange(1.0, 1 + len(levels.widths)), levels.widths)
        own_escape = escape[self.order]
        moves, down = _split(chain, graph.likely, levels, own_escape)
        size = len(self.order)
        self._leaving = own_escape + down
        slips = moves @ np.repeat((1.0, 0.0), size)
        self.diagonal = self._leaving + slips
        if not modified:
            self._leaving = self.diagonal
        self._scale = 1 / self._leaving
        self._back = slips * -self._scale if modified else np.zeros(size)
        moves.data *= np.repeat(self._scale, np.diff(moves.indptr))
        self._moves, self._space = moves, np.empty(2 * size)
        self._factor: Any = None if _IN_PLACE else _triangular_factor(moves)

    @property
    def longest_row(self) -> int:
        """The largest number of moves in a state."""
        return int(np.diff(self._moves.indptr).max(initial=0))

    def moved(self, values: Vector) -> Vector:
        """Return `[N]`: the moves times the values."""
        size = len(self.order)
        self._space[:size] = self._space[size:] = values
        moved: Vector = self._moves @ self._space
        moved *= self._leaving
        return moved

    def approximate(self, right_side: Vector) -> Vector:
        """Apply the approximate inverse to `[N]`."""
        values, swept = np.split(self._space, 2)
        values[:] = 0.0
        np.multiply(right_side, self._scale, out=swept)
        self._sweep()
        return swept.copy()

    def apply(self, values: Vector, product: Vector) -> None:
        """Apply the system and then its approximate inverse to `[N]`, and put the product into another `[N]`."""
        before, swept = np.split(self._space, 2)
        before[:] = values
        np.multiply(values, self._back, out=swept)
        self._sweep()
        np.subtract(values, swept, out=product)

    def _sweep(self) -> None:
        """Solve `x = lower x + slips v + b`, where the space holds `v` and `b`; `b` becomes the solution."""
        size = len(self.order)
        if self._factor is None:
            _add_product(self._moves, self._space, self._space[size:])
        else:
            self._space[size:] = self._factor.solve(self._space[size:] + self._moves[:, :size] @ self._space[:size])


def policy_graph(chain: csr_array, inside: NDArray[np.bool_], ends: NDArray[np.bool_]) -> PolicyGraph:
    """Return what a chain mostly does, with the levels of some states counted to some ends.

    Args:
        chain: `[S, S]`.
        inside: `[S]`, True for the states that the levels are to hold, as far as likely moves lead to an end.
        ends: `[S]`, True for the ends.
    """
    likely = likely_moves(chain)
    return PolicyGraph(likely, levels_from(reversed_edges(kept(chain, likely)), ends).within(inside))


def likely_moves(chain: csr_array, escape: Vector | None = None) -> NDArray[np.bool_]:
    """Return which entries of a chain are likely moves. Waiting is none.

    Args:
        chain: `[S, S]`.
        escape: `[S]`: the chance of a move out of the chain, if there are such moves.
    """
    counts = np.diff(chain.indptr)
    waiting = np.flatnonzero(chain.indices == np.repeat(np.arange(len(counts), dtype=np.int32), counts))
    chances = chain.data
    if len(waiting):
        chances = chances.copy()
        chances[waiting] = 0.0
    likely: NDArray[np.bool_] = chances >= np.repeat(_LIKELY * _typical(chain, chances, escape), counts)
    likely[waiting] = False
    return likely


def _typical(chain: csr_array, chances: Vector, escape: Vector | None) -> Vector:
    """`[S]`: the mean chance of the moves that are made, which is never above that of the likeliest."""
    total = row_sums(csr_array((chances, chain.indices, chain.indptr), shape=chain.shape))
    squares = row_sums(csr_array((chances * chances, chain.indices, chain.indptr), shape=chain.shape))
    if escape is not None:
        total, squares = total + escape, squares + escape * escape
    return np.divide(squares, total, out=squares, where=total > 0)


def all_levels(chain: csr_array, likely: NDArray[np.bool_], inside: NDArray[np.bool_], escape: Vector) -> Levels:
    """Order some states by the likely moves to absorption, and those that need an unlikely one behind them.

    Args:
        chain: `[S, S]`.
        likely: Which of its entries.
        inside: `[S]`, True for the N states.
        escape: `[S]`: the chance of leaving them.

    Raises:
        NeverAbsorbed: There are states that the chain never leaves.
    """
    counts = np.diff(chain.indptr)
    among = np.repeat(inside, counts) & inside[chain.indices]
    moves = csr_array((chain.data * among, chain.indices, chain.indptr), shape=chain.shape)
    likely_ends = inside & (escape > 0) & (escape >= _LIKELY * _typical(moves, moves.data, escape))
    first = levels_from(reversed_edges(kept(chain, likely & among)), likely_ends)
    if len(first.order) == np.count_nonzero(inside):
        return first
    ends = inside & (escape > 0)
    ends[first.order] = True
    levels = first.then(levels_from(reversed_edges(kept(chain, among)), ends))
    if len(levels.order) < np.count_nonzero(inside):
        raise NeverAbsorbed("there is a state from which the chain is never absorbed")
    return levels


def row_sums(matrix: csr_array) -> Vector:
    """Return `[N]`: the sum of each row."""
    sums: Vector = matrix @ np.ones(matrix.shape[1])
    return sums


def without_diagonal(matrix: csr_array) -> csr_array:
    """Return a square matrix without the entries on its diagonal."""
    counts = np.diff(matrix.indptr)
    return kept(matrix, matrix.indices != np.repeat(np.arange(len(counts), dtype=np.int32), counts))


def kept(matrix: csr_array, entries: NDArray[np.bool_]) -> csr_array:
    """Return a matrix with only some of its entries."""
    row_start = np.append(np.int32(0), np.cumsum(entries, dtype=np.int32))[matrix.indptr]
    places = np.flatnonzero(entries)  # Indices are several times faster than a mask, used twice.
    return csr_array((matrix.data[places], matrix.indices[places], row_start), shape=matrix.shape)


def _split(chain: csr_array, likely: NDArray[np.bool_], levels: Levels, escape: Vector) -> tuple[csr_array, Vector]:
    """Return `[N, 2N]`, the slips and then the likely moves down, in the order of the levels, and `[N]` sums of those.

    A state without a likely move down and without an escape takes all its moves down for likely.
    """
    below = np.repeat((0.0, 1.0), len(levels.order))
    moves = _ordered(chain, likely, levels)
    down: Vector = moves @ below
    stranded = np.zeros(chain.shape[0], dtype=np.bool_)
    stranded[levels.order] = (escape == 0) & (down == 0)
    if np.any(stranded):
        moves = _ordered(chain, likely | np.repeat(stranded, np.diff(chain.indptr)), levels)
        down = moves @ below
    return moves, down


def _ordered(chain: csr_array, likely: NDArray[np.bool_], levels: Levels) -> csr_array:
    """Return `[N, 2N]`: all other moves among the states, and the likely ones down to an earlier level."""
    size, counts = len(levels.order), np.diff(chain.indptr)
    place, begin = np.full((2, chain.shape[0]), -1, dtype=np.int32)
    place[levels.order] = np.arange(size, dtype=np.int32)
    begin[levels.order] = np.repeat(levels.starts[:-1].astype(np.int32), levels.widths)
    columns = place[chain.indices]
    left_out = columns == np.repeat(place, counts)  # Waiting.
    left_out |= columns < 0
    down = columns < np.repeat(begin, counts)
    down &= likely
    np.add(columns, np.int32(size), out=columns, where=down)
    columns[left_out] = -1
    moves = csr_array((chain.data, columns, chain.indptr), shape=(chain.shape[0], 2 * size))[levels.order]
    without = np.flatnonzero(moves.indices < 0)
    moves.data[without], moves.indices[without] = 0.0, 0
    return moves


def _add_product(matrix: csr_array, factor: Vector, sums: Vector) -> None:
    """Add a matrix times a vector to another, row after row; later rows see the sums of earlier ones if they share."""
    rows, columns = matrix.shape
    _sparsetools.csr_matvec(rows, columns, matrix.indptr, matrix.indices, matrix.data, factor, sums)


def _adds_row_after_row() -> bool:
    """Whether `_add_product` solves a triangular system in place, which SciPy does not promise."""
    both = np.array([1.0, 2.0, 4.0, 8.0])
    try:
        _add_product(csr_array(np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 3.0, 5.0, 0.0]])), both, both[2:])
    except (AttributeError, TypeError, ValueError):
        return False
    solved: list[float] = both.tolist()
    return solved == [1.0, 2.0, 5.0, 39.0]


_IN_PLACE = _adds_row_after_row()


def _triangular_factor(moves: csr_array) -> Any:  # noqa: ANN401 - a SuperLU.
    """A factor of `1 - lower` in the order as it is, which fills nothing in."""
    size = moves.shape[0]
    return splu((eye_array(size, format="csr") - moves[:, size:]).tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)
