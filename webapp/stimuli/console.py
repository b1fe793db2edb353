"""A build as a terminal shows it: its progress while it runs, its report at the end."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Literal

from rich import box
from rich.console import Console, Group, RenderableType
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from webapp.stimuli.agents import ReportProgress
from webapp.stimuli.build import Built

_COLUMNS: tuple[tuple[str, Literal["left", "right"]], ...] = (
    ("layout", "left"),
    ("path", "right"),
    ("subgoals", "left"),
    ("key points", "left"),
    ("off by", "right"),
    ("episodes", "right"),
    ("steps", "right"),
    ("seconds", "right"),
)


@contextmanager
def shown_progress(console: Console) -> Iterator[ReportProgress]:
    """Show a bar for each stage of a build as it is reported; nothing before the first."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    bars = Progress(*columns, console=console)
    tasks: dict[str, TaskID] = {}

    def report(stage: str, done: float) -> None:
        if stage not in tasks:
            bars.start()
            tasks[stage] = bars.add_task(stage, total=1.0)
        bars.update(tasks[stage], completed=done)

    try:
        yield report
    finally:
        if tasks:
            bars.stop()


def render_report(built: Built) -> RenderableType:
    """Lay out what came of a build: a line for each layout, and where the bundle is."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for heading, justify in _COLUMNS:
        table.add_column(heading, justify=justify, no_wrap=True)
    for report in built.reports:
        seconds = built.seconds.get(report.layout)
        table.add_row(
            report.layout,
            str(report.num_steps),
            _listed(report.subgoals),
            "; ".join(_listed(steps) for steps in report.key_points.values()),
            f"{report.max_difference:.0e}",
            _number(report.training.get("num_episodes")),
            _number(report.training.get("num_steps")),
            "" if seconds is None else f"{seconds:.1f}",
        )
    note = "“off by”: the importance in the learned world model differs from the exact table's by at most this much."
    outcome = "Built" if built.is_new else "Nothing has changed since it was built:"
    catalogue = built.catalogue
    summary = f"{outcome} study {catalogue.study.name}, {len(catalogue.digests)} pictures, version {catalogue.version}"
    return Group(table, note, summary)


def _listed(steps: Sequence[int]) -> str:
    return " ".join(str(step) for step in steps)


def _number(value: object) -> str:
    return "" if value is None else f"{value:,}"
