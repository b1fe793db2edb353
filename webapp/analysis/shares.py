"""Shares of outcomes of which people have several, with two intervals.

Wilson's treats outcomes as independent; the cluster interval allows those of a person to depend on each other. It is
the dashboard's with the quantile of Student's t for people less one, since the normal one covers 90 % at eight people.
The truth is nearer the second where people differ and there are many of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from webapp.analysis.censoring import Undefined
from webapp.study.intervals import Interval, cluster_interval, normal_quantile, t_quantile, wilson_interval

_UPPER = 0.975
_NO_WIDTH = 5e-10
"""What rounding leaves of no width."""


@dataclass(frozen=True, slots=True)
class Share:
    """A share.

    Attributes:
        num: How many count.
        total: Out of how many.
        num_people: Whose they are.
        wilson: As if all were independent.
        cluster: Robust within persons by Student's t, cut to 0 and 1; None with one person, and where people do not
            differ at all, since an interval without width would pretend certainty.
    """

    num: int
    total: int
    num_people: int
    wilson: Interval
    cluster: Interval | None

    @property
    def value(self) -> float:
        """From 0 to 1."""
        return self.num / self.total


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean of values of which people gave several.

    Attributes:
        value: The mean.
        total: Of how many values.
        num_people: Whose they are.
        interval: Robust within persons; None as of a `Share`.
    """

    value: float
    total: int
    num_people: int
    interval: Interval | None


def share_of(people: Sequence[str], right: ArrayLike) -> Share:
    """Count.

    Args:
        people: `[N]` codes.
        right: `[N]` truth values.

    Raises:
        Undefined: There is no outcome.

    Example:
        >>> found = share_of(["a", "a", "b"], [True, False, True])
        >>> found.num, found.total, found.num_people
        (2, 3, 2)
    """
    mean = mean_of_several(people, np.asarray(right, dtype=np.float64))
    num = round(mean.value * mean.total)
    cluster = None if mean.interval is None else (max(0.0, mean.interval[0]), min(1.0, mean.interval[1]))
    return Share(num, mean.total, mean.num_people, wilson_interval(num, mean.total), cluster)


def mean_of_several(people: Sequence[str], values: ArrayLike) -> Mean:
    """Average.

    Args:
        people: `[N]` codes.
        values: `[N]` finite numbers.

    Raises:
        Undefined: There is no value.
    """
    given = np.asarray(values, dtype=np.float64)
    if not given.size:
        raise Undefined("a mean needs a value, and there is none")
    _, which = np.unique(np.asarray(people, dtype=object).astype(str), return_inverse=True)
    sums, counts = np.bincount(which, weights=given), np.bincount(which)
    groups = [(float(total), int(num), 1) for total, num in zip(sums, counts, strict=True)]
    mean = float(given.mean())
    return Mean(mean, given.size, counts.size, _with_t(mean, cluster_interval(groups), counts.size))


def _with_t(mean: float, normal: Interval | None, num_people: int) -> Interval | None:
    """Widen a normal interval to Student's t, None without one or without width."""
    if normal is None:
        return None
    half = (normal[1] - normal[0]) / 2 * t_quantile(_UPPER, num_people - 1) / normal_quantile(_UPPER)
    return (mean - half, mean + half) if half > _NO_WIDTH else None
