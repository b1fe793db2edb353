"""The planned comparisons: ordinal mixed models of the ratings, one per item and experiment (probit link)."""

import math
from collections.abc import Iterator

from webapp.analysis.censoring import Undefined
from webapp.analysis.means import shapiro_wilk
from webapp.analysis.planned_comparisons import Comparison, Comparisons, Place, compare_kinds
from webapp.analysis.planned_model import Effect, PlannedFit, RatioTest, check_shape, fit_planned
from webapp.reports.blocks import Assumption, Block, Cell, Column, Section, Statement, Table, Verdict
from webapp.reports.sections.ordinal_figures import distribution_figures, forest_figure
from webapp.reports.sections.paper_numbers import COMPARISONS
from webapp.reports.study_data import StudyData
from webapp.study.intervals import t_quantile

_INTRODUCTION = (
    "Ratings have an order and no distances, so a difference of their means can be larger, smaller or even of another "
    "sign than the difference of the opinions behind them (Liddell and Kruschke 2018). The planned model takes each "
    "rating for an interval of a latent opinion that varies between people and within them: a cumulative link mixed "
    "model with a probit link, effects of kind, layout and position, and a random intercept per participant, fitted by "
    "adaptive Gauss-Hermite quadrature with 11 nodes. d is the difference of two kinds in standard deviations of the "
    "latent opinion, over people and within them; p values are of Wald's test by Student's t with the degrees of "
    "freedom within people, two-sided."
)
_LEAST_TESTED = 8
"""With fewer intercepts a test of their shape says nothing."""


def section(data: StudyData) -> Section:
    """Compare the kinds as planned."""
    found = compare_kinds(data.ratings, data.plan)
    plan = data.plan
    whose = "declared in the study file" if plan.is_declared else "of the default plan, because none is declared"
    family = (
        f"The {plan.num_tests} comparisons are {whose}. All of them together are one family: p values are corrected by "
        f"Holm's method, and a difference is found where the corrected one is below {plan.alpha:g}."
    )
    blocks: list[Block] = [_INTRODUCTION, family, _comparisons_table(found)]
    blocks += [Statement(_named(test), test.missing) for test in found.tests if test.effect is None]
    if any(test.effect is not None for test in found.tests):
        blocks.append(forest_figure(found))
    blocks += [*distribution_figures(data), _models_table(found), _coefficients_table(found), _odds_table(data)]
    blocks += _aliased(found)
    return Section("ordinal", "Planned comparisons", tuple(blocks), tuple(_assumptions(found)))


def _comparisons_table(found: Comparisons) -> Table:
    columns = (
        Column("experiment", "Experiment"),
        Column("item", "Item"),
        Column("contrast", "Contrast"),
        Column("d", "d", "number"),
        Column("d_low", "95 % from", "number"),
        Column("d_high", "to", "number"),
        Column("t", "t", "number"),
        Column("df", "df", "count"),
        Column("p", "p", "p"),
        Column("p_holm", "p (Holm)", "p"),
        Column("found", "Conclusion"),
        Column("paper", "Paper"),
    )
    return Table(
        "planned_comparisons",
        "Planned comparisons of kinds of explanation",
        columns,
        tuple(_comparison_row(test) for test in found.tests),
        note="d above 0: the first kind is rated higher. The paper's column is what its text says of these kinds.",
    )


def _comparison_row(test: Comparison) -> tuple[Cell, ...]:
    ends: tuple[Cell, ...] = (test.contrast.experiment, test.item, str(test.contrast))
    claim = _claim(test)
    if test.effect is None:
        return (*ends, *[None] * 7, "not determined", claim)
    effect = test.effect
    numbers = (effect.d, effect.d_low, effect.d_high, effect.z, effect.df, effect.p_value, test.p_holm)
    return (*ends, *numbers, conclusion(test), claim)


def _claim(test: Comparison) -> str | None:
    """Return what the paper says of the two kinds, whatever the experiment is called here."""
    kinds = frozenset({test.contrast.first, test.contrast.second})
    found = (told.text for (_, named, item), told in COMPARISONS.items() if (named, item) == (kinds, test.item))
    return next(found, None)


def conclusion(test: Comparison) -> str:
    """Say in words what a planned test found."""
    if test.effect is None:
        return "not determined"
    if not test.is_found:
        return "no difference found"
    return f"{test.contrast.first if test.effect.d > 0 else test.contrast.second} higher"


def _models_table(found: Comparisons) -> Table:
    columns = [
        Column("experiment", "Experiment"),
        Column("item", "Item"),
        Column("ratings", "Ratings", "count"),
        Column("people", "People", "count"),
        Column("between", "SD between people", "number"),
        Column("share", "Share between people", "percent", 0),
        Column("log_likelihood", "Log-likelihood", "number"),
    ]
    for factor in ("kind", "layout", "position"):
        columns += [
            Column(f"{factor}_chi2", f"{factor.capitalize()}: χ²", "number"),
            Column(f"{factor}_df", "df", "count"),
            Column(f"{factor}_p", "p", "p"),
        ]
    rows = tuple(_model_row(place, model) for place, model in found.models.items() if isinstance(model, PlannedFit))
    note = (
        "Likelihood-ratio tests of leaving a factor out. The SD within people is 1; the share is that of the variance."
    )
    return Table("ordinal_models", "The models", tuple(columns), rows, note)


def _model_row(place: Place, model: PlannedFit) -> tuple[Cell, ...]:
    fit = model.fit
    tests = (model.tests[factor] for factor in ("kind", "layout", "position"))
    told = [
        cell
        for test in tests
        for cell in ((test.statistic, test.df, test.p_value) if isinstance(test, RatioTest) else (None, None, None))
    ]
    share = fit.sd**2 / (1 + fit.sd**2) if fit.has_person_effect else None
    sd = fit.sd if fit.has_person_effect else None
    return (*place, fit.num_ratings, fit.num_people, sd, share, fit.log_likelihood, *told)


def _coefficients_table(found: Comparisons) -> Table:
    columns = (
        Column("experiment", "Experiment"),
        Column("item", "Item"),
        Column("term", "Term"),
        Column("estimate", "Estimate", "number"),
        Column("standard_error", "Standard error", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
    )
    rows = (
        row
        for place, model in found.models.items()
        if isinstance(model, PlannedFit)
        for row in _coefficient_rows(place, model)
    )
    return Table("ordinal_coefficients", "Coefficients and thresholds", columns, tuple(rows))


def _coefficient_rows(place: Place, model: PlannedFit) -> Iterator[tuple[Cell, ...]]:
    fit = model.fit
    cuts = [f"{low}|{high}" for low, high in zip(fit.categories, fit.categories[1:], strict=False)]
    half = t_quantile(0.975, model.df)
    estimates = [*fit.thresholds, *fit.coefficients]
    for name, value, error in zip([*cuts, *fit.names], estimates, fit.standard_errors, strict=False):
        yield (*place, name, float(value), float(error), float(value - half * error), float(value + half * error))
    if fit.has_person_effect:
        yield (*place, "SD between people", fit.sd, float(fit.standard_errors[-1]), None, None)


def _odds_table(data: StudyData) -> Table:
    """The same contrasts with the logit link, whose effects are odds ratios."""
    columns = (
        Column("experiment", "Experiment"),
        Column("item", "Item"),
        Column("contrast", "Contrast"),
        Column("odds_ratio", "Odds ratio", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
        Column("p_holm", "p (Holm)", "p"),
    )
    found = compare_kinds(data.ratings, data.plan, link="logit")
    rows = tuple(
        (test.contrast.experiment, test.item, str(test.contrast), *_odds(test.effect), test.p_holm)
        for test in found.tests
        if test.effect is not None
    )
    note = "The odds of a rating above any given one. A conclusion that changes with the link stands on its shape."
    return Table("ordinal_odds_ratios", "The same comparisons with the logit link", columns, rows, note)


def _odds(effect: Effect) -> tuple[float, float, float]:
    low, high = effect.value_interval
    return math.exp(effect.value), math.exp(low), math.exp(high)


def _aliased(found: Comparisons) -> Iterator[Block]:
    """Say what the design cannot tell apart, each thing once."""
    told: dict[tuple[str, str], list[str]] = {}
    for (experiment, item), model in found.models.items():
        for words in model.aliased if isinstance(model, PlannedFit) else ():
            told.setdefault((experiment, words), []).append(item)
    for (experiment, words), items in told.items():
        yield Statement(f"Experiment {experiment}, {', '.join(items)}", f"{words}; it is left out of the model")


def _assumptions(found: Comparisons) -> Iterator[Assumption]:
    for (experiment, item), model in found.models.items():
        if isinstance(model, PlannedFit):
            name = f"Ordinal mixed model, experiment {experiment}, {item}"
            yield _shape(name, model)
            yield from _intercepts(name, model)
            yield _quadrature(name, model)


def _shape(name: str, model: PlannedFit) -> Assumption:
    assumes = "A kind moves the whole latent opinion: it shifts all thresholds by the same amount."
    try:
        found = check_shape(model)
    except Undefined as undefined:
        return Assumption(name, assumes, f"Not testable: {undefined}.", "not checkable")
    test = found.ratio
    told = f"Likelihood-ratio test against thresholds of each kind's own: χ²({test.df}) = {test.statistic:.2f}, "
    together = f" with the ratings {found.words} told apart" if any(len(bin_) > 1 for bin_ in found.bins) else ""
    return Assumption(name, assumes, f"{told}p = {test.p_value:.3g}{together}.", _verdict(test.p_value))


def _intercepts(name: str, model: PlannedFit) -> Iterator[Assumption]:
    fit, assumes = model.fit, "People's intercepts are drawn from a normal distribution."
    if not fit.has_person_effect:
        told = "Nobody rated this item more than once, so the model has no intercepts."
        yield Assumption(name, "Ratings are independent: one per person.", told, "by design")
        return
    yield Assumption(
        name,
        "Given the intercept, a person's ratings are independent.",
        f"{fit.num_ratings} ratings of {fit.num_people} people; each kind's trial stands on a page of its own.",
        "by design",
    )
    if fit.num_people < _LEAST_TESTED or float(fit.intercepts.std()) < 1e-6:  # noqa: PLR2004 - all alike
        yield Assumption(name, assumes, f"{fit.num_people} people, or no spread between them.", "not checkable")
        return
    try:
        p_value = shapiro_wilk(fit.intercepts).p_value
    except Undefined as undefined:
        yield Assumption(name, assumes, f"{undefined}.", "not checkable")
        return
    told = (
        f"Shapiro-Wilk test of the {fit.num_people} most probable intercepts: p = {p_value:.3g}; it is a rough guide."
    )
    yield Assumption(name, assumes, told, _verdict(p_value))


def _quadrature(name: str, model: PlannedFit) -> Assumption:
    assumes = "The quadrature is exact enough."
    try:
        finer = fit_planned(model.frame, model.kinds, num_nodes=31)
    except Undefined as undefined:
        return Assumption(name, assumes, f"No fit with 31 nodes: {undefined}.", "not checkable")
    change = max((abs(a - b) for a, b in zip(finer.fit.coefficients, model.fit.coefficients, strict=True)), default=0.0)
    told = f"With 31 nodes instead of 11 no coefficient changes by more than {max(change, 1e-6):.0e}."
    return Assumption(name, assumes, told, "holds" if change < 1e-3 else "doubtful")  # noqa: PLR2004


def _verdict(p_value: float) -> Verdict:
    if p_value >= 0.05:  # noqa: PLR2004 - the usual level
        return "holds"
    return "doubtful" if p_value >= 0.001 else "violated"  # noqa: PLR2004


def _named(test: Comparison) -> str:
    return f"Experiment {test.contrast.experiment}, {test.item}: {test.contrast}"
