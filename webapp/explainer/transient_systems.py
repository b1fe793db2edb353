"""Sparse linear systems `(I - Q) x = b` whose `Q` is what a Markov chain does before it is absorbed.

Every answer comes with a bound on its error. It rests on `A = I - Q` having no positive entry off its diagonal: any
`t >= 0` with `A t > 0` shows that `A` is a nonsingular M-matrix, whose inverse has no negative entry (Berman and
Plemmons 1994, chapter 6). So an `x` with the residual `r` is no further from the solution than the largest of
`|r| / A t` times `t`. One approximate `t`, the expected number of steps, serves every right-hand side.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import LinearOperator, bicgstab, spilu, splu

from webapp.explainer import krylov
from webapp.explainer.policy_sweeps import (
    NeverAbsorbed,
    PolicyGraph,
    PolicySweep,
    all_levels,
    likely_moves,
    row_sums,
    without_diagonal,
)

Vector = NDArray[np.float64]

DIRECT_LIMIT = 2_000
"""Systems of up to so many unknowns are factorised at once."""
PRECISION = 1e-10
"""The error bound that is aimed at, in proportion to the largest value if that is above 1."""

_FILL_LIMIT = 20_000
"""Up to so many unknowns a factor is tried where sweeps fail; its fill may grow faster than the matrix."""
_WORST_BOUND = 1e-6
_ROUNDS = 4
_HOPE = 20.0
"""How many times smaller an error bound is hoped to be than the residual would allow, if it were alike everywhere."""
_EPSILON = float(np.finfo(np.float64).eps)
_LEAST_DESCENT = 0.01
_NO_ESCAPE = 1e-14
"""Where 1 and a row's sum differ by less, the difference is the rounding of the row."""


class NotSolved(ArithmeticError):
    """A system's answer cannot be trusted: its error bound is too large, or there is no answer."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The solution of a system.

    Attributes:
        values: `[N]`.
        error_bound: No value is further than this from the exact solution of the system as stored. Found from the
            residual, the rounding in it included.
    """

    values: Vector
    error_bound: float


class TransientSystem:
    """Solves `(I - Q) x = b` for one `Q` and any number of right-hand sides.

    Small systems are factorised. Large ones are solved by BiCGSTAB (van der Vorst 1992) on sweeps along the levels of
    the chain (`policy_sweeps`), in memory proportional to the entries; should that fail, with a factor, which for very
    large ones is an incomplete one.

    Args:
        moves: `[S, S]`: no entry below 0, and from every state of the system the chain is absorbed in the end.
        inside: `[S]`, True for the N states of the system. What leads from them to other states is absorbed, and
            waiting is left out: the system is `leaving x = moves to others x + b`, with the chance of leaving each
            state. Without this argument all states are inside, and what a row lacks to 1 is absorbed.
        graph: What the chain mostly does, if known. Its levels may be counted to states that lie beyond those outside:
            where each state inside comes nearer to them on average, the error bound costs no solution of its own.
        direct_limit: The largest N that is factorised at once.
        precision: The error bound to aim at, in proportion to the largest value if that is above 1.
    """

    def __init__(
        self,
        moves: csr_array,
        inside: NDArray[np.bool_] | None = None,
        *,
        graph: PolicyGraph | None = None,
        direct_limit: int = DIRECT_LIMIT,
        precision: float = PRECISION,
    ) -> None:
        self._precision = precision
        self._inside = np.ones(moves.shape[0], dtype=np.bool_) if inside is None else inside
        self._size = int(np.count_nonzero(self._inside))
        if inside is None:
            escape, rounding = 1 - row_sums(moves), _NO_ESCAPE
            escape[escape < _NO_ESCAPE] = 0.0
        else:
            escape, rounding = moves @ (~inside).astype(np.float64), 0.0
        complete = self._size <= max(direct_limit, _FILL_LIMIT)
        factors = partial(_Factorised, moves, self._inside, escape, rounding, complete=complete)
        swept = partial(_Swept, moves, self._inside, escape, graph, rounding)
        self._untried: list[Callable[[], _Method]] = [factors]
        if self._size > direct_limit:
            self._untried += [partial(swept, modified=False), partial(swept, modified=True)]
        self._method: _Method | None = None

    def solve(self, right_side: Vector) -> Solution:
        """Solve the system.

        Args:
            right_side: `[N]`, `b`, in the order of the states.

        Raises:
            ValueError: The right side does not fit, or is not made of finite numbers.
            NotSolved: The solver found no answer that can be trusted.
        """
        if right_side.shape != (self._size,) or not np.all(np.isfinite(right_side)):
            raise ValueError(
                f"a right side must be [{self._size}] finite numbers, not {right_side.shape}: {right_side}"
            )
        if not self._size:
            return Solution(np.zeros(0), 0.0)
        while True:
            method = self._working_method()
            solution = method.refined(right_side, self._precision)
            if solution.error_bound <= max(self._precision, _WORST_BOUND) * _scale(solution.values):
                return solution
            self._method = None

    def _working_method(self) -> "_Method":
        """Return the cheapest method that has not failed, once it has shown that its answers can be trusted."""
        while self._method is None:
            if not self._untried:
                raise NotSolved(
                    f"a system of {self._size} states is too hard to solve: its chain is hardly ever absorbed"
                )
            try:
                method = self._untried.pop()()
            except (NeverAbsorbed, RuntimeError) as problem:
                raise NotSolved(f"a system of {self._size} states has no solution: {problem}") from problem
            if method.find_barrier():
                self._method = method
        return self._method


class _Method(ABC):
    """A way to approximate solutions, with what shows how far off they are.

    Attributes:
        order: `[N]`: the place of each state among those of the system. All other vectors are in this order.
        diagonal: `[N]`: the chance of leaving a state.
        rounding: How far a row's sum of products may be off, in proportion to the sum of their sizes.
    """

    order: NDArray[np.int64]
    diagonal: Vector
    rounding: float
    escape_rounding: float

    @abstractmethod
    def moved(self, values: Vector) -> Vector:
        """Return `[N]`: the moves to other states times the values."""

    @abstractmethod
    def approximations(self, right_side: Vector, tolerance: float) -> Iterator[Vector]:
        """Yield solutions, the first one to a tolerance of the approximate inverse of its residual, if it can."""

    def guesses(self) -> Iterator[Vector]:
        """Yield what may be near the expected number of steps."""
        for tolerance in (0.3, 0.03, 1e-6):
            yield next(self.approximations(self.diagonal, tolerance))

    def find_barrier(self) -> bool:
        """Look for a `t >= 0` with `A t > 0`, and return whether there is one."""
        for steps in self.guesses():
            residual, unsure = self._residual(steps, np.zeros_like(steps))
            image = -residual - unsure
            if np.all(np.isfinite(image)) and steps.min() >= 0 and np.all(image > _LEAST_DESCENT * self.diagonal):
                self._most_steps, self._image = float(steps.max()), image
                return True
        return False

    def refined(self, right_side: Vector, precision: float) -> Solution:
        """Approximate until the error bound is as small as wished, or falls no more."""
        wanted, best = right_side[self.order], Solution(np.zeros(len(right_side)), np.inf)
        residual, last = wanted, np.inf
        tolerance = _HOPE * precision * float(np.min(self._image / self.diagonal)) / self._most_steps
        for _ in range(_ROUNDS):
            start = best.values
            for correction in self.approximations(residual, tolerance * _scale(start)):
                values = start + correction
                left, unsure = self._residual(values, wanted)
                unsure += np.abs(left)
                bound = float(np.max(np.divide(unsure, self._image, out=unsure))) * self._most_steps
                if bound < best.error_bound:
                    best, residual = Solution(values, bound), left
                if bound <= precision * _scale(values):
                    break
            if best.error_bound <= precision * _scale(best.values) or not best.error_bound < last:
                break
            last = best.error_bound
        natural = np.empty_like(best.values)
        natural[self.order] = best.values
        return Solution(natural, best.error_bound)

    def _residual(self, values: Vector, right_side: Vector) -> tuple[Vector, Vector]:
        """Return `[N]` twice: the residual, and how far rounding can have moved it."""
        moved, own = self.moved(values), self.diagonal * values
        residual = right_side - own
        residual += moved
        # Sizes instead of values add at most twice what the most negative value would, were it everywhere.
        unsure = np.abs(right_side)
        unsure += np.abs(own, out=own)
        unsure += moved
        unsure += np.multiply(self.diagonal, 2 * max(0.0, -float(values.min())), out=own)
        unsure *= self.rounding
        if self.escape_rounding:
            unsure += self.escape_rounding * np.abs(values)
        return residual, unsure


class _Swept(_Method):
    def __init__(
        self,
        moves: csr_array,
        inside: NDArray[np.bool_],
        escape: Vector,
        graph: PolicyGraph | None,
        rounding: float,
        *,
        modified: bool,
    ) -> None:
        if graph is None or len(graph.levels.order) < np.count_nonzero(inside):
            likely = likely_moves(moves, 1 - row_sums(moves)) if graph is None else graph.likely
            graph = PolicyGraph(likely, all_levels(moves, likely, inside, escape))
        self._sweep = PolicySweep(moves, graph, escape, modified=modified)
        self.order = (np.cumsum(inside) - 1)[self._sweep.order]
        self.diagonal = self._sweep.diagonal
        self.rounding = _EPSILON * (self._sweep.longest_row + 8)
        self.escape_rounding = rounding

    def moved(self, values: Vector) -> Vector:
        return self._sweep.moved(values)

    def approximations(self, right_side: Vector, tolerance: float) -> Iterator[Vector]:
        return krylov.bicgstab(self._sweep.apply, self._sweep.approximate(right_side), tolerance)

    def guesses(self) -> Iterator[Vector]:
        # A policy that mostly gets its way comes nearer to the end on average, wherever it is.
        yield self._sweep.steps
        yield from super().guesses()


class _Factorised(_Method):
    def __init__(
        self, moves: csr_array, inside: NDArray[np.bool_], escape: Vector, rounding: float, *, complete: bool
    ) -> None:
        states = np.flatnonzero(inside)
        self._moves = without_diagonal(moves[states][:, states])
        self.order = np.arange(len(states))
        self.diagonal = escape[states] + row_sums(self._moves)
        self.rounding = _EPSILON * (int(np.diff(self._moves.indptr).max(initial=0)) + 8)
        self.escape_rounding = rounding
        self._complete = complete
        matrix = (diags_array(1 / self.diagonal) @ (diags_array(self.diagonal) - self._moves)).tocsc()
        self._matrix = matrix
        if complete:
            self._factor = splu(matrix, diag_pivot_thresh=0.0)
        else:
            self._factor = spilu(matrix, drop_tol=1e-3, fill_factor=10, diag_pivot_thresh=0.0)

    def moved(self, values: Vector) -> Vector:
        moved: Vector = self._moves @ values
        return moved

    def approximations(self, right_side: Vector, tolerance: float) -> Iterator[Vector]:  # noqa: ARG002 - its best.
        scaled = right_side / self.diagonal
        if self._complete:
            values: Vector = self._factor.solve(scaled)
            values += self._factor.solve((right_side - self.diagonal * values + self.moved(values)) / self.diagonal)
            yield values
            return
        size = float(np.abs(scaled).max()) or 1.0
        preconditioner = LinearOperator(self._matrix.shape, self._factor.solve)
        values, _ = bicgstab(self._matrix, scaled / size, rtol=1e-10, maxiter=1000, M=preconditioner)
        values *= size
        yield values


def _scale(values: Vector) -> float:
    return max(1.0, krylov.largest_size(values))
