"""A report as one HTML file that loads nothing: text, tables, figures and style are inside, and no script is needed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count, groupby
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from webapp.reports.blocks import Block, Column, Drawing, Figure, Section, Statement, Table
from webapp.reports.figures import as_address
from webapp.reports.formatting import NOTHING, shown
from webapp.reports.report import Report

_WIDE, _WIDER = 7, 10
"""From so many columns on, a table is set smaller on paper, and smaller still."""

_STYLE = "<!-- style -->"

BULLET = "\N{BULLET}"
"""Begins a line of a list, in a block of text."""

_PIXELS_PER_INCH, _DRAWING_WIDTH = 112, 860

_SHORT = 24
"""Tables of up to so many rows stay on one page."""

_NUMBERS = {"count", "number", "p", "percent"}

_BRIEF = 18
"""Columns whose texts have up to so many characters do not break them."""

_STACKED = frozenset({"summary"})
"""Tables whose rows are stacked on phones, so that each can be read without scrolling."""


@dataclass(frozen=True, slots=True)
class _Shown:
    """A block as a template of its kind takes it.

    Attributes:
        template: Its file's name.
        anchor: Unique in the page; empty if nothing leads to it.
        label: `Table 3`, or nothing.
        content: The block.
        more: What else the template needs.
    """

    template: str
    anchor: str
    label: str
    content: object
    more: Mapping[str, object]


def render(report: Report, drawings: Mapping[str, bytes]) -> bytes:
    """Return the report's HTML.

    Args:
        report: What to show.
        drawings: By each figure's name, its SVG.
    """
    resources = _resources()
    templates = Environment(
        loader=FileSystemLoader(resources / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    style = (resources / "static/css/analysis.css").read_text(encoding="utf-8")
    numbers = {Table: count(1), Figure: count(1), Drawing: count(1)}
    numbers[Drawing] = numbers[Figure]
    page = templates.get_template("analysis/report.html").render(
        report=report,
        sections=[
            (section, [_shown(block, numbers, drawings) for block in section.blocks], _assumptions(section))
            for section in report.sections
        ],
    )
    # No template may hold styles, because those of the participants may not. Texts are escaped by now, so that the
    # comment is the template's own.
    return page.replace(_STYLE, f"<style>\n{style}</style>", 1).encode()


def _shown(block: Block, numbers: Mapping[type, "count[int]"], drawings: Mapping[str, bytes]) -> _Shown:
    match block:
        case str():
            return _Shown("text", "", "", _pieces(block.strip()), {})
        case Statement():
            return _Shown("statement", "", "", block, {})
        case Table():
            label = f"Table {next(numbers[Table])}"
            return _Shown("table", f"table-{block.name}", label, block, _table(block))
        case _:
            label = f"Figure {next(numbers[type(block)])}"
            more = {"address": as_address(drawings[block.name]), "width": _width(block)}
            return _Shown("figure", f"figure-{block.name}", label, block, more)


def _pieces(text: str) -> list[tuple[str, list[str]]]:
    """Return the paragraphs and lists of a text: lines with bullets are a list, other lines keep their line breaks."""
    runs = [
        (is_list, list(lines)) for is_list, lines in groupby(text.splitlines(), lambda line: line.startswith(BULLET))
    ]
    if not any(is_list for is_list, _ in runs):
        return [("lines" if "\n" in text else "paragraph", [text])]
    return [
        ("list" if is_list else "paragraph", [line.removeprefix(BULLET).strip() for line in lines])
        for is_list, lines in runs
    ]


def _table(table: Table) -> Mapping[str, object]:
    num_columns, classes = len(table.columns), []
    if num_columns >= _WIDE:
        classes.append("table--wider" if num_columns >= _WIDER else "table--wide")
    if len(table.rows) <= _SHORT:
        classes.append("table--short")
    is_stacked = table.name in _STACKED
    if is_stacked:
        classes.append("table--stacked")
    rows = [[shown(cell, column) for cell, column in zip(row, table.columns, strict=True)] for row in table.rows]
    headings = [
        (column.name, _look(column, [row[place] for row in rows]), column.heading)
        for place, column in enumerate(table.columns)
    ]
    return {
        "classes": " ".join(["table", *classes]),
        "headings": headings,
        "rows": [list(zip(headings, row, strict=True)) for row in rows],
        "is_stacked": is_stacked,
        "nothing": NOTHING,
    }


def _look(column: Column, cells: Sequence[str]) -> str:
    """Return the classes of a column's cells."""
    if column.kind in _NUMBERS:
        return "number"
    return "text brief" if all(len(cell) <= _BRIEF for cell in cells) else "text"


def _assumptions(section: Section) -> Mapping[str, object]:
    """Return the assumptions, each with the class of its verdict, and the classes of their table; empty without any."""
    if not section.assumptions:
        return {}
    rows = [(each, each.verdict.replace(" ", "-")) for each in section.assumptions]
    short = " table--short" if len(rows) <= _SHORT // 2 else ""
    return {"rows": rows, "classes": f"table table--assumptions{short}"}


def _width(block: Figure | Drawing) -> int:
    """Return how many pixels of a page a figure is wide; a little more than on paper, as screens are further away."""
    return round(block.size[0] * _PIXELS_PER_INCH) if isinstance(block, Figure) else _DRAWING_WIDTH


def _resources() -> Path:
    """Return the folder of `templates` and `static`: within the package if installed, else beside it."""
    package = Path(__file__).parents[1]
    return package if (package / "templates").is_dir() else package.parent
