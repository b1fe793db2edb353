"""The plan of the analysis: which kinds are compared on which items, how sure, and within which margin they are alike.

A study file declares it before there are data, in `[analysis]`. What it leaves out is filled in by one rule, so that
the same plan follows for `xar power`, for `xar study check` and for the report.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from webapp.study.experiments import BUILT_IN_KINDS, SATISFACTION_ITEMS
from webapp.study.protocol import Study
from webapp.study.sections import AnalysisPlan, PlannedContrast

FOCAL_KINDS = ("subgoals", "all_key_points")
"""The kinds that the paper proposes: compared with each other kind where a study declares no contrasts."""

AS_GOOD_AS = (("subgoals", "full"), ("first_key_point", "all_key_points"))
"""Pairs of which the paper claims that the first suffices: tested for equivalence where a study declares none."""

ALPHA = 0.05
EQUIVALENCE_MARGIN = 0.5
"""In points of a rating; ours, where a study declares none."""

PAPER_ITEMS = ("likeliness", "loveliness", "general")
"""The items of Sakai et al. 2021 in the order of their questionnaire."""


@dataclass(frozen=True, slots=True)
class Contrast:
    """A planned comparison of two kinds of explanation in one experiment, `first` minus `second`."""

    experiment: str
    first: str
    second: str

    def __str__(self) -> str:
        return f"{self.first} \N{MINUS SIGN} {self.second}"


@dataclass(frozen=True, slots=True)
class Plan:
    """What is tested.

    Attributes:
        contrasts: The planned comparisons. Each is made on each of its experiment's `items`; all of these tests
            together are one family for Holm's correction.
        equivalences: Pairs of kinds tested for equivalence, a family of their own.
        items: By experiment, the items that are tested, in the order of the questionnaire.
        alpha: The level of the family.
        margin: In rating points, on either side.
        is_declared: Whether the study file declares contrasts; otherwise they follow from `default_contrasts`.
        is_margin_declared: Whether it declares the margin.
        text: The registered plan in words, None if there is none.
        asked: By experiment and kind, which of the experiment's `items` are asked about this kind; a kind that is not
            there is asked about all of them.
    """

    contrasts: tuple[Contrast, ...]
    equivalences: tuple[Contrast, ...]
    items: Mapping[str, tuple[str, ...]]
    alpha: float = ALPHA
    margin: float = EQUIVALENCE_MARGIN
    is_declared: bool = False
    is_margin_declared: bool = False
    text: str | None = None
    asked: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)

    @property
    def num_tests(self) -> int:
        """The size of the family: each contrast on each item that is asked about both of its kinds."""
        return sum(len(self.items_of(contrast)) for contrast in self.contrasts)

    def items_of(self, contrast: Contrast) -> tuple[str, ...]:
        """Return the items on which two kinds are compared: the tested ones that are asked about both of them."""
        tested = self.items.get(contrast.experiment, ())
        ends = [self.asked.get((contrast.experiment, kind), tested) for kind in (contrast.first, contrast.second)]
        return tuple(item for item in tested if all(item in asked for asked in ends))


def plan_of(study: Study, text: str | None = None) -> Plan:
    """Return the plan that a study file declares, filled in where it leaves something out.

    Args:
        study: The study.
        text: The registered plan in words, None if there is none.
    """
    declared = study.analysis or AnalysisPlan()
    items = {
        experiment.id: tuple(item.id for item in experiment.items if item.id in declared.items or not declared.items)
        for experiment in study.experiments
    }
    asked = {
        (experiment.id, kind): tuple(item.id for item in experiment.items_for(kind) if item.id in items[experiment.id])
        for experiment in study.experiments
        for kind in experiment.kinds
    }
    return _filled(declared, {experiment.id: experiment.kinds for experiment in study.experiments}, items, asked, text)


def plan_without(
    kinds: Mapping[str, Iterable[str]],
    items: Mapping[str, Iterable[str]],
    asked: Mapping[tuple[str, str], Iterable[str]] | None = None,
) -> Plan:
    """Return the plan for data whose study file is not there: the default contrasts on every item.

    Args:
        kinds: The kinds of each experiment, in any order.
        items: Its items, in any order. Those of the satisfaction scale are tested only where there are no others.
        asked: By experiment and kind, which items are asked about it; about all of them if None.
    """
    kinds_of = {experiment: _ordered(found, BUILT_IN_KINDS) for experiment, found in kinds.items()}
    items_of = {experiment: _tested(found) for experiment, found in items.items()}
    of_kind = {
        key: tuple(item for item in items_of[key[0]] if item in set(found)) for key, found in (asked or {}).items()
    }
    return _filled(AnalysisPlan(), kinds_of, items_of, of_kind, None)


def default_contrasts(experiment: str, kinds: Sequence[str]) -> tuple[Contrast, ...]:
    """Return the contrasts of an experiment that declares none.

    Its first focal kind, or else its first kind, is compared with each other kind.
    """
    if not kinds:
        return ()
    focal = next((kind for kind in FOCAL_KINDS if kind in kinds), kinds[0])
    return tuple(Contrast(experiment, focal, kind) for kind in kinds if kind != focal)


def default_equivalences(experiment: str, kinds: Sequence[str]) -> tuple[Contrast, ...]:
    """Return the pairs of `AS_GOOD_AS` that an experiment has."""
    return tuple(Contrast(experiment, *pair) for pair in AS_GOOD_AS if set(pair) <= set(kinds))


def _filled(
    declared: AnalysisPlan,
    kinds: Mapping[str, Sequence[str]],
    items: Mapping[str, tuple[str, ...]],
    asked: Mapping[tuple[str, str], tuple[str, ...]],
    text: str | None,
) -> Plan:
    contrasts = _contrasts(declared.contrasts) or _by_default(default_contrasts, kinds)
    equivalences = _contrasts(declared.equivalences) or _by_default(default_equivalences, kinds)
    plan = Plan(
        contrasts,
        equivalences,
        items,
        alpha=declared.alpha,
        margin=EQUIVALENCE_MARGIN if declared.equivalence_margin is None else declared.equivalence_margin,
        is_declared=bool(declared.contrasts),
        is_margin_declared=declared.equivalence_margin is not None,
        text=text,
        asked=asked,
    )
    # A default compares the focal kind with every other, also where no item is asked about both.
    return replace(
        plan,
        contrasts=tuple(contrast for contrast in contrasts if plan.items_of(contrast)),
        equivalences=tuple(pair for pair in equivalences if plan.items_of(pair)),
    )


def _contrasts(declared: Iterable[PlannedContrast]) -> tuple[Contrast, ...]:
    return tuple(Contrast(pair.experiment, pair.first, pair.second) for pair in declared)


def _by_default(
    rule: Callable[[str, Sequence[str]], tuple[Contrast, ...]], kinds: Mapping[str, Sequence[str]]
) -> tuple[Contrast, ...]:
    return tuple(contrast for experiment, found in kinds.items() for contrast in rule(experiment, found))


def _tested(items: Iterable[str]) -> tuple[str, ...]:
    ordered = _ordered(items, (*PAPER_ITEMS, *SATISFACTION_ITEMS))
    return tuple(item for item in ordered if item not in SATISFACTION_ITEMS) or ordered


def _ordered(names: Iterable[str], known: Sequence[str]) -> tuple[str, ...]:
    """Put known names in their order, and the others behind them by their letters."""
    places = {name: place for place, name in enumerate(known)}
    return tuple(sorted(set(names), key=lambda name: (places.get(name, len(known)), name)))
