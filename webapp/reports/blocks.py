"""What a report is made of: sections of paragraphs, tables, figures and statements, before they are HTML or CSV."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

Cell: TypeAlias = str | int | float | bool | None
"""One value of a table; None is an empty cell, which means that there is no such number."""

ColumnKind = Literal["text", "count", "number", "p", "percent"]
"""How a column is shown: `p` as `.012` or `< .001`, `percent` a share from 0 to 1 as `42 %`. A CSV has all digits."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    Attributes:
        name: Its name in the CSV file, in snake case.
        heading: Its heading in the report.
        kind: How its values are shown.
        digits: After the decimal point, for `number` and `percent`.
    """

    name: str
    heading: str
    kind: ColumnKind = "text"
    digits: int = 2


@dataclass(frozen=True, slots=True)
class Table:
    """A table, in the report and as `<name>.csv`.

    Attributes:
        name: Unique in the report, in snake case.
        title: Its caption.
        columns: Its columns; the first one names the rows.
        rows: As many cells each as there are columns.
        note: What stands below it; empty for nothing.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def __post_init__(self) -> None:
        if not self.columns:
            raise ValueError(f"the table {self.name} has no column")
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"the table {self.name} has {len(self.columns)} columns, and not the row {row}")


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure, in the report and as `<name>.svg` and `<name>.png`.

    Attributes:
        name: Unique in the report, in snake case.
        title: Its caption.
        alt: What it shows, in a sentence or two with the main numbers, for whoever cannot see it.
        size: Width and height in inches; a page is 7.2 inches wide.
        fill: Draws into an empty matplotlib figure.
    """

    name: str
    title: str
    alt: str
    size: tuple[float, float]
    fill: Callable[["Canvas"], None]


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure that is SVG already, as `<name>.svg`.

    Attributes:
        name: Unique in the report, in snake case.
        title: Its caption.
        alt: As of a `Figure`.
        svg: The whole document.
    """

    name: str
    title: str
    alt: str
    svg: str


@dataclass(frozen=True, slots=True)
class Statement:
    """What is said in place of a number, because the data do not determine it.

    Attributes:
        subject: What was to be computed.
        reason: Why it was not, naming the numbers that stand in the way.
    """

    subject: str
    reason: str


Verdict = Literal["holds", "doubtful", "violated", "not checkable", "by design"]


@dataclass(frozen=True, slots=True)
class Assumption:
    """What a test takes for granted, and what the data say to it.

    Attributes:
        test: The test.
        assumes: The assumption, in a sentence.
        check: How it was checked, with the numbers found.
        verdict: What came of it.
    """

    test: str
    assumes: str
    check: str
    verdict: Verdict


Block: TypeAlias = str | Table | Figure | Drawing | Statement
"""A paragraph in plain text, or something to look at."""


@dataclass(frozen=True, slots=True)
class Section:
    """A section of the report.

    Attributes:
        name: Its anchor, in snake case and unique.
        title: Its heading.
        blocks: In the order in which they are read.
        assumptions: Of the tests in it.
    """

    name: str
    title: str
    blocks: tuple[Block, ...]
    assumptions: tuple[Assumption, ...] = ()
