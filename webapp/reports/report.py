"""A whole report: what it is about, and its sections, whose tables and figures have names of their own."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from webapp.reports.blocks import Assumption, Block, Column, Drawing, Figure, Section, Table

ALL_ASSUMPTIONS = "assumptions"
"""The name of the table with the assumptions of all sections, which is written and not shown as such."""

MODE = "Mode"
"""The name of the fact that says whose answers are analysed."""

_NOT_LIVE = {
    "bot": "These are answers of programs, not of people.",
    "test": "These are answers of a test run, not of participants.",
}

_COLUMNS = (
    Column("section", "Section"),
    Column("test", "Test"),
    Column("assumes", "It assumes"),
    Column("check", "What the data say"),
    Column("verdict", "Verdict"),
)


@dataclass(frozen=True, slots=True)
class Report:
    """A report before it is HTML.

    Attributes:
        title: Its heading.
        facts: What is said of it at its top, as names and values.
        sections: In the order in which they are read.
    """

    title: str
    facts: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]

    def __post_init__(self) -> None:
        for kind, names in (
            ("section", [section.name for section in self.sections]),
            ("table", [ALL_ASSUMPTIONS, *(table.name for table in self.tables)]),
            ("figure", [figure.name for figure in self.figures]),
        ):
            twice = [name for name, count in Counter(names).items() if count > 1]
            if twice:
                raise ValueError(f"a report has each {kind} once, and {', '.join(twice)} more often")

    @property
    def banner(self) -> str:
        """What must not be missed: that answers are none of a study's participants. Empty where they are."""
        return _NOT_LIVE.get(dict(self.facts).get(MODE, ""), "")

    @property
    def blocks(self) -> Iterator[Block]:
        """All blocks in order."""
        return (block for section in self.sections for block in section.blocks)

    @property
    def tables(self) -> tuple[Table, ...]:
        """All tables in order."""
        return tuple(block for block in self.blocks if isinstance(block, Table))

    @property
    def figures(self) -> tuple[Figure | Drawing, ...]:
        """All figures in order, drawn or to be drawn."""
        return tuple(block for block in self.blocks if isinstance(block, Figure | Drawing))

    def assumptions(self) -> Table:
        """Return the assumptions of all sections in one table."""
        rows = tuple((section.title, *_cells(each)) for section in self.sections for each in section.assumptions)
        return Table(ALL_ASSUMPTIONS, "What the tests take for granted", _COLUMNS, rows)


def _cells(assumption: Assumption) -> tuple[str, ...]:
    return assumption.test, assumption.assumes, assumption.check, assumption.verdict
