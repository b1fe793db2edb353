"""Which columns of a model can be told apart: those that are no combination of the ones before them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_LEAST_REST = 1e-8
"""A rest shorter than this share of its column is what rounding left of a combination."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column of a model.

    Attributes:
        name: Such as `kind=random`.
        factor: What it is a level of, such as `kind`; the name itself for a number.
        values: `[N]`.
    """

    name: str
    factor: str
    values: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Independent:
    """Columns that can be told apart, and those that cannot.

    Attributes:
        kept: No combination of those before them, in their order.
        lost: The others, in their order.
        num_rows: N.
    """

    kept: tuple[Column, ...]
    lost: tuple[Column, ...]
    num_rows: int

    @property
    def x(self) -> Floats:
        """`[N, P]` of those kept."""
        empty = np.empty((self.num_rows, 0))
        return np.column_stack([empty, *(column.values for column in self.kept)])


def independent(columns: Iterable[tuple[str, str, Floats]], num_rows: int, *, constant: bool = True) -> Independent:
    """Keep each column that is no combination of those before it, by Gram and Schmidt's method.

    Args:
        columns: Name, factor and `[N]` values; earlier ones stay longest.
        num_rows: N.
        constant: Whether the model has a constant or thresholds, which then come before all others.

    Example:
        >>> a, b = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 1.0])
        >>> found = independent([("kind=b", "kind", a), ("layout=b", "layout", b)], 3)
        >>> [column.name for column in found.kept], [column.name for column in found.lost]
        (['kind=b'], ['layout=b'])
    """
    kept: list[Column] = []
    lost: list[Column] = []
    basis = np.ones((num_rows, 1 if constant else 0)) / math.sqrt(max(1, num_rows))
    for name, factor, values in columns:
        rest = values
        for _ in range(2):  # Once more, for what rounding left over.
            rest = rest - basis @ (basis.T @ rest)
        size = float(np.linalg.norm(rest))
        if size <= _LEAST_REST * max(1.0, float(np.linalg.norm(values))):
            lost.append(Column(name, factor, values))
            continue
        kept.append(Column(name, factor, values))
        basis = np.column_stack([basis, rest / size])
    return Independent(tuple(kept), tuple(lost), num_rows)
