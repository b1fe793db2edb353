"""The planned comparisons: ordinal mixed models of the ratings, one per item and experiment (probit link)."""

import math
from collections.abc import Collection, Iterator

from webapp.analysis.planned_comparisons import Comparison, Comparisons, Place, compare_kinds
from webapp.analysis.planned_model import Effect, PlannedFit, RatioTest
from webapp.reports.blocks import Block, Cell, Column, Section, Statement, Table
from webapp.reports.sections.ordinal_assumptions import on_other_layouts, ordinal_assumptions
from webapp.reports.sections.ordinal_figures import distribution_figures, forest_figure
from webapp.reports.sections.paper_numbers import COMPARISONS
from webapp.reports.sections.rated import rated_experiments
from webapp.reports.study_data import StudyData
from webapp.study.intervals import t_quantile

_INTRODUCTION = (
    "Ratings have an order and no distances, so a difference of their means can be larger, smaller or even of another "
    "sign than the difference of the opinions behind them (Liddell and Kruschke 2018). The planned model takes each "
    "rating for an interval of a latent opinion that varies between people and within them: a cumulative link mixed "
    "model with a probit link, effects of kind, layout and position, and a random intercept per participant, fitted by "
    "adaptive Gauss-Hermite quadrature. d is the difference of two kinds in standard deviations of the "
    "latent opinion, over people and within them; p values are of Wald's test by Student's t with the degrees of "
    "freedom within people, two-sided."
)


def section(data: StudyData) -> Section:
    """Compare the kinds as planned."""
    found = compare_kinds(data.ratings, data.plan)
    plan = data.plan
    whose = "declared in the study file" if plan.is_declared else "of the default plan, because none is declared"
    family = (
        f"The {plan.num_tests} comparisons are {whose}. All of them together are one family: p values are corrected by "
        f"Holm's method, and a difference is found where the corrected one is below {plan.alpha:g}."
    )
    blocks: list[Block] = [_INTRODUCTION, family, _comparisons_table(found, data)]
    blocks += [Statement(_named(test), test.missing) for test in found.tests if test.effect is None]
    if any(test.effect is not None for test in found.tests):
        blocks.append(forest_figure(found))
    blocks += [*distribution_figures(data), _models_table(found), _coefficients_table(found), _odds_table(data)]
    blocks += _aliased(found)
    return Section("ordinal", "Planned comparisons", tuple(blocks), tuple(ordinal_assumptions(found)))


def _comparisons_table(found: Comparisons, data: StudyData) -> Table:
    paper = {rated.id for rated in rated_experiments(data) if rated.paper}
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
        *([Column("paper", "Paper")] if paper else []),
    )
    rows = (_comparison_row(test) + ((_claim(test, paper),) if paper else ()) for test in found.tests)
    claims = " The paper's column is what its text says of these kinds." if paper else ""
    return Table(
        "planned_comparisons",
        "Planned comparisons of kinds of explanation",
        columns,
        tuple(rows),
        note=f"d above 0: the first kind is rated higher.{claims}{_with_layout(found)}",
    )


def _with_layout(found: Comparisons) -> str:
    """Return which comparisons are of kind and layout together, as a sentence."""
    told = {
        f"{contrast} in experiment {place[0]}": None
        for place in found.models
        for contrast in on_other_layouts(found, place)
    }
    return f" Of kind and layout together, which were not seen apart: {'; '.join(told)}." if told else ""


def _comparison_row(test: Comparison) -> tuple[Cell, ...]:
    ends: tuple[Cell, ...] = (test.contrast.experiment, test.item, str(test.contrast))
    if test.effect is None:
        return (*ends, *[None] * 7, "not determined")
    effect = test.effect
    numbers = (effect.d, effect.d_low, effect.d_high, effect.z, effect.df, effect.p_value, test.p_holm)
    return (*ends, *numbers, conclusion(test))


def _claim(test: Comparison, paper: Collection[str]) -> str | None:
    """Return what the paper says of the two kinds, in experiments that are the paper's."""
    if test.contrast.experiment not in paper:
        return None
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
    references = dict.fromkeys(
        _reference(place[0], model) for place, model in found.models.items() if isinstance(model, PlannedFit)
    )
    note = f"Compared with: {'; '.join(references)}." if references else ""
    return Table("ordinal_coefficients", "Coefficients and thresholds", columns, tuple(rows), note)


def _reference(experiment: str, model: PlannedFit) -> str:
    """Name the levels that have no coefficient because the others are compared with them."""
    factors = [factor for factor in ("layout", "position") if factor in model.columns]
    firsts = [f"kind {model.kinds[0]}", *(f"{factor} {min(model.frame[factor].unique())}" for factor in factors)]
    return f"in experiment {experiment} {', '.join(firsts)}"


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
    for place, model in found.models.items():
        for words in model.aliased if isinstance(model, PlannedFit) else ():
            left_out = f"{words}; it is left out of the model{_what_is_compared(words, found, place)}"
            told.setdefault((place[0], left_out), []).append(place[1])
    for (experiment, words), items in told.items():
        yield Statement(f"Experiment {experiment}, {', '.join(items)}", words)


def _what_is_compared(words: str, found: Comparisons, place: Place) -> str:
    """Return what a comparison is of where layouts go with kinds."""
    apart = on_other_layouts(found, place) if words.startswith("layout") else ()
    return f", so that {' and '.join(apart)} tell of kind and layout together" if apart else ""


def _named(test: Comparison) -> str:
    return f"Experiment {test.contrast.experiment}, {test.item}: {test.contrast}"
