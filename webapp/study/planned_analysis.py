"""A planned analysis that does not fit the study: comparisons of what is not there, or of the same twice."""

from collections.abc import Collection, Iterator, Sequence

from webapp.study.experiments import BUILT_IN_KINDS, Experiment
from webapp.study.sections import AnalysisPlan, PlannedContrast
from webapp.study.suggestions import meant

_Path = Sequence[str | int]
_Problem = tuple[_Path, str]


def plan_problems(
    plan: AnalysisPlan, experiments: Sequence[Experiment], own_kinds: Collection[str]
) -> Iterator[_Problem]:
    """Yield what is wrong with a planned analysis, each with the path of the setting.

    Args:
        plan: The plan, right in itself.
        experiments: All experiments of the study, each with an id of its own.
        own_kinds: The names of the study's own kinds.
    """
    mistyped = {
        experiment.id for experiment in experiments if not set(experiment.kinds) <= {*BUILT_IN_KINDS, *own_kinds}
    }
    for name in ("contrasts", "equivalences", "items"):
        if name in plan.model_fields_set and not getattr(plan, name):
            yield ("analysis", name), "is empty; list at least one, or leave it out"
    wrong_items = list(_of_items(plan.items, experiments))
    yield from wrong_items
    # Items that are wrong say nothing yet about which comparisons they leave.
    items = () if wrong_items else plan.items
    for name, contrasts in (("contrasts", plan.contrasts), ("equivalences", plan.equivalences)):
        seen: set[tuple[str, frozenset[str]]] = set()
        for number, contrast in enumerate(contrasts):
            if contrast.experiment in mistyped:
                # A kind that is wrong in itself says nothing yet about what is compared with it.
                continue
            where = ("analysis", name, number)
            problems = list(_of_contrast(contrast, items, experiments))
            pair = (contrast.experiment, frozenset({contrast.first, contrast.second}))
            if not problems and pair in seen:
                problems = [((), f"is about {_said(contrast)} again; keep one")]
            seen.add(pair)
            yield from (((*where, *path), message) for path, message in problems)
    yield from _of_margin(plan, experiments)


def _of_items(items: Sequence[str], experiments: Sequence[Experiment]) -> Iterator[_Problem]:
    known = list(dict.fromkeys(item.id for experiment in experiments for item in experiment.items))
    for number, item in enumerate(items):
        if item in items[:number]:
            yield ("analysis", "items", number), f"is {item!r}, which stands there already; keep one"
        elif item not in known:
            wish = f"{meant(item, known)}the items are {', '.join(known)}"
            yield ("analysis", "items", number), f"is {item!r}; {wish}"


def _of_contrast(
    contrast: PlannedContrast, items: Sequence[str], experiments: Sequence[Experiment]
) -> Iterator[_Problem]:
    by_id = {experiment.id: experiment for experiment in experiments}
    experiment = by_id.get(contrast.experiment)
    if experiment is None:
        yield ("experiment",), f"is {contrast.experiment!r}; the experiments are {', '.join(by_id) or 'none'}"
        return
    unknown = [end for end in ("first", "second") if getattr(contrast, end) not in experiment.kinds]
    for end in unknown:
        kind = getattr(contrast, end)
        told = f"the kinds of experiment {experiment.id!r} are {', '.join(experiment.kinds)}"
        yield (end,), f"is {kind!r}; {meant(kind, experiment.kinds)}{told}"
    if unknown:
        return
    if contrast.first == contrast.second:
        yield ("second",), f"is {contrast.second!r}, the first kind too; name two kinds"
    elif not _asked_of_both(contrast, items, experiment):
        yield (), f"is about {_said(contrast)}, and no item that is tested is asked of both; leave it out"


def _asked_of_both(contrast: PlannedContrast, items: Sequence[str], experiment: Experiment) -> set[str]:
    first, second = ({item.id for item in experiment.items_for(kind)} for kind in (contrast.first, contrast.second))
    return first & second & (set(items) or first)


def _of_margin(plan: AnalysisPlan, experiments: Sequence[Experiment]) -> Iterator[_Problem]:
    """Yield a margin within which any two kinds would be alike."""
    if plan.equivalence_margin is None:
        return
    tested = (
        item for experiment in experiments for item in experiment.items if item.id in plan.items or not plan.items
    )
    shortest = min(tested, key=lambda item: item.points, default=None)
    if shortest is not None and plan.equivalence_margin >= shortest.points - 1:
        wish = f"{shortest.id!r} has {shortest.points} points, so any two kinds would be alike"
        yield (
            ("analysis", "equivalence_margin"),
            f"is {plan.equivalence_margin:g}, and {wish}; use less than {shortest.points - 1}",
        )


def _said(contrast: PlannedContrast) -> str:
    return f"{contrast.first!r} and {contrast.second!r} of experiment {contrast.experiment!r}"
