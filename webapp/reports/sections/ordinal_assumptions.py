"""What the planned comparisons take for granted, and what the ratings say to it."""

from collections.abc import Iterator

import pandas as pd

from webapp.analysis.censoring import Undefined
from webapp.analysis.intercept_check import check_intercepts
from webapp.analysis.planned_comparisons import Comparisons, Place
from webapp.analysis.planned_model import PlannedFit, check_shape, fit_planned
from webapp.reports.blocks import Assumption, Verdict
from webapp.reports.formatting import counted, listed
from webapp.reports.kind_outcomes import stream

_FINER_NODES = 31


def ordinal_assumptions(found: Comparisons) -> Iterator[Assumption]:
    """Yield the assumptions of each model."""
    for place, model in found.models.items():
        if isinstance(model, PlannedFit):
            experiment, item = place
            name = f"Ordinal mixed model, experiment {experiment}, {item}"
            yield _shape(name, model)
            yield _layouts(name, found, place, model)
            yield _independence(name, model)
            if model.fit.has_person_effect:
                yield _intercepts(name, place, model)
            yield _quadrature(name, model)


def on_other_layouts(found: Comparisons, place: Place) -> tuple[str, ...]:
    """Return the comparisons whose kinds no chain of shared layouts joins: there kind and layout cannot be told apart.

    Args:
        found: The planned comparisons.
        place: An experiment and one of its items.
    """
    model = found.models[place]
    if not isinstance(model, PlannedFit):
        return ()
    group = _joined(model.frame)
    return tuple(
        str(test.contrast)
        for test in found.tests
        if (test.contrast.experiment, test.item) == place
        and test.effect is not None
        and group[test.contrast.first] != group[test.contrast.second]
    )


def _joined(frame: pd.DataFrame) -> dict[str, int]:
    """Return a number for each kind, the same for kinds that share a layout, also by way of other kinds."""
    group = {str(kind): number for number, kind in enumerate(sorted(set(frame["kind"])))}
    for _, rows in frame.groupby("layout", sort=True):
        together = {group[str(kind)] for kind in rows["kind"]}
        group = {kind: min(together) if number in together else number for kind, number in group.items()}
    return group


def _shape(name: str, model: PlannedFit) -> Assumption:
    assumes = "A kind moves the whole latent opinion: it shifts all thresholds by the same amount."
    try:
        found = check_shape(model)
    except Undefined as undefined:
        return Assumption(name, assumes, f"Not testable: {undefined}.", "not checkable")
    test = found.ratio
    told = f"Likelihood-ratio test against thresholds of each kind's own: χ²({test.df}) = {test.statistic:.2f}, "
    together = f" with the ratings {found.words} told apart" if any(len(bin_) > 1 for bin_ in found.bins) else ""
    return Assumption(name, assumes, f"{told}p = {test.p_value:.3g}{together}.", _verdict(test.p_value, 0.001))


def _layouts(name: str, found: Comparisons, place: Place, model: PlannedFit) -> Assumption:
    assumes = "The kinds are compared on the same layouts."
    num_layouts = counted(model.frame["layout"].nunique(), "layout")
    aliased = [words for words in model.aliased if words.startswith("layout")]
    apart = on_other_layouts(found, place)
    if apart:
        told = f"Of {num_layouts}, {'; '.join(aliased)}: {listed(list(apart))} tell of kind and layout together."
        return Assumption(name, assumes, told, "violated")
    if aliased:
        told = f"Of {num_layouts}, {'; '.join(aliased)}, but kinds that are compared share layouts."
        return Assumption(name, assumes, told, "holds")
    told = f"The effects of {num_layouts} and of the kinds are told apart." if len(model.kinds) > 1 else "One kind."
    return Assumption(name, assumes, told, "holds")


def _independence(name: str, model: PlannedFit) -> Assumption:
    fit = model.fit
    if not fit.has_person_effect:
        told = "Nobody rated this item more than once, so the model has no intercepts."
        return Assumption(name, "Ratings are independent: one per person.", told, "by design")
    assumes = "Given the intercept, a person's ratings are independent: a kind acts alike on everybody."
    told = f"{fit.num_ratings:,} ratings of {fit.num_people:,} people"
    repeats = model.frame.groupby(["participant", "kind"]).size()
    num_repeated = int((repeats > 1).sum())
    if not num_repeated:
        why = "each kind once per person, so that a kind's own effect on a person (a slope) cannot be told from error"
        return Assumption(name, assumes, f"{told}, {why}.", "not checkable")
    how_often = f"a person rated a kind more than once in {num_repeated:,} of {len(repeats):,} cases, at most "
    why = f"{how_often}{int(repeats.max())} times; the model has no effects of a kind on single persons (slopes)"
    return Assumption(name, assumes, f"{told}; {why}.", "doubtful")


def _intercepts(name: str, place: Place, model: PlannedFit) -> Assumption:
    assumes = "People's intercepts are drawn from a normal distribution."
    rng = stream(f"intercepts {place[0]} {place[1]}")
    try:
        found = check_intercepts(model.fit, model.frame["participant"], model.x, rng)
    except Undefined as undefined:
        return Assumption(name, assumes, f"Not testable: {undefined}.", "not checkable")
    told = (
        f"Shapiro and Wilk's W of the {model.fit.num_people} most probable intercepts is {found.statistic:.3f}; in "
        f"{found.num_draws} draws of ratings from the fitted model it is {found.usual:.3f} at the median, p = "
        f"{found.p_value:.3g} by its rank."
    )
    # With so many draws no p value is below .005.
    return Assumption(name, assumes, told, _verdict(found.p_value, 0.01))


def _quadrature(name: str, model: PlannedFit) -> Assumption:
    assumes, num_nodes = "The quadrature is exact enough.", model.fit.num_nodes
    try:
        finer = fit_planned(model.frame, model.kinds, num_nodes=max(_FINER_NODES, 2 * num_nodes))
    except Undefined as undefined:
        return Assumption(name, assumes, f"No fit with more than {num_nodes} nodes: {undefined}.", "not checkable")
    change = max((abs(a - b) for a, b in zip(finer.fit.coefficients, model.fit.coefficients, strict=True)), default=0.0)
    told = f"With {finer.fit.num_nodes} nodes instead of {num_nodes} no coefficient changes by more than "
    return Assumption(name, assumes, f"{told}{max(change, 1e-6):.0e}.", "holds" if change < 1e-3 else "doubtful")  # noqa: PLR2004


def _verdict(p_value: float, violated_below: float) -> Verdict:
    if p_value >= 0.05:  # noqa: PLR2004 - the usual level
        return "holds"
    return "doubtful" if p_value >= violated_below else "violated"
