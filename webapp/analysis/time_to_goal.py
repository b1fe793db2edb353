"""How soon people arrive, where some never do: curves of arrival and restricted means.

Who gives up will not arrive at any later time, so to censor them when they give up would pretend that they could have.
They stay at risk up to the limit instead, as if they had gone on in vain. With no other censoring than the common limit
this is the subdistribution of J. P. Fine and R. J. Gray 1999, A proportional hazards model for the subdistribution of a
competing risk, JASA 94, 496-509, and a curve is simply the share that has arrived.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from webapp.analysis.censoring import Undefined

Floats = NDArray[np.float64]

NUM_RESAMPLES = 2_000
LEAST_PEOPLE = 6
"""Of fewer not even their extremes are a 95 % interval: all lie on one side of the median in 2 / 2^N of samples."""

_HALF = 0.5 - 1e-9


def arrival_curve(times: ArrayLike, arrived: ArrayLike) -> tuple[Floats, Floats]:
    """Return the share that has arrived, over time.

    Args:
        times: `[N]`; those of who never arrived do not matter.
        arrived: `[N]`.

    Returns:
        Times `[K + 1]`, 0 and then each at which somebody arrived, ascending; the share that has arrived by then.

    Raises:
        Undefined: There is no journey.

    Example:
        >>> times, share = arrival_curve([3, 1, 1, 9], [True, True, True, False])
        >>> times.tolist(), share.tolist()
        ([0.0, 1.0, 3.0], [0.0, 0.5, 0.75])
    """
    ends, reached = np.asarray(times, dtype=np.float64), np.asarray(arrived, dtype=np.bool_)
    if not ends.size:
        raise Undefined("a share needs a journey, and there is none")
    moments, counts = np.unique(ends[reached], return_counts=True)
    return np.concatenate(([0.0], moments)), np.concatenate(([0.0], np.cumsum(counts) / ends.size))


def median_time(times: ArrayLike, arrived: ArrayLike) -> float | None:
    """Return by when half of all journeys had arrived; None if fewer did.

    Raises:
        Undefined: There is no journey.
    """
    moments, shares = arrival_curve(times, arrived)
    return float(moments[np.argmax(shares >= _HALF)]) if shares[-1] >= _HALF else None


def median_interval(
    people: Sequence[str],
    times: ArrayLike,
    arrived: ArrayLike,
    rng: np.random.Generator,
    num_resamples: int = NUM_RESAMPLES,
) -> tuple[float | None, float | None] | None:
    """Return the 95 % percentile bootstrap interval of `median_time`, over people.

    Args:
        people: `[N]` codes.
        times: `[N]`.
        arrived: `[N]`.
        rng: Draws the resamples.
        num_resamples: B.

    Returns:
        Its ends, of which one is None where half do not arrive in that many resamples; None with fewer than
        `LEAST_PEOPLE` people.
    """
    codes, which = np.unique(np.asarray(people, dtype=object).astype(str), return_inverse=True)
    if codes.size < LEAST_PEOPLE:
        return None
    ends, reached = np.asarray(times, dtype=np.float64), np.asarray(arrived, dtype=np.bool_)
    moments, moment = np.unique(ends[reached], return_inverse=True)
    arrivals = np.zeros((codes.size, moments.size))
    np.add.at(arrivals, (which[reached], moment), 1.0)
    drawn = rng.multinomial(codes.size, np.full(codes.size, 1 / codes.size), size=num_resamples).astype(np.float64)
    shares = np.cumsum(drawn @ arrivals, axis=1) / (drawn @ np.bincount(which))[:, None]
    place = (shares < _HALF).sum(axis=1)
    medians = np.sort(np.append(moments, math.inf)[place])
    low, high = medians[int(0.025 * num_resamples)], medians[-1 - int(0.025 * num_resamples)]
    return float(low) if math.isfinite(low) else None, float(high) if math.isfinite(high) else None


def restricted(times: ArrayLike, arrived: ArrayLike, horizon: float) -> Floats:
    """Return `[N]` times up to a horizon, which is what whoever arrives later or never counts with.

    Their mean is the restricted mean time, the area above the curve of arrivals.

    Raises:
        ValueError: The horizon is not above 0 and finite.
    """
    if not 0 < horizon < math.inf:
        raise ValueError(f"the horizon must be above 0 and finite, not {horizon}")
    ends, reached = np.asarray(times, dtype=np.float64), np.asarray(arrived, dtype=np.bool_)
    return np.where(reached, np.minimum(ends, horizon), horizon)
