"""The first section: the answers in plain words, with their numbers."""

from collections.abc import Sequence

from webapp.reports.blocks import Block, Column, Section, Table
from webapp.reports.departures import nothing_differs
from webapp.reports.findings import Finding
from webapp.reports.formatting import counted, listed, number
from webapp.reports.people import headcount
from webapp.reports.study_data import StudyData

_COLUMNS = (
    Column("experiment", "Experiment"),
    Column("contrast", "Comparison"),
    Column("item", "Item"),
    Column("answer", "Answer"),
    Column("d", "d", "number"),
    Column("d_low", "95 % from", "number"),
    Column("d_high", "to", "number"),
    Column("p_holm", "p (Holm)", "p"),
)


def summary(
    data: StudyData, found: Sequence[Finding], as_good: Sequence[tuple[str, str, bool]], differences: Sequence[str]
) -> Section:
    """Return what the data say to the planned comparisons, who was analysed, and what differs from the plan.

    Args:
        data: What was analysed.
        found: What came of the planned comparisons.
        as_good: What was tested for being as good as something else, and whether it was shown to be.
        differences: From the plan, as sentences.
    """
    blocks: list[Block] = [answer(data, found), headcount(data).sentence()]
    if found:
        blocks.append(_table(data, found))
    if as_good:
        blocks.append(_as_good(data, as_good))
    blocks.append(_differences(data, differences))
    return Section("summary", "Summary", tuple(blocks))


def answer(data: StudyData, found: Sequence[Finding]) -> str:
    """Return how many of the planned comparisons hold, as a sentence or two."""
    if not found:
        return "No comparison is planned, so that none is tested."
    made = [finding for finding in found if not finding.reason]
    held = [finding for finding in made if finding.holds(data.plan.alpha)]
    planned = "planned" if data.plan.is_declared else "planned (by default)"
    if not made:
        return f"None of {counted(len(found), planned + ' comparison')} could be made: the data determine none."
    told = (
        f"Of {counted(len(found), planned + ' comparison')}, {_verb(len(held))} after Holm's correction for "
        f"{counted(data.plan.num_tests, 'test')}, at the level {number(data.plan.alpha)} of the family."
    )
    if len(made) < len(found):
        told += f" {counted(len(found) - len(made), 'comparison')} could not be made."
    if len(held) < len(made):
        told += " That no difference was found is no evidence that there is none"
        told += "; see the section on equivalence." if data.plan.equivalences else "."
    return told


def in_words(finding: Finding, alpha: float) -> str:
    """Return what came of one planned comparison, in a few words."""
    if finding.reason:
        return f"not tested: {finding.reason}"
    if not finding.holds(alpha) or finding.d is None:
        return "no difference found"
    first, second = finding.contrast.first, finding.contrast.second
    return f"{first if finding.d > 0 else second} rated higher"


def _verb(count: int) -> str:
    return {0: "none shows a difference", 1: "1 shows a difference"}.get(count, f"{count} show a difference")


def _table(data: StudyData, found: Sequence[Finding]) -> Table:
    rows = tuple(
        (
            finding.contrast.experiment,
            str(finding.contrast),
            finding.item,
            in_words(finding, data.plan.alpha),
            finding.d,
            finding.d_low,
            finding.d_high,
            finding.p_holm,
        )
        for finding in found
    )
    note = (
        "d is the difference on the latent scale of the ordinal mixed model in standard deviations, first kind minus "
        "second; its interval is for this comparison alone. p is two-sided and corrected over the whole family."
    )
    return Table("summary", "What the planned comparisons found", _COLUMNS, rows, note)


def _as_good(data: StudyData, as_good: Sequence[tuple[str, str, bool]]) -> str:
    shown: dict[str, list[str]] = {}
    for pair, item, is_shown in as_good:
        if is_shown:
            shown.setdefault(pair, []).append(item)
    count = sum(map(len, shown.values()))
    told = f"Of {counted(len(as_good), 'test')} whether the first kind of a pair is as good as the second"
    margin = f"worse by less than {data.plan.margin:g} points, after Holm's correction"
    number_shown = {0: "none shows it", 1: "1 shows it"}.get(count, f"{count} show it")
    pairs = "; ".join(f"{pair} on {listed(items)}" for pair, items in shown.items())
    return f"{told} ({margin}), {number_shown}{': ' if pairs else ''}{pairs}."


def _differences(data: StudyData, differences: Sequence[str]) -> str:
    if not differences:
        return nothing_differs(data)
    return "\n".join(["What differs from the plan:", *(f"\N{BULLET} {each}" for each in differences)])
