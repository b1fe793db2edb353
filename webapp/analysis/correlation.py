"""How two ratings go together, over all ratings and within persons, and how alike the ratings of one person are.

`Undefined` says why there is no answer; no number returned here is nan or infinite.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.location import Interval
from webapp.analysis.means import row

_FEWEST_FREEDOM = 2
"""Below, Fisher's interval has no width to compute: its variance is 1 / (degrees of freedom - 1)."""

_NOTHING = 1e-12
"""What rounding leaves of a deviation that is none, or of a distance from a line, is smaller; ratings' are larger."""


@dataclass(frozen=True, slots=True)
class Correlation:
    """A correlation, its interval and its test against 0.

    Attributes:
        value: From -1 to 1, both excluded, with Fisher's interval.
        degrees_of_freedom: Of the t test; 2 or more.
        p_value: Two-sided.
        num_pairs: How many pairs of values entered.
        num_people: From how many people, 0 where this was not told.
    """

    value: Interval
    degrees_of_freedom: int
    p_value: float
    num_pairs: int
    num_people: int = 0


@dataclass(frozen=True, slots=True)
class Intraclass:
    """How much the values of one person resemble each other.

    Attributes:
        value: ICC(1), below 1, and 0 or less where they do not; with its interval.
        p_value: Of the F test against 0, one-sided: only a positive one means that values depend on the person.
        num_values: How many values entered.
        num_people: How many people gave them.
    """

    value: Interval
    p_value: float
    num_values: int
    num_people: int


def pearson(first: ArrayLike, second: ArrayLike, confidence: float = 0.95) -> Correlation:
    """Correlate pairs, with Fisher's interval, as if no two were of one person.

    Args:
        first: `[N]`.
        second: `[N]`, in the same order.
        confidence: Above 0 and below 1.

    Raises:
        Undefined: There are fewer than 4 pairs, a variable does not vary, or all pairs lie on one line.
        ValueError: There are not as many of the one as of the other.

    Example:
        >>> found = pearson([1, 2, 3, 4], [1, 3, 2, 4])
        >>> round(found.value.value, 3), found.degrees_of_freedom, round(found.p_value, 3)
        (0.8, 2, 0.2)
    """
    x, y = _pairs(first, second)
    if x.size - 2 < _FEWEST_FREEDOM:
        raise Undefined(f"a correlation with an interval needs 4 pairs or more, and there {_are(x.size)}")
    return _correlated(x - x.mean(), y - y.mean(), x.size - 2, confidence, num_people=0)


def repeated_measures(
    first: ArrayLike, second: ArrayLike, people: Sequence[str], confidence: float = 0.95
) -> Correlation:
    """Correlate within persons: whether who rates one thing higher than their other things also rates the other so.

    Each person's pairs are taken from that person's means, so that people who rate everything high add nothing (Bakdash
    and Marusich 2017, Repeated measures correlation, Frontiers in Psychology 8:456). All people share one slope. Those
    with a single pair do not count.

    Args:
        first: `[N]`.
        second: `[N]`, in the same order.
        people: `[N]`, who gave each pair.
        confidence: Above 0 and below 1.

    Raises:
        Undefined: Pairs less people is less than 3, a variable does not vary within any person, or all centred pairs
            lie on one line.
        ValueError: The three are not of one length.
    """
    x, y = _pairs(first, second)
    codes, counts = _coded(people, x.size)
    kept = counts[codes] > 1
    num_people = int(np.count_nonzero(counts > 1))
    freedom = int(np.count_nonzero(kept)) - num_people - 1
    if freedom < _FEWEST_FREEDOM:
        told = f"{np.count_nonzero(kept)} pairs of {num_people} people with several"
        raise Undefined(f"a correlation within persons needs 3 pairs more than people, and there are {told}")
    return _correlated(
        _centred(x, codes, counts)[kept], _centred(y, codes, counts)[kept], freedom, confidence, num_people
    )


def intraclass(values: ArrayLike, people: Sequence[str], confidence: float = 0.95) -> Intraclass:
    """Estimate ICC(1): the share of the variance that lies between people (Shrout and Fleiss 1979).

    Where people gave different numbers of values, their number is replaced by its usual adjusted mean, (N - the sum of
    squares / N) / (people - 1); the interval is then approximate.

    Args:
        values: `[N]`.
        people: `[N]`, who gave each value.
        confidence: Above 0 and below 1.

    Raises:
        Undefined: There are fewer than 2 people, nobody gave several values, or nobody's values vary.
        ValueError: The two are not of one length.

    Example:
        >>> found = intraclass([1, 2, 4, 5], ["a", "a", "b", "b"])
        >>> round(found.value.value, 3), round(found.p_value, 3)
        (0.895, 0.051)
    """
    given = row(values)
    codes, counts = _coded(people, given.size)
    num_people, within_freedom = counts.size, given.size - counts.size
    if num_people < 2 or within_freedom < 1:  # noqa: PLR2004 - one person does not differ from others.
        told = f"{given.size} values of {num_people} people"
        raise Undefined(f"an intraclass correlation needs several values of 2 people or more, and there are {told}")
    within = _centred(given, codes, counts)
    within_square = float(within @ within) / within_freedom
    if _is_constant_within(given, codes, counts):
        raise Undefined(f"an intraclass correlation needs a person whose values vary, and none of {num_people} has any")
    means = np.bincount(codes, given, num_people) / counts
    between_square = float(counts @ (means - given.mean()) ** 2) / (num_people - 1)
    size = (given.size - float(counts @ counts) / given.size) / (num_people - 1)
    ratio, freedoms = between_square / within_square, (num_people - 1, within_freedom)
    tail = (1 - confidence) / 2
    ends = [ratio / stats.f.isf(tail, *freedoms), ratio / stats.f.ppf(tail, *freedoms)]
    value, low, high = ((f - 1) / (f + size - 1) for f in (ratio, *ends))
    interval = Interval(float(value), float(low), float(high))
    return Intraclass(interval, float(stats.f.sf(ratio, *freedoms)), given.size, num_people)


def _pairs(first: ArrayLike, second: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y = row(first), row(second)
    if x.size != y.size:
        raise ValueError(f"pairs need as many second values as first ones, not {y.size} for {x.size}")
    return x, y


def _coded(people: Sequence[str], num: int) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return `[N]` the number of each value's person, and `[people]` how many values each gave."""
    if len(people) != num:
        raise ValueError(f"each of {num} values needs its person, and there are {len(people)}")
    _, codes, counts = np.unique(np.asarray(people, dtype=np.str_), return_inverse=True, return_counts=True)
    return codes, counts.astype(np.int64)


def _centred(values: NDArray[np.float64], codes: NDArray[np.intp], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    means = np.bincount(codes, values, counts.size) / np.maximum(counts, 1)
    centred: NDArray[np.float64] = values - means[codes]
    return centred


def _is_constant_within(values: NDArray[np.float64], codes: NDArray[np.intp], counts: NDArray[np.int64]) -> bool:
    """Say whether each person's values are equal, whatever rounding does to their means."""
    lowest, highest = np.full(counts.size, np.inf), np.full(counts.size, -np.inf)
    np.minimum.at(lowest, codes, values)
    np.maximum.at(highest, codes, values)
    return bool((lowest == highest).all())


def _correlated(
    x: NDArray[np.float64], y: NDArray[np.float64], freedom: int, confidence: float, num_people: int
) -> Correlation:
    """Correlate centred pairs."""
    spread_x, spread_y = float(x @ x), float(y @ y)
    if min(spread_x, spread_y) < _NOTHING:
        raise Undefined(f"a correlation needs two variables that vary, and of {x.size} pairs one does not")
    value = float(x @ y) / math.sqrt(spread_x * spread_y)
    if abs(value) > 1 - _NOTHING:
        raise Undefined(f"all {x.size} pairs lie on one line (r = {round(value)}), so that there is nothing to test")
    statistic = value * math.sqrt(freedom / (1 - value * value))
    half = float(stats.norm.isf((1 - confidence) / 2)) / math.sqrt(freedom - 1)
    low, high = math.tanh(math.atanh(value) - half), math.tanh(math.atanh(value) + half)
    p_value = min(1.0, 2 * float(stats.t.sf(abs(statistic), freedom)))
    return Correlation(Interval(value, low, high), freedom, p_value, x.size, num_people)


def _are(count: int) -> str:
    return "is 1" if count == 1 else f"are {count}"
