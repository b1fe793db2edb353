"""The assumptions of all sections together: how many hold, and which do not."""

from collections import Counter
from collections.abc import Sequence
from typing import get_args

from webapp.reports.blocks import Block, Cell, Column, Section, Table, Verdict
from webapp.reports.formatting import counted
from webapp.reports.report import ALL_ASSUMPTIONS

VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
_SOUND = {"holds", "by design"}
_IN_DOUBT = (
    Column("section", "Section"),
    Column("test", "Test"),
    Column("assumes", "It assumes"),
    Column("check", "What the data say"),
    Column("verdict", "Verdict"),
)


def in_doubt(sections: Sequence[Section]) -> Section:
    """Return what became of all assumptions, and those that the data contradict or cannot show."""
    counts = [(section.title, Counter(each.verdict for each in section.assumptions)) for section in sections]
    told = [(title, found) for title, found in counts if found]
    total = sum((found for _, found in told), Counter[Verdict]())
    blocks: list[Block] = [_sentence(total)]
    if told:
        blocks.append(_counts(told))
    doubts: tuple[tuple[Cell, ...], ...] = tuple(
        (section.title, each.test, each.assumes, each.check, each.verdict)
        for section in sections
        for each in section.assumptions
        if each.verdict not in _SOUND
    )
    if doubts:
        blocks.append(Table("assumptions_in_doubt", "Assumptions that are not shown to hold", _IN_DOUBT, doubts))
    return Section("assumptions", "Assumptions", tuple(blocks))


def _sentence(total: Counter[Verdict]) -> str:
    if not total:
        return "No test was made, so that nothing was assumed."
    told = ", ".join(f"{verdict}: {total[verdict]}" for verdict in VERDICTS if total[verdict])
    return (
        f"The tests of this report rest on {counted(total.total(), 'assumption')} ({told}). Each stands below its "
        f"tests; all are in tables/{ALL_ASSUMPTIONS}.csv. A check that finds nothing in few data is no proof."
    )


def _counts(told: Sequence[tuple[str, Counter[Verdict]]]) -> Table:
    columns = (Column("section", "Section"), *(Column(v.replace(" ", "_"), v.capitalize(), "count") for v in VERDICTS))
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (title, *(found[verdict] for verdict in VERDICTS)) for title, found in told
    )
    return Table("assumption_counts", "Verdicts on the assumptions", columns, rows)
