"""The planned model: ratings of an item in an experiment by kind, layout and position, with an intercept per person.

What cannot be told apart is left out and named. In the paper's design, for example, everyone sees the layouts in one
order (Sakai et al. 2021, section 6.1), so position and layout are the same thing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import pandas as pd
from scipy import stats

from webapp.analysis.censoring import Undefined
from webapp.analysis.links import Array, Link
from webapp.analysis.ordinal_mixed import OrdinalFit, fit_ordinal
from webapp.analysis.planned_covariates import FACTORS, covariates_of, kinds_at_an_end, weights_of_kinds

_ALPHA = 0.05
LEAST_DF = 3
"""With fewer degrees of freedom there is no interval worth printing."""


@dataclass(frozen=True, slots=True)
class Effect:
    """A difference between two kinds, first minus second.

    Attributes:
        value: In the unit of the model's coefficients; positive if the first kind is rated higher.
        standard_error: Of the value.
        df: Of Student's t, to which their ratio is held: ratings less people less coefficients, as within people in an
            analysis of variance. The normal distribution, which large samples allow, errs too often with twenty people.
        d: In standard deviations of the latent rating, over people and within them.
        d_standard_error: Of d, by the delta method.
    """

    value: float
    standard_error: float
    df: int
    d: float
    d_standard_error: float

    @property
    def z(self) -> float:
        """Wald's statistic."""
        return self.value / self.standard_error

    @property
    def p_value(self) -> float:
        """Two-sided, of Wald's test."""
        return float(2 * stats.t.sf(abs(self.z), self.df))

    @property
    def value_interval(self) -> tuple[float, float]:
        """The 95 % interval of the value."""
        half = float(stats.t.ppf(1 - _ALPHA / 2, self.df)) * self.standard_error
        return self.value - half, self.value + half

    def interval(self, level: float = 1 - _ALPHA) -> tuple[float, float]:
        """Return the interval of d that holds the true one with about this chance."""
        half = float(stats.t.ppf((1 + level) / 2, self.df)) * self.d_standard_error
        return self.d - half, self.d + half

    @property
    def d_low(self) -> float:
        """The lower end of the 95 % interval of d."""
        return self.interval()[0]

    @property
    def d_high(self) -> float:
        """Its upper end."""
        return self.interval()[1]


@dataclass(frozen=True, slots=True)
class RatioTest:
    """A likelihood-ratio test of two nested models: statistic, degrees of freedom, p value."""

    statistic: float
    df: int
    p_value: float


@dataclass(frozen=True)
class PlannedFit:
    """The planned model, fitted.

    Attributes:
        frame: Its ratings: `participant, kind, layout, position, rating`.
        fit: The model.
        columns: Of each covariate, the factor it belongs to.
        kinds: The kinds, in the order of first appearance in the plan; the first has no covariate of its own.
        kind_weights: Of each kind, its covariates as `[P]` weights.
        aliased: What was left out because it cannot be told from the rest, in words.
        at_an_end: Kinds that are not in the model because all their ratings lie at one end, each with the reason.
    """

    frame: pd.DataFrame
    fit: OrdinalFit
    columns: tuple[str, ...]
    kinds: tuple[str, ...]
    kind_weights: dict[str, Array]
    aliased: tuple[str, ...]
    at_an_end: Mapping[str, str]

    def contrast(self, first: str, second: str) -> Effect:
        """Compare two kinds.

        Raises:
            Undefined: One of them is not among the ratings, is told by layout or position alone, or has all its ratings
                at one end.
        """
        for kind in (first, second):
            if kind in self.at_an_end:
                raise Undefined(self.at_an_end[kind])
            if kind not in self.kind_weights:
                raise Undefined(f"nobody rated the kind {kind}" if kind not in self.kinds else f"{kind} cannot be told")
        weights = self.kind_weights[first] - self.kind_weights[second]
        return Effect(*self.fit.estimate(weights), self.df, *self.fit.standardized(weights))

    @property
    def df(self) -> int:
        """The degrees of freedom within people, at least `LEAST_DF`."""
        return _freedom(self.fit)

    @cached_property
    def tests(self) -> dict[str, RatioTest | str]:
        """By factor, the test of leaving it out; a reason in words where there is none."""
        return {factor: self._without(factor) for factor in FACTORS}

    def _without(self, factor: str) -> RatioTest | str:
        kept = [place for place, of in enumerate(self.columns) if of != factor]
        df = len(self.columns) - len(kept)
        if df == 0:
            return next((words for words in self.aliased if words.startswith(factor)), f"there is one {factor} alone")
        names = [self.fit.names[place] for place in kept]
        try:
            smaller = fit_ordinal(
                self.frame["rating"], self.frame["participant"], self.x[:, kept], names, link=self.fit.link
            )
        except Undefined as undefined:
            return str(undefined)
        return ratio_test(self.fit, smaller)

    @cached_property
    def x(self) -> Array:
        """`[n, P]`, the covariates."""
        return covariates_of(self.frame, self.kinds)[0]


def ratio_test(larger: OrdinalFit, smaller: OrdinalFit) -> RatioTest:
    """Compare two nested fits of the same ratings."""
    statistic = max(0.0, 2 * (larger.log_likelihood - smaller.log_likelihood))
    df = larger.num_parameters - smaller.num_parameters
    return RatioTest(statistic, df, float(stats.chi2.sf(statistic, df)))


def fit_planned(
    frame: pd.DataFrame, kinds: Sequence[str] | None = None, *, link: Link = "probit", num_nodes: int = 11
) -> PlannedFit:
    """Fit the planned model to the ratings of one item in one experiment.

    Args:
        frame: One row per rating, with `participant`, `kind`, `layout`, `trial` (or `position`) and `rating`.
        kinds: The order of the kinds; sorted if not given. Kinds that nobody rated are left out.
        link: `probit`, so that effects are in standard deviations of a normal latent rating, or `logit`.
        num_nodes: Of the quadrature.

    Raises:
        Undefined: The ratings do not determine the model.
    """
    frame = frame.rename(columns={"trial": "position"})[["participant", *FACTORS, "rating"]].reset_index(drop=True)
    seen = set(frame["kind"])
    given = tuple(kind for kind in (kinds if kinds is not None else sorted(seen)) if kind in seen)
    at_an_end = kinds_at_an_end(frame, given) if frame["participant"].nunique() > 1 else {}
    frame = frame[~frame["kind"].isin(list(at_an_end))].reset_index(drop=True)
    if at_an_end and frame["rating"].nunique() == 1:
        raise Undefined("; ".join(at_an_end.values()))
    order = tuple(kind for kind in given if kind not in at_an_end)
    x, names, columns, aliased = covariates_of(frame, order)
    fit = fit_ordinal(frame["rating"], frame["participant"], x, names, link=link, num_nodes=num_nodes)
    if _freedom(fit) < LEAST_DF:
        whose = f"{fit.num_ratings} ratings of {fit.num_people} people"
        raise Undefined(
            f"{whose} leave {_freedom(fit)} degrees of freedom beside {len(names)} effects, fewer than {LEAST_DF}"
        )
    return PlannedFit(frame, fit, columns, order, weights_of_kinds(order, names, columns), aliased, at_an_end)


def _freedom(fit: OrdinalFit) -> int:
    groups = fit.num_people if fit.has_person_effect else len(fit.thresholds)
    return fit.num_ratings - groups - len(fit.coefficients)


@dataclass(frozen=True, slots=True)
class ShapeTest:
    """Whether a kind moves all thresholds alike.

    Attributes:
        ratio: The planned model against one in which each kind has thresholds of its own.
        bins: The ratings that were told apart, neighbours together where some kind lacked one of them.
    """

    ratio: RatioTest
    bins: tuple[tuple[int, ...], ...]

    @property
    def words(self) -> str:
        """The bins in words, such as `1-2, 3, 4-5`."""
        return ", ".join(str(bin_[0]) if len(bin_) == 1 else f"{bin_[0]}-{bin_[-1]}" for bin_ in self.bins)


def check_shape(planned: PlannedFit) -> ShapeTest:
    """Test whether kinds move all thresholds alike (proportional odds, for the logit link).

    Thresholds of a kind's own are determined only if each of its ratings was given; neighbouring ratings count as one
    until that is so.

    Raises:
        Undefined: Fewer than three bins are left, or the second model is not determined.
    """
    frame, fit = planned.frame, planned.fit
    bins = _full_bins(pd.crosstab(frame["kind"], frame["rating"]))
    if len(bins) < 3:  # noqa: PLR2004 - one threshold moves alone
        raise Undefined("the kinds have too few ratings in common to tell more than two groups of them apart")
    number = {rating: place for place, bin_ in enumerate(bins) for rating in bin_}
    ratings, kept = frame["rating"].map(number), [place for place, of in enumerate(planned.columns) if of != "kind"]
    names = [fit.names[place] for place in kept]
    alike = fit_ordinal(ratings, frame["participant"], planned.x, fit.names, link=fit.link)
    x = planned.x[:, kept]
    own = fit_ordinal(ratings, frame["participant"], x, names, link=fit.link, groups=frame["kind"])
    return ShapeTest(ratio_test(own, alike), bins)


def _full_bins(counts: pd.DataFrame) -> tuple[tuple[int, ...], ...]:
    """Join neighbouring ratings, from the lowest on, until every kind has some in every bin."""
    bins: list[tuple[int, ...]] = []
    pending: tuple[int, ...] = ()
    for rating in counts.columns:
        pending = (*pending, int(rating))
        if (counts[list(pending)].sum(axis=1) > 0).all():
            bins.append(pending)
            pending = ()
    if pending and bins:
        bins[-1] += pending
    return tuple(bins)
