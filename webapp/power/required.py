"""From counts to power: shares with intervals, and the number of participants with which a power is reached.

Power never falls as participants come in, but simulated shares do. So the shares of one effect are replaced by the
nearest sequence that never falls (isotonic regression by pooling adjacent violators; M. Ayer et al. 1955, Annals of
Mathematical Statistics 26, 641-647), and joined by straight lines. The smallest whole number of participants at which
the line has the power is the required one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from webapp.analysis.censoring import Undefined
from webapp.power.analytic import paired_t_power
from webapp.power.design import Questions
from webapp.power.settings import PowerSettings
from webapp.power.simulation import Levels
from webapp.study.intervals import wilson_interval
from webapp.study.required_sample import RequiredSample, RequiredSamples

Step = Literal["first_step", "last_step"]
STEPS: tuple[Step, ...] = ("first_step", "last_step")
"""The levels of Holm's correction: alpha / m, the worst case of a contrast, and alpha, the best."""


@dataclass(frozen=True, slots=True)
class Required:
    """The smallest number of participants with some power.

    Attributes:
        participants: The number; None if the largest that was tried does not do.
        low: What it would be if all simulated shares were the upper ends of their 95 % intervals; None as above.
        high: The same with the lower ends.
        is_smallest: Whether the smallest number that was tried does, so that fewer may do too.
    """

    participants: int | None
    low: int | None
    high: int | None
    is_smallest: bool


def power_table(
    counts: pd.DataFrame, questions: Sequence[Questions], settings: PowerSettings, levels: Levels
) -> pd.DataFrame:
    """Turn counts into shares with Wilson's 95 % intervals.

    Returns:
        The rows of `counts` with `power_<step>`, `low_<step>` and `high_<step>` for each of `STEPS`, the mean estimate
        of d, and the power of the paired t test at `levels.first`, None where nobody sees both kinds.
    """
    table = counts.copy()
    for step in STEPS:
        hits = table[f"num_significant_{step}"]
        table[f"power_{step}"] = hits / table["num_studies"]
        ends = [wilson_interval(hit, num) for hit, num in zip(hits, table["num_studies"], strict=True)]
        table[f"low_{step}"], table[f"high_{step}"] = zip(*ends, strict=True)
    determined = (table["num_studies"] - table["num_undefined"]).replace(0, np.nan)
    table["mean_estimate"] = table.pop("sum_of_estimates") / determined
    by_name = {(each.experiment.id, " ".join(each.items)): each for each in questions}
    table["paired_t_power"] = [
        _t_power(by_name[row.experiment, row.items], row, settings, levels) for row in table.itertuples()
    ]
    return table


def _t_power(questions: Questions, row: object, settings: PowerSettings, levels: Levels) -> float | None:
    first, second, effect, num_people = (getattr(row, name) for name in ("first", "second", "effect", "participants"))
    try:
        return paired_t_power(questions, (first, second), effect, num_people, settings.between_sd, levels.first)
    except Undefined:
        return None


def required_table(power: pd.DataFrame, wanted: float) -> pd.DataFrame:
    """Return the required number of participants for each contrast, effect and step.

    Returns:
        Columns `experiment`, `items`, `first`, `second`, `effect`, `step`, `participants`, `low`, `high` (nullable
        whole numbers) and `is_smallest`.
    """
    rows = []
    names = ["experiment", "items", "first", "second", "effect"]
    for key, curve in power[power["effect"] > 0].groupby(names, sort=False):
        for step in STEPS:
            found = required(
                curve["participants"], curve[f"power_{step}"], curve[f"low_{step}"], curve[f"high_{step}"], wanted
            )
            rows.append([*key, step, found.participants, found.low, found.high, found.is_smallest])
    table = pd.DataFrame(rows, columns=[*names, "step", "participants", "low", "high", "is_smallest"])
    return table.astype(dict.fromkeys(("participants", "low", "high"), "Int64"))


def required_samples(table: pd.DataFrame, settings: PowerSettings) -> RequiredSamples:
    """Return what `xar study check` tells: with how many every contrast has the power at Holm's first step."""
    first = table[table["step"] == "first_step"]
    samples = []
    for effect, rows in first.groupby("effect"):
        numbers = rows["participants"]
        samples.append(RequiredSample(float(effect), None if numbers.isna().any() else int(numbers.max())))
    return RequiredSamples(settings.power, settings.num_studies, max(settings.participants), tuple(samples))


def required(participants: ArrayLike, power: ArrayLike, low: ArrayLike, high: ArrayLike, wanted: float) -> Required:
    """Return the smallest number of participants with a power, and what chance leaves open about it.

    Args:
        participants: `[G]` numbers, ascending.
        power: `[G]` shares.
        low: `[G]`, the lower ends of their intervals.
        high: `[G]`, the upper ends.
        wanted: The power, between 0 and 1.
    """
    numbers = np.asarray(participants, dtype=np.float64)
    found, most, least = (_crossing(numbers, never_falling(curve), wanted) for curve in (power, low, high))
    return Required(found, least, most, found == int(numbers[0]))


def never_falling(values: ArrayLike) -> NDArray[np.float64]:
    """Return the nearest sequence, by least squares, that never falls.

    Example:
        >>> never_falling([0.1, 0.4, 0.2, 0.9]).round(3).tolist()
        [0.1, 0.3, 0.3, 0.9]
    """
    blocks: list[tuple[float, int]] = []
    for value in np.asarray(values, dtype=np.float64):
        blocks.append((float(value), 1))
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            (left, num_left), (right, num_right) = blocks[-2:]
            num = num_left + num_right
            blocks[-2:] = [((left * num_left + right * num_right) / num, num)]
    return np.repeat([value for value, _ in blocks], [num for _, num in blocks])


_ROUNDING = 1e-9
"""Rounding must not ask for one more participant."""


def _crossing(numbers: NDArray[np.float64], curve: NDArray[np.float64], wanted: float) -> int | None:
    reached = np.flatnonzero(curve >= wanted)
    if not reached.size:
        return None
    place = int(reached[0])
    if place == 0:
        return int(numbers[0])
    share = float((wanted - curve[place - 1]) / (curve[place] - curve[place - 1]))
    at = float(numbers[place - 1] + share * (numbers[place] - numbers[place - 1]))
    return math.ceil(at - _ROUNDING)
