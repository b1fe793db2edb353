"""The trials of an experiment with likeliness and loveliness cut in two, as the paper cuts them at 3/4."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from webapp.analysis.means import row
from webapp.reports.blocks import Statement
from webapp.reports.sections.paper_numbers import GENERAL, ITEMS, LIKELINESS, LOVELINESS
from webapp.reports.sections.rated import Rated

CLASS_NAMES = {False: "low", True: "high"}


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """The rated trials of an experiment, with both factors cut in two.

    Attributes:
        rated: The experiment.
        wide: One row per trial with all three items.
        general: `[N]` the general ratings.
        likely: `[N]` whether likeliness is high.
        lovely: `[N]` whether loveliness is high.
    """

    rated: Rated
    wide: pd.DataFrame
    general: NDArray[np.float64]
    likely: NDArray[np.bool_]
    lovely: NDArray[np.bool_]

    def cell(self, *, likely: bool, lovely: bool) -> NDArray[np.float64]:
        """Return the general ratings of a cell."""
        return row(self.general[(self.likely == likely) & (self.lovely == lovely)])

    def column(self, item: str) -> NDArray[np.float64]:
        """Return `[N]` the ratings of an item."""
        return row(self.wide[item])


def cut(rated: Rated) -> Cut | Statement:
    """Cut both factors above the middle of their scales."""
    subject = f"what the general rating goes with, experiment {rated.id}"
    if missing := [item for item in ITEMS if item not in rated.items]:
        return Statement(subject, f"its items do not include {', '.join(missing)}")
    wide = rated.wide(ITEMS)
    if wide.empty:
        return Statement(subject, f"there are 0 trials with all three of {', '.join(ITEMS)}")
    columns = {item: wide[item].to_numpy(dtype=np.float64) for item in ITEMS}
    likely, lovely = (columns[item] > (1 + rated.points_of(item)) / 2 for item in (LIKELINESS, LOVELINESS))
    return Cut(rated, wide, columns[GENERAL], likely, lovely)


def classes_of(rated: Rated) -> tuple[str, str, str, str]:
    """Return how the low and high class of likeliness and of loveliness read."""
    found = []
    for item in (LIKELINESS, LOVELINESS):
        points = rated.points_of(item)
        middle = (points + 1) // 2
        found += [_span(1, middle), _span(middle + 1, points)]
    return found[0], found[1], found[2], found[3]


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first} to {last}"
