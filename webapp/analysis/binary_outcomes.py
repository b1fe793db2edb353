"""Whether something was reached or right, by kind: a mixed logistic model with odds ratios and average probabilities.

The model is the ordinal one with two categories: a random intercept per person, and effects of kind, of what else is
given, and of numbers. What would send an odds ratio to infinity is taken out first: all rows of a level of which every
outcome is the same. That is the limit of the likelihood, in which such rows have the chance 1 whatever the rest is.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import special, stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.independent_columns import independent
from webapp.analysis.ordinal_mixed import OrdinalFit, fit_ordinal

Floats = NDArray[np.float64]

_LARGEST = 15.0
"""A log odds ratio beyond this is one that runs off to infinity."""

_NUM_NODES = 31
_UPPER = 0.975


@dataclass(frozen=True, slots=True)
class Ratio:
    """An odds or hazard ratio.

    Attributes:
        value: Above 0; 1 is no difference.
        low: Lower end of its 95 % Wald interval on the log scale.
        high: Upper end.
        t: The log ratio over its standard error.
        df: Of Student's t, to which the statistic is held.
        p_value: Two-sided.
    """

    value: float
    low: float
    high: float
    t: float
    df: int
    p_value: float

    @classmethod
    def of(cls, estimate: float, standard_error: float, df: int) -> "Ratio":
        """Make one from a log ratio.

        Args:
            estimate: The log ratio.
            standard_error: Of it.
            df: At least 1. With few people the normal distribution, which large samples allow, errs too often.

        Raises:
            Undefined: The standard error is 0, not finite, or so large that nothing is known.
        """
        if not 0 < standard_error < _LARGEST * 2 or abs(estimate) > _LARGEST:
            raise Undefined(f"a log ratio of {estimate:.3g} with standard error {standard_error:.3g} is without bound")
        t, reach = estimate / standard_error, float(stats.t.ppf(_UPPER, df)) * standard_error
        low, high = math.exp(estimate - reach), math.exp(estimate + reach)
        return cls(math.exp(estimate), low, high, t, df, min(1.0, 2 * float(stats.t.sf(abs(t), df))))


@dataclass(frozen=True, slots=True)
class Columns:
    """The columns of a model.

    Attributes:
        x: `[N, P]`.
        names: `P`, such as `kind=random`.
        aliased: Effects left out because others determine them.
    """

    x: Floats
    names: tuple[str, ...]
    aliased: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class BinaryFit:
    """A fitted model.

    Attributes:
        fit: Of the ordinal model.
        columns: Its columns.
        kinds: The kinds that are compared, the first one being the reference.
        num_right: How many outcomes are yes.
        left_out: Levels left out because every outcome is the same there, such as `kind=full: all 12 yes`.
        is_between: `[P]`, of each column whether nobody has two values of it, so that it compares people.
    """

    fit: OrdinalFit
    columns: Columns
    kinds: tuple[str, ...]
    num_right: int
    left_out: tuple[str, ...]
    is_between: tuple[bool, ...]

    def odds_ratio(self, first: str, second: str) -> Ratio:
        """Return the odds of one kind over those of another, of the same person.

        Raises:
            Undefined: A kind is not in the model, or the ratio is without bound.
        """
        return self._ratio(kind_weights(self.columns.names, self.kinds, first, second))

    def effect(self, name: str) -> Ratio:
        """Return the odds ratio of a column, by its name.

        Raises:
            Undefined: There is no such column, or the ratio is without bound.
        """
        if name not in self.columns.names:
            raise Undefined(f"{name} is not in the model")
        return self._ratio(np.array([float(other == name) for other in self.columns.names]))

    def df(self, weights: Floats) -> int:
        """Return the degrees of freedom of Student's t for a weighted sum of the coefficients, at least 1.

        As in an analysis of variance: within people, outcomes less people less coefficients, as of the planned model;
        between people, people less those coefficients that compare people less one.
        """
        fit, used = self.fit, weights != 0
        if used.any() and all(between for between, use in zip(self.is_between, used, strict=True) if use):
            return max(1, fit.num_people - sum(self.is_between) - 1)
        groups = fit.num_people if fit.has_person_effect else len(fit.thresholds)
        return max(1, fit.num_ratings - groups - len(fit.coefficients))

    def probability(self, kind: str) -> tuple[float, float, float]:
        """Return the average probability of a kind over all rows and persons, with its 95 % interval.

        Everybody's rows are taken as if they had seen this kind; the interval is the delta method's on the logit,
        with Student's t for people less one.

        Raises:
            Undefined: The kind is not in the model.
        """
        if kind not in self.kinds:
            raise Undefined(f"{kind} is not in the model")
        x = self.columns.x.copy()
        for place, name in enumerate(self.columns.names):
            if name.startswith("kind="):
                x[:, place] = float(name == f"kind={kind}")
        at = np.concatenate([self.fit.thresholds, self.fit.coefficients, [self.fit.sd]])
        value = _average(x, at)
        steps = 1e-5 * np.eye(at.size)
        gradient = np.array([(_average(x, at + step) - _average(x, at - step)) / 2e-5 for step in steps])
        error = math.sqrt(max(0.0, float(gradient @ self.fit.covariance @ gradient))) / (value * (1 - value))
        centre, t = float(special.logit(value)), float(stats.t.ppf(_UPPER, self.fit.num_people - 1))
        low, high = (float(special.expit(centre + side * t * error)) for side in (-1, 1))
        return value, low, high

    def _ratio(self, weights: Floats) -> Ratio:
        return Ratio.of(*self.fit.estimate(weights), self.df(weights))


def fit_binary(
    frame: pd.DataFrame, factors: Sequence[str] = ("kind", "layout", "trial"), numbers: Sequence[str] = ()
) -> BinaryFit:
    """Fit the mixed logistic model.

    Args:
        frame: One row per outcome: `participant`, `right` (bool), the factors and the numbers.
        factors: Columns whose values are levels. The first one comes first where effects cannot be told apart.
        numbers: Columns with numbers.

    Raises:
        Undefined: Fewer than two kinds have different outcomes, there are too few people, or the model has no fit.
    """
    kept, left_out = without_constant_levels(frame, factors)
    if kept.empty:
        counts = f"{int(frame['right'].sum())} of {len(frame)}"
        raise Undefined(f"no level has different outcomes, of which {counts} are yes")
    kinds = tuple(sorted(kept["kind"].unique())) if "kind" in factors else ()
    if "kind" in factors and len(kinds) < 2:  # noqa: PLR2004 - one kind has no other
        raise Undefined(
            f"only the kind {kinds[0]} has different outcomes ({'; '.join(left_out) or 'there is no other'})"
        )
    if kept["participant"].nunique() < 2:  # noqa: PLR2004 - one person shows no spread
        raise Undefined("a model with persons needs two people or more, not 1")
    columns = columns_of(kept, factors, numbers)
    fit = fit_ordinal(
        kept["right"].astype("int64").to_numpy(),
        kept["participant"].to_numpy(),
        columns.x,
        columns.names,
        link="logit",
    )
    values = pd.DataFrame(columns.x).groupby(kept["participant"].to_numpy())
    is_between = tuple(bool(each) for each in (values.max() == values.min()).all())
    return BinaryFit(fit, columns, kinds, int(kept["right"].sum()), left_out, is_between)


def without_constant_levels(
    frame: pd.DataFrame, factors: Sequence[str], *, only_none: bool = False
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Leave out all rows of levels of which every outcome is the same, until there is none.

    Args:
        frame: With the column `right` and the factors.
        factors: Columns.
        only_none: Whether only levels without any yes are left out.

    Returns:
        The other rows, and what was left out in words.
    """
    left_out: list[str] = []
    while True:
        found = _constant_level(frame, factors, only_none=only_none)
        if found is None:
            return frame, tuple(left_out)
        factor, level, has_all, num = found
        left_out.append(f"{factor}={level}: {'all' if has_all else 'none'} of {num} yes")
        frame = frame[frame[factor] != level]


def columns_of(
    frame: pd.DataFrame, factors: Sequence[str], numbers: Sequence[str], *, constant: bool = True
) -> Columns:
    """Make columns of effects, each level against the first one in order, and leave out what others determine.

    Args:
        frame: One row per outcome.
        factors: Columns whose values are levels; earlier ones have precedence.
        numbers: Columns with numbers.
        constant: Whether the model has a constant, which then also determines columns.
    """
    named = [
        (f"{factor}={level}", factor, (frame[factor] == level).to_numpy(dtype=np.float64))
        for factor in factors
        for level in sorted(frame[factor].unique())[1:]
    ]
    named += [(number, number, frame[number].to_numpy(dtype=np.float64)) for number in numbers]
    found = independent(named, len(frame), constant=constant)
    return Columns(found.x, tuple(column.name for column in found.kept), tuple(column.name for column in found.lost))


def kind_weights(names: Sequence[str], kinds: Sequence[str], first: str, second: str) -> Floats:
    """Return the weights of coefficients that make up one kind minus another.

    Raises:
        Undefined: A kind is not in the model.
    """
    for kind in (first, second):
        if kind not in kinds or (kind != kinds[0] and f"kind={kind}" not in names):
            raise Undefined(f"{kind} is not in the model")
    return np.array([float(name == f"kind={first}") - float(name == f"kind={second}") for name in names])


def _constant_level(
    frame: pd.DataFrame, factors: Sequence[str], *, only_none: bool
) -> tuple[str, object, bool, int] | None:
    for factor in factors:
        counts = frame.groupby(factor, observed=True)["right"].agg(["sum", "size"])
        for level, num, size in zip(counts.index, counts["sum"], counts["size"], strict=True):
            if num == 0 or (num == size and not only_none):
                return factor, level, bool(num), int(size)
    return None


def _average(x: Floats, parameters: Floats) -> float:
    """Return the mean over rows and persons of P(yes); parameters are threshold, coefficients and sd."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NUM_NODES)
    predictor = x @ parameters[1:-1] - parameters[0]
    chances = special.expit(predictor[:, None] + parameters[-1] * nodes[None, :])
    return float((chances @ weights).mean() / weights.sum())
