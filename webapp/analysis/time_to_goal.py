"""How soon people arrive, where some never do: curves of arrival and restricted means.

Who gives up will not arrive at any later time, so to censor them when they give up would pretend that they could have.
They stay at risk up to the limit instead, as if they had gone on in vain. With no other censoring than the common limit
this is the subdistribution of J. P. Fine and R. J. Gray 1999, A proportional hazards model for the subdistribution of a
competing risk, JASA 94, 496-509, and a curve is simply the share that has arrived.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from webapp.analysis.censoring import Undefined

Floats = NDArray[np.float64]


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
