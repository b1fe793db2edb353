"""A power run as a terminal shows it: how far it is, and what is needed."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby

import pandas as pd
from rich import box
from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from webapp.power.settings import PAPER_PARTICIPANTS, PowerSettings
from webapp.power.simulation import ReportStudies
from webapp.power.summary import REQUIRED_HEADINGS, power_cells, required_cells


@contextmanager
def shown_studies(console: Console) -> Iterator[ReportStudies]:
    """Show on a terminal how much is simulated and how long it still takes."""
    columns = (TextColumn("simulating"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    times = (TextColumn("left"), TimeRemainingColumn(elapsed_when_finished=False))
    with Progress(*columns, *times, console=console, disable=not console.is_terminal) as bars:
        task = bars.add_task("simulating", total=None)
        yield lambda done, total: bars.update(task, completed=done, total=total)


def required_table(required: pd.DataFrame, settings: PowerSettings) -> RenderableType:
    """Lay out the required numbers of participants."""
    return _table(
        f"Required participants for a power of {settings.power:g}, by step of Holm's correction",
        required_cells(required, settings),
    )


def paper_table(power: pd.DataFrame) -> RenderableType | None:
    """Lay out the power with the paper's number of participants; None if it was not simulated."""
    cells = power_cells(power, PAPER_PARTICIPANTS)
    return _table(f"Power with the paper's {PAPER_PARTICIPANTS} participants", cells) if cells else None


def _table(title: str, cells: list[tuple[str, ...]]) -> Table:
    """Lay out a line per effect, and beside the lines of a contrast what it is."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, title=title, title_justify="left")
    for heading in ("experiment: contrast, items", *REQUIRED_HEADINGS[3:]):
        table.add_column(heading)
    for (experiment, items, contrast), rows in groupby(cells, key=lambda row: row[:3]):
        columns = zip(*(row[3:] for row in rows), strict=True)
        table.add_row(f"{experiment}: {contrast}\n{items}", *("\n".join(column) for column in columns))
    return table
