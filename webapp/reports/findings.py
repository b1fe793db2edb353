"""What came of the planned tests, read from the tables of the sections that make them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from webapp.reports.blocks import Cell, Section, Statement, Table
from webapp.reports.formatting import plain
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Contrast

PLANNED = frozenset({"experiment", "contrast", "item", "d", "d_low", "d_high", "p_holm"})
"""The columns by which the table of planned comparisons is known; `contrast` reads as `Contrast` prints."""

EQUIVALENCE = frozenset({"experiment", "contrast", "item", "is_as_good"})
"""The columns by which the table of tests of equivalence is known."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One planned test.

    Attributes:
        contrast: What was compared.
        item: On which item.
        d: The standardised difference, first minus second; None if it was not determined, as all that follows.
        d_low: The lower end of its interval.
        d_high: The upper end.
        p_holm: After Holm's correction over the whole family.
        reason: Why it was not run; empty if it was.
    """

    contrast: Contrast
    item: str
    d: float | None = None
    d_low: float | None = None
    d_high: float | None = None
    p_holm: float | None = None
    reason: str = ""

    def holds(self, alpha: float) -> bool:
        """Say whether a difference was found at this level of the family."""
        return self.p_holm is not None and self.p_holm < alpha


def findings(data: StudyData, section: Section) -> tuple[Finding, ...]:
    """Return what came of every planned comparison, in the order of the plan.

    Args:
        data: What was analysed, with its plan.
        section: Holds a table with the columns `PLANNED`, or none if nothing could be computed.
    """
    rows = {_key(row): row for row in _rows(section, PLANNED)}
    told = {block.subject: block.reason for block in section.blocks if isinstance(block, Statement)}
    found = []
    for contrast in data.plan.contrasts:
        for item in data.plan.items_of(contrast):
            d, d_low, d_high, p_holm = _numbers(rows.get((contrast.experiment, str(contrast), item), {}))
            if p_holm is not None:
                found.append(Finding(contrast, item, d, d_low, d_high, p_holm))
            else:
                reason = told.get(f"Experiment {contrast.experiment}, {item}: {contrast}")
                found.append(Finding(contrast, item, reason=reason or _why_not(data, contrast, item)))
    return tuple(found)


def judged_as_good(section: Section) -> tuple[tuple[str, str, bool], ...]:
    """Return what was tested for being as good as something else: pair, item, and whether it was shown to be."""
    return tuple(
        (f"{row['contrast']} in experiment {row['experiment']}", str(row["item"]), row["is_as_good"] is True)
        for row in _rows(section, EQUIVALENCE)
    )


def _rows(section: Section, wanted: frozenset[str]) -> Iterator[Mapping[str, Cell]]:
    for block in section.blocks:
        if isinstance(block, Table) and {column.name for column in block.columns} >= wanted:
            names = [column.name for column in block.columns]
            yield from (dict(zip(names, map(plain, row), strict=True)) for row in block.rows)


def _key(row: Mapping[str, Cell]) -> tuple[str, str, str]:
    return str(row["experiment"]), str(row["contrast"]), str(row["item"])


def _numbers(row: Mapping[str, Cell]) -> list[float | None]:
    cells = [row.get(name) for name in ("d", "d_low", "d_high", "p_holm")]
    return [float(cell) if isinstance(cell, int | float) else None for cell in cells]


def _why_not(data: StudyData, contrast: Contrast, item: str) -> str:
    rated = data.ratings
    rated = rated[(rated["experiment"] == contrast.experiment) & (rated["item"] == item)]
    missing = [kind for kind in (contrast.first, contrast.second) if not (rated["kind"] == kind).any()]
    if len(rated) == 0:
        return "nobody who is analysed rated this item"
    if missing:
        return f"no rating of {' and none of '.join(missing)}"
    return "the model does not determine it; the section of the planned comparisons says why"
