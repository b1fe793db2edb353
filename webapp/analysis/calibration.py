"""Whether those who feel that they understand do: discrimination of judgements, within and between people.

Discrimination is Goodman and Kruskal's gamma (T. O. Nelson 1984, A comparison of current measures of the accuracy of
feeling-of-knowing predictions, Psychological Bulletin 95, 109-133) and the area under the ROC curve: the chance that of
two outcomes, one right and one wrong, the right one was judged higher, ties counted half.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from webapp.analysis.censoring import Undefined
from webapp.study.intervals import Interval

NUM_RESAMPLES = 2_000
_LEAST_DEFINED = 0.95

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Discrimination:
    """How far judgements tell right outcomes from wrong ones.

    Attributes:
        num_right: Outcomes that are right.
        num_wrong: The others.
        num_people: Whose they are.
        area: Under the ROC curve, 0 to 1; a half is none.
        area_interval: 95 % percentile bootstrap over people; None where too many resamples lack right or wrong ones.
        gamma: -1 to 1; None where every pair of a right and a wrong outcome was judged alike.
        gamma_interval: Likewise.
    """

    num_right: int
    num_wrong: int
    num_people: int
    area: float
    area_interval: Interval | None
    gamma: float | None
    gamma_interval: Interval | None


def discrimination(
    people: Sequence[str],
    judgements: ArrayLike,
    right: ArrayLike,
    rng: np.random.Generator,
    num_resamples: int = NUM_RESAMPLES,
) -> Discrimination:
    """Compare the judgements of right and wrong outcomes, over all of them.

    Args:
        people: `[N]` codes.
        judgements: `[N]` numbers; higher means surer.
        right: `[N]` truth values.
        rng: Draws the resamples of people.
        num_resamples: B.

    Raises:
        Undefined: There are no right ones or no wrong ones.
    """
    given, is_right = np.asarray(judgements, dtype=np.float64), np.asarray(right, dtype=np.bool_)
    num_right = int(is_right.sum())
    if num_right in (0, given.size):
        raise Undefined(f"discrimination needs right and wrong outcomes, and {num_right} of {given.size} are right")
    codes, which = np.unique(np.asarray(people, dtype=object).astype(str), return_inverse=True)
    levels, level = np.unique(given, return_inverse=True)
    counts = np.zeros((codes.size, 2, levels.size))
    np.add.at(counts, (which, is_right.astype(np.int64), level), 1.0)
    flat = counts.reshape(codes.size, -1)
    drawn = rng.multinomial(codes.size, np.full(codes.size, 1 / codes.size), size=num_resamples).astype(np.float64)
    resampled = (drawn @ flat).reshape(num_resamples, 2, levels.size)
    (area,), (gamma,) = _scores(counts.sum(axis=0, keepdims=True))
    areas, gammas = _scores(resampled)
    return Discrimination(
        num_right=num_right,
        num_wrong=given.size - num_right,
        num_people=codes.size,
        area=float(area),
        area_interval=_interval(areas),
        gamma=float(gamma) if np.isfinite(gamma) else None,
        gamma_interval=_interval(gammas) if np.isfinite(gamma) else None,
    )


def within_and_between(frame: pd.DataFrame, column: str) -> pd.DataFrame:
    """Split a column into each person's mean and the deviation from it.

    Of rating and success, the first part says whether those who rate higher succeed more, the second whether a person
    succeeds more where they rate higher (M. van de Pol and J. Wright 2009, Animal Behaviour 77, 753-758).

    Args:
        frame: With `participant` and the column.
        column: Numbers.

    Returns:
        The frame with the columns `between` and `within`.
    """
    values = frame[column].astype("float64")
    between = values.groupby(frame["participant"]).transform("mean")
    # What rounding leaves of a deviation that is none would otherwise be an effect.
    return frame.assign(between=between, within=(values - between).round(9))


def _scores(counts: Floats) -> tuple[Floats, Floats]:
    """Return areas and gammas of `[B, 2, C]` counts of wrong and right; nan where they are not defined."""
    wrong, right = counts[:, 0], counts[:, 1]
    below = np.cumsum(wrong, axis=1) - wrong
    ties = (right * wrong).sum(axis=1)
    higher = (right * below).sum(axis=1)
    total = right.sum(axis=1) * wrong.sum(axis=1)
    lower = total - higher - ties
    nothing = np.full(total.shape, np.nan)
    area = np.divide(higher + ties / 2, total, out=nothing.copy(), where=total > 0)
    gamma = np.divide(higher - lower, higher + lower, out=nothing.copy(), where=higher + lower > 0)
    return area, gamma


def _interval(values: Floats) -> Interval | None:
    known = values[np.isfinite(values)]
    if known.size < _LEAST_DEFINED * values.size or not np.ptp(known):
        return None
    low, high = np.quantile(known, [0.025, 0.975])
    return float(low), float(high)
