"""The stabilised method of biconjugate gradients (van der Vorst 1992), for systems that nearly are the identity."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import daxpy, ddot

Vector = NDArray[np.float64]
_MOST_ITERATIONS = 150
_BLOCK = 8192
"""A BLAS uses threads for more than 10,000 entries, which cost more than they gain on a busy machine."""


def bicgstab(apply: Callable[[Vector, Vector], None], right_side: Vector, tolerance: float) -> Iterator[Vector]:
    """Yield ever better solutions of a linear system, for the caller to stop at one.

    The first has no entry of its residual above the tolerance, and each further one none above a tenth of the last's.
    The last is as good as the iteration gets. All of them are one vector, which changes from one to the next.

    Args:
        apply: Multiplies the system's matrix with its first argument, `[N]`, and puts the product into the second.
        right_side: `[N]`.
        tolerance: For the residual as the iteration knows it; the true one may be larger.
    """
    values = np.zeros_like(right_side)
    for left in _half_steps(apply, right_side, values):
        if left <= tolerance:
            yield values
            tolerance = 0.1 * left
    yield values


def _half_steps(apply: Callable[[Vector, Vector], None], right_side: Vector, values: Vector) -> Iterator[float]:
    """Improve the values in place, and yield the largest entry of the residual after each application."""
    residual = right_side.copy()
    shadow, direction = right_side, right_side.copy()
    image, turned = np.empty_like(right_side), np.empty_like(right_side)
    product = _inner(shadow, residual)
    for _ in range(_MOST_ITERATIONS):
        apply(direction, image)
        along = _inner(shadow, image)
        if not product or not along or not np.isfinite(product):
            return
        step = product / along
        _add(values, step, direction)
        _add(residual, -step, image)
        yield largest_size(residual)
        apply(residual, turned)
        turned_size = _inner(turned, turned)
        if not turned_size:
            return
        weight = _inner(turned, residual) / turned_size
        _add(values, weight, residual)
        _add(residual, -weight, turned)
        yield largest_size(residual)
        if not weight:
            return
        last, product = product, _inner(shadow, residual)
        turn = product / last * step / weight
        direction *= turn
        _add(direction, -turn * weight, image)
        direction += residual


def largest_size(vector: Vector) -> float:
    """Return the largest absolute value of a vector that is not empty."""
    return max(float(vector.max()), -float(vector.min()))


def _add(values: Vector, factor: float, others: Vector) -> None:
    """Add a multiple of another vector, in one pass through the memory."""
    for first in range(0, len(values), _BLOCK):
        block = slice(first, first + _BLOCK)
        daxpy(others[block], values[block], a=factor)  # Changes its second argument in place.


def _inner(one: Vector, other: Vector) -> float:
    firsts = range(0, len(one), _BLOCK)
    return float(sum(ddot(one[first : first + _BLOCK], other[first : first + _BLOCK]) for first in firsts))
