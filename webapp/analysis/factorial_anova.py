"""The analysis of variance of two factors with two levels each, for cells of unequal size, by types I, II and III."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import optimize, special

from webapp.analysis.censoring import Undefined
from webapp.analysis.location import Interval
from webapp.analysis.means import MeanDifference, mean_difference, row, unbiased_variance

SumsOfSquares = Literal[1, 2, 3]
"""How what the factors share is split up; where all cells are of one size the three agree.

I: the first factor takes all it can, the second what is left. II: each factor takes what is left by the other. III:
each takes what is left by the other and by the interaction, so that it compares unweighted means of cells.
"""

EFFECTS = ("first", "second", "interaction")
CONFIDENCE = 0.9
"""Of an effect size that cannot be negative: its 90 % interval leaves out 0 exactly where the test has p < .05."""

_FEWEST_IN_CELL = 2


@dataclass(frozen=True, slots=True)
class FactorEffect:
    """What one factor, or both together, do.

    Attributes:
        name: `first`, `second` or `interaction`.
        sum_of_squares: 0 or more.
        statistic: F, with 1 and the residual's degrees of freedom.
        p_value: Of the F test.
        partial_eta_squared: The effect's share of its own and the residual sum of squares. Its 90 % interval is that of
            noncentrality / (noncentrality + N) (Steiger 2004, Beyond the F test, Psychological Methods 9, 164-182).
    """

    name: str
    sum_of_squares: float
    statistic: float
    p_value: float
    partial_eta_squared: Interval


@dataclass(frozen=True, slots=True)
class Anova:
    """An analysis of variance.

    Attributes:
        sums_of_squares: The type.
        effects: Those of `EFFECTS`, in that order.
        residual: The residual sum of squares, above 0.
        degrees_of_freedom: Of the residual.
    """

    sums_of_squares: SumsOfSquares
    effects: tuple[FactorEffect, FactorEffect, FactorEffect]
    residual: float
    degrees_of_freedom: int


def two_by_two(values: ArrayLike, first: ArrayLike, second: ArrayLike, sums_of_squares: SumsOfSquares) -> Anova:
    """Analyse the variance of values by two factors that each divide them in two.

    Args:
        values: `[N]`.
        first: `[N]` booleans, the level of the first factor.
        second: `[N]` booleans, of the second.
        sums_of_squares: The type.

    Raises:
        Undefined: A cell has fewer than 2 values, or no cell's values vary.
        ValueError: The three are not of one length.
    """
    given, a, b = _checked(values, first, second)
    table = _fitted(given, a, b, sums_of_squares)
    # The last row is the residual's; type III begins with one for the mean.
    squares, statistics, p_values = (table[name].to_numpy()[-4:] for name in ("sum_sq", "F", "PR(>F)"))
    residual, freedom = float(squares[3]), given.size - 4
    effects = [
        _effect(name, float(squares[place]), float(statistics[place]), float(p_values[place]), residual, given.size)
        for place, name in enumerate(EFFECTS)
    ]
    return Anova(sums_of_squares, (effects[0], effects[1], effects[2]), residual, freedom)


def simple_effects(
    values: ArrayLike, first: ArrayLike, second: ArrayLike, confidence: float = 0.95
) -> tuple[MeanDifference, MeanDifference]:
    """Compare the levels of the second factor at each level of the first, by the spread within all four cells.

    That is what follows the analysis of variance as a rule. The paper's t tests take the spread of the two cells alone.

    Args:
        values: `[N]`.
        first: `[N]` booleans.
        second: `[N]` booleans.
        confidence: Of the intervals.

    Returns:
        Where the first factor is False, then where it is True: the mean of True of the second minus that of False.

    Raises:
        Undefined: As for `two_by_two`.
        ValueError: As for `two_by_two`.
    """
    given, a, b = _checked(values, first, second)
    cells = [[given[(a == level) & (b == other)] for other in (True, False)] for level in (False, True)]
    freedom = given.size - 4
    spread = sum((cell.size - 1) * unbiased_variance(cell) for pair in cells for cell in pair) / freedom
    low, high = (
        mean_difference(
            "t test by the spread of all cells",
            float(of_high.mean() - of_low.mean()),
            math.sqrt(spread * (1 / of_high.size + 1 / of_low.size)),
            freedom,
            confidence,
        )
        for of_high, of_low in cells
    )
    return low, high


def noncentrality(statistic: float, freedoms: tuple[float, float], below: float) -> float:
    """Return the noncentrality at which F falls below a found one with a given probability; 0 if none does so rarely.

    Args:
        statistic: F, 0 or more.
        freedoms: Degrees of freedom of the effect and of the residual.
        below: The probability, above 0 and below 1.
    """
    gap: Callable[[float], float] = lambda size: float(special.ncfdtr(*freedoms, size, statistic)) - below
    if gap(0.0) <= 0:
        return 0.0
    high = 1.0 + statistic
    while gap(high) > 0:
        high *= 2
    return float(optimize.brentq(gap, 0.0, high, xtol=1e-10, rtol=1e-12))


def _checked(
    values: ArrayLike, first: ArrayLike, second: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the three after seeing to it that each cell has a spread."""
    given, a, b = row(values), np.asarray(first, dtype=np.bool_), np.asarray(second, dtype=np.bool_)
    if not given.shape == a.shape == b.shape:
        raise ValueError(f"each of {given.size} values needs both its levels, and there are {a.size} and {b.size}")
    _check_cells(given, a, b)
    return given, a, b


def _check_cells(values: NDArray[np.float64], a: NDArray[np.bool_], b: NDArray[np.bool_]) -> None:
    cells = [values[(a == level) & (b == other)] for level in (False, True) for other in (False, True)]
    if min(cell.size for cell in cells) < _FEWEST_IN_CELL:
        sizes = ", ".join(str(cell.size) for cell in cells)
        raise Undefined(
            f"the analysis of variance needs {_FEWEST_IN_CELL} values or more in each of its four cells, and (low low,"
            f" low high, high low, high high) there are {sizes}"
        )
    if all(unbiased_variance(cell) == 0 for cell in cells):
        means = ", ".join(f"{cell[0]:g}" for cell in cells)
        raise Undefined(f"the analysis of variance needs values that vary within a cell, and each has one: {means}")


def _fitted(
    values: NDArray[np.float64], a: NDArray[np.bool_], b: NDArray[np.bool_], sums_of_squares: SumsOfSquares
) -> pd.DataFrame:
    """Fit with levels coded 1 and -1, without which type III would compare with one level instead of with the mean."""
    from statsmodels.formula.api import ols  # noqa: PLC0415 - takes a second to load.
    from statsmodels.stats.anova import anova_lm  # noqa: PLC0415 - the same.

    frame = pd.DataFrame({"value": values, "first": a, "second": b})
    fit = ols("value ~ C(first, Sum) * C(second, Sum)", frame).fit()
    table: pd.DataFrame = anova_lm(fit, typ=sums_of_squares)
    return table


def _effect(name: str, squares: float, statistic: float, p_value: float, residual: float, num: int) -> FactorEffect:
    # Rounding may leave less than nothing of an effect that is none.
    squares, statistic = max(0.0, squares), max(0.0, statistic)
    freedoms, tail = (1.0, num - 4.0), (1 - CONFIDENCE) / 2
    low, high = (noncentrality(statistic, freedoms, below) for below in (1 - tail, tail))
    share = Interval(squares / (squares + residual), low / (low + num), high / (high + num))
    return FactorEffect(name, squares, statistic, min(1.0, p_value), share)
