"""Where the marks of a chart stand, in percent of its width; the template draws them as SVG without any style."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Axis:
    """A scale from left to right.

    Attributes:
        lowest: The value at the left end.
        highest: That at the right end; larger.
        ticks: The values that are marked.
    """

    lowest: float
    highest: float
    ticks: Sequence[float]

    def place(self, value: float) -> str:
        """Return where a value stands, such as `37.50%`; beyond the ends, at the end."""
        share = (value - self.lowest) / (self.highest - self.lowest)
        return f"{100 * min(max(share, 0.0), 1.0):.2f}%"

    def width(self, lower: float, upper: float) -> str:
        """Return how long it is from one value to another."""
        low, high = (min(max(value, self.lowest), self.highest) for value in (lower, upper))
        return f"{100 * (high - low) / (self.highest - self.lowest):.2f}%"


def scale_axis(points: int) -> Axis:
    """Return the axis of a rating scale from 1."""
    return Axis(1, points, range(1, points + 1))


SHARES = Axis(0, 1, (0, 0.5, 1))
"""The axis of shares."""

GAINS = Axis(-1, 1, (-1, 0, 1))
"""The axis of differences between shares."""


def time_axis(values: Sequence[float]) -> Axis:
    """Return an axis of seconds from 0 that holds all values."""
    largest = max((*values, 1.0))
    step = next(size for size in _STEPS if largest / size <= _MOST_TICKS or size == _STEPS[-1])
    count = int(-(-largest // step))
    return Axis(0, count * step, [step * number for number in range(count + 1)])


_MOST_TICKS = 6
_STEPS = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 36000, 86400)
