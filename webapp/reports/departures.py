"""What differs between what was registered and what was run."""

from collections.abc import Mapping, Sequence

from webapp.reports.findings import Finding
from webapp.reports.formatting import counted, listed
from webapp.reports.origin import Origin
from webapp.reports.study_data import StudyData


def departures(data: StudyData, found: Sequence[Finding], origin: Origin) -> tuple[str, ...]:
    """Return each difference from the plan as a sentence; none if there is none.

    Args:
        data: What was analysed, with its plan.
        found: What came of the planned comparisons.
        origin: Where the data come from, with the options and what was chosen otherwise than declared.
    """
    chosen = (*_of_the_data(data, origin.asked), *origin.differences)
    return (*_of_the_plan(data), *chosen, *_of_the_run(found), *_unplanned(data))


def nothing_differs(data: StudyData) -> str:
    """Say that nothing differs, and from what: words that nobody registered cannot be followed."""
    if data.plan.text is None:
        return (
            "The declared comparisons were run as they are frozen with the study's version. No plan in words is "
            "registered, so there is nothing else to differ from."
        )
    return "Everything was run as it was registered."


def _of_the_plan(data: StudyData) -> list[str]:
    told = []
    if not data.plan.is_declared:
        told.append(
            "The study file declares no contrasts. The default plan was used: in each experiment the kind that the "
            "paper proposes against each other kind. It was not registered with the study."
        )
    declared = None if data.declared is None else data.declared.analysis
    if data.plan.equivalences and declared is not None and not declared.equivalences:
        told.append("The pairs that are tested for equivalence are those of the default plan: no pair is declared.")
    if data.plan.equivalences and not data.plan.is_margin_declared:
        told.append(
            f"The study file declares no margin of equivalence. The default was used, {data.plan.margin:g} points of a "
            "rating, which is ours."
        )
    return told


def _of_the_data(data: StudyData, asked: Mapping[str, object]) -> list[str]:
    told = []
    if data.mode != "live":
        told.append(f"The mode is {data.mode}: these are no data of a study's participants.")
    if asked.get("include_incomplete"):
        told.append("People who did not complete the study are analysed too, because --include-incomplete was given.")
    return told


def _of_the_run(found: Sequence[Finding]) -> list[str]:
    missing = [finding for finding in found if finding.reason]
    if not missing:
        return []
    told = f"{counted(len(missing), 'planned comparison')} of {len(found)} could not be made; the table says why."
    return [told]


def _unplanned(data: StudyData) -> list[str]:
    told = []
    for experiment, items in sorted(data.plan.items.items()):
        rated = data.ratings[data.ratings["experiment"] == experiment]
        extra = sorted(set(rated["item"]) - set(items))
        if extra:
            told.append(f"Experiment {experiment} has ratings of {listed(extra)}, which the plan does not test.")
    known = {contrast.experiment for contrast in data.plan.contrasts}
    others = sorted(set(data.ratings["experiment"]) - known)
    if others:
        told.append(f"No comparison is planned in experiment {listed(others)}.")
    return told
