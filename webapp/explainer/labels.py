"""State labels that are kept as one array and made one by one, for worlds too large for a tuple of a million tuples."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, overload

import numpy as np
from numpy.typing import DTypeLike, NDArray

_CHUNK = 65_536
"""So many rows at once become Python numbers, so that a pass over all labels does not hold them all."""


@dataclass(frozen=True, slots=True, eq=False)
class RowLabels(Sequence[Hashable]):
    """Labels made from the rows of an array when they are asked for; in all else like a tuple of them.

    `numpy.asarray` gives the rows back without making any label.

    Attributes:
        rows: `[S, C]` integers, no two rows alike.
        make: Makes the label of a row's `C` numbers; different rows must give different labels.

    Raises:
        ValueError: The rows are no table of integers, or two are alike.
    """

    rows: NDArray[np.integer[Any]]
    make: Callable[[Iterable[int]], Hashable]

    def __post_init__(self) -> None:
        is_table = self.rows.ndim == len(("S", "C"))
        if not is_table or not np.issubdtype(self.rows.dtype, np.integer):
            raise ValueError(f"rows of labels must be [S, C] integers, not {self.rows.shape} of {self.rows.dtype}")
        if _has_twins(self.rows):
            raise ValueError("the state labels are not distinct")

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, place: int) -> Hashable: ...

    @overload
    def __getitem__(self, place: slice) -> tuple[Hashable, ...]: ...

    def __getitem__(self, place: int | slice) -> Hashable | tuple[Hashable, ...]:
        chosen = self.rows[place].tolist()
        return tuple(self.make(row) for row in chosen) if isinstance(place, slice) else self.make(chosen)

    def __iter__(self) -> Iterator[Hashable]:
        for first in range(0, len(self.rows), _CHUNK):
            yield from map(self.make, self.rows[first : first + _CHUNK].tolist())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, tuple | RowLabels):
            return NotImplemented
        return len(self) == len(other) and all(mine == theirs for mine, theirs in zip(self, other, strict=True))

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:  # noqa: FBT001 - NumPy's.
        return np.array(self.rows, dtype=dtype, copy=copy)


def are_distinct(labels: Sequence[Hashable]) -> bool:
    """Whether no two labels are alike; where their making says so, no set of them is built."""
    return made_distinct(labels) or len(set(labels)) == len(labels)


def made_distinct(labels: Sequence[Hashable]) -> bool:
    """Whether the labels are distinct by their making, and need not be looked at."""
    return isinstance(labels, RowLabels | range)


def _has_twins(rows: NDArray[np.integer[Any]]) -> bool:
    """Whether two rows are alike: by sorting one number for each, or the rows where such numbers would be too large."""
    if not rows.size:
        return len(rows) > 1
    least, most = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
    spans = [high - low + 1 for low, high in zip(least, most, strict=True)]
    if prod(spans) > np.iinfo(np.int64).max:
        ordered = rows[np.lexsort(rows.T)]
        return bool(np.any((ordered[1:] == ordered[:-1]).all(axis=1)))
    numbers = np.zeros(len(rows), dtype=np.int64)
    for column, low, span in zip(rows.T, least, spans, strict=True):
        numbers = numbers * span + (column.astype(np.int64) - low)
    numbers.sort()
    return bool(np.any(numbers[1:] == numbers[:-1]))
