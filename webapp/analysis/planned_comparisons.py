"""All planned comparisons of a study: one model per item and experiment, one family of tests for Holm's correction."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from webapp.analysis.censoring import Undefined
from webapp.analysis.links import Link
from webapp.analysis.multiplicity import holm
from webapp.analysis.planned_model import Effect, PlannedFit, fit_planned
from webapp.study.analysis_plan import Contrast, Plan

Place = tuple[str, str]
"""An experiment and one of its items."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """One planned test.

    Attributes:
        contrast: The kinds that are compared.
        item: The item.
        effect: What was found; None where the ratings do not determine it.
        missing: Why they do not; empty where they do.
        p_holm: Corrected for the whole family, in (0, 1]; None without an effect.
        alpha: The level of the family.
    """

    contrast: Contrast
    item: str
    effect: Effect | None
    missing: str
    p_holm: float | None
    alpha: float

    @property
    def is_found(self) -> bool:
        """Whether the two kinds differ, after the correction."""
        return self.p_holm is not None and self.p_holm < self.alpha


@dataclass(frozen=True, slots=True)
class Comparisons:
    """The planned tests of a study.

    Attributes:
        models: Of each experiment and item, the fitted model, or why there is none.
        tests: In the order of the plan, item by item.
    """

    models: Mapping[Place, PlannedFit | str]
    tests: tuple[Comparison, ...]

    @property
    def num_found(self) -> int:
        """How many of them show a difference."""
        return sum(test.is_found for test in self.tests)


def compare_kinds(ratings: pd.DataFrame, plan: Plan, *, link: Link = "probit") -> Comparisons:
    """Fit the planned models and test the planned contrasts.

    A test that cannot be made stays in the family as one that shows nothing, so that missing data make no other test
    easier.

    Args:
        ratings: One row per rating, with `participant, experiment, trial, layout, kind, item, rating`.
        plan: What is compared.
        link: Of the models.
    """
    pairs = [(contrast, item) for contrast in plan.contrasts for item in plan.items_of(contrast)]
    places = dict.fromkeys((contrast.experiment, item) for contrast, item in pairs)
    kinds = _kinds(plan)
    models = {place: _model(ratings, place, kinds[place[0]], link) for place in places}
    effects = [_effect(models[contrast.experiment, item], contrast) for contrast, item in pairs]
    p_values = [effect.p_value if isinstance(effect, Effect) else 1.0 for effect in effects]
    corrected = holm(p_values).tolist() if p_values else []
    tests = tuple(
        Comparison(contrast, item, effect, "", p_holm, plan.alpha)
        if isinstance(effect, Effect)
        else Comparison(contrast, item, None, effect, None, plan.alpha)
        for (contrast, item), effect, p_holm in zip(pairs, effects, corrected, strict=True)
    )
    return Comparisons(models, tests)


def ratings_of(ratings: pd.DataFrame, place: Place) -> pd.DataFrame:
    """Return the ratings of one item in one experiment."""
    return ratings[(ratings["experiment"] == place[0]) & (ratings["item"] == place[1])]


def _kinds(plan: Plan) -> dict[str, list[str]]:
    """Return the kinds of each experiment in the order in which the plan names them."""
    kinds: dict[str, list[str]] = {}
    for contrast in plan.contrasts:
        named = kinds.setdefault(contrast.experiment, [])
        named += [kind for kind in (contrast.first, contrast.second) if kind not in named]
    return kinds


def _model(ratings: pd.DataFrame, place: Place, planned: list[str], link: Link) -> PlannedFit | str:
    frame = ratings_of(ratings, place)
    others = sorted(set(frame["kind"]) - set(planned))
    try:
        return fit_planned(frame, [*planned, *others], link=link)
    except Undefined as undefined:
        return str(undefined)


def _effect(model: PlannedFit | str, contrast: Contrast) -> Effect | str:
    if isinstance(model, str):
        return model
    try:
        return model.contrast(contrast.first, contrast.second)
    except Undefined as undefined:
        return str(undefined)
