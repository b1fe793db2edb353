"""A rehearsal as a terminal shows it."""

from collections.abc import Iterator, Sequence
from itertools import groupby

from rich import box
from rich.console import RenderableType
from rich.markup import escape
from rich.table import Table as RichTable

from webapp.rehearsal.beside_ratings import Shown
from webapp.rehearsal.verdicts import Verdict
from webapp.reports.blocks import Cell, Column, Table
from webapp.reports.formatting import MINUS, number, p_value, shown

_GOOD = ("recovered", "quiet", "kept")
_NEITHER = ("cautious", "nothing promised")
_LEAST_WIDTH = 17
_POINTS = (
    "Planted are the points that an effect D makes on average: rounding and the ends of the scale take a little off. "
    "A difference is inside the margin if its 90 % interval is."
)


def verdicts_beside_effects(verdicts: Sequence[Verdict]) -> RenderableType:
    """Lay out a line for each planned test, those of a contrast together."""
    told = _table("Planted and found d, with simultaneous intervals and p by Holm")
    told.add_column("contrast", overflow="fold", min_width=_LEAST_WIDTH)
    told.add_column("item", overflow="fold")
    for heading in ("planted", "found", "p"):
        told.add_column(heading, justify="right", no_wrap=True)
    told.add_column("verdict", no_wrap=True)
    for contrast, group in groupby(verdicts, key=lambda verdict: verdict.contrast):
        tests = list(group)
        lines = (
            [f"{contrast.experiment}: {contrast.first}", f"{MINUS} {contrast.second}"],
            [test.item for test in tests],
            [f"{test.planted:g}".replace("-", MINUS) for test in tests],
            [_with_interval(test.d, test.low, test.high) for test in tests],
            ["" if test.p_holm is None else p_value(test.p_holm) for test in tests],
            [_coloured(test.word) for test in tests],
        )
        told.add_row(*("\n".join(column) for column in lines))
    return told


def shown_beside(found: Sequence[Shown]) -> Iterator[RenderableType]:
    """Lay out what is shown beside the planned tests, a table for each thing that it is of."""
    for what, group in groupby(found, key=lambda each: each.what):
        told = _table(f"{what[0].upper()}{what[1:]}, for orientation")
        told.add_column("of", overflow="fold", min_width=_LEAST_WIDTH)
        for heading in ("planted", "found"):
            told.add_column(heading, justify="right", no_wrap=True)
        told.add_column("note", overflow="fold")
        if what == "difference in points":
            told.caption, told.caption_justify = _POINTS, "left"
        for each in group:
            told.add_row(
                f"{each.experiment}: {each.name}",
                number(each.planted),
                _with_interval(each.found, each.low, each.high),
                each.note,
            )
        yield told


def rendered(table: Table) -> RenderableType:
    """Lay out a table of a report."""
    told = _table(table.title)
    for column in table.columns:
        is_text = column.kind == "text"
        told.add_column(column.heading, justify="left" if is_text else "right", overflow="fold", no_wrap=not is_text)
    for row in table.rows:
        told.add_row(*(_cell(cell, column) for cell, column in zip(row, table.columns, strict=True)))
    return told


def _table(title: str) -> RichTable:
    return RichTable(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, title=title, title_justify="left")


def _with_interval(value: float | None, low: float | None, high: float | None) -> str:
    if value is None:
        return ""
    if low is None or high is None:
        return number(value)
    return escape(f"{number(value)} [{number(low)}, {number(high)}]")


def _cell(cell: Cell, column: Column) -> str:
    text = shown(cell, column)
    return _coloured(text) if column.name == "verdict" else text


def _coloured(word: str) -> str:
    if word in _NEITHER:
        return word
    return f"[{'green' if word in _GOOD else 'bold red'}]{word}[/]"
