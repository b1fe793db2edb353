"""A build as a terminal shows it: its progress while it runs, its report at the end."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Literal

from rich import box
from rich.console import Console, Group, RenderableType
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from webapp.stimuli.agents import ReportProgress
from webapp.stimuli.build import Built
from webapp.stimuli.report import LayoutReport
from webapp.study.protocol import Experiment, Study

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
    """Lay out what came of a build: a line for each layout, how many pictures are shown, and where the bundle is."""
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
    tables = [_pictures(experiment, built.reports) for experiment in catalogue.study.experiments]
    remarks: list[RenderableType] = [
        *_coinciding(built.reports),
        *_planned(built.reports),
        *_unvalidated(catalogue.study),
    ]
    return Group(table, note, *tables, *remarks, summary)


def _pictures(experiment: Experiment, reports: Sequence[LayoutReport]) -> Table:
    """Lay out how many pictures each kind shows of each layout; a range where that depends on draw or participant."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column(f"pictures in experiment {experiment.id}", no_wrap=True)
    for layout in experiment.layouts:
        table.add_column(layout, justify="right")
    by_layout = {report.layout: report for report in reports}
    shown = [by_layout[layout] for layout in experiment.layouts]
    for kind in experiment.kinds:
        table.add_row(kind, *(_num_pictures(report, experiment.id, kind) for report in shown))
    return table


def _num_pictures(report: LayoutReport, experiment: str, kind: str) -> str:
    fewest, most = report.pictures[experiment][kind]
    number = str(fewest) if fewest == most else f"{fewest}-{most}"
    return f"= {number}" if kind in report.arms_like_subgoals[experiment] else number


def _coinciding(reports: Sequence[LayoutReport]) -> list[str]:
    if not any(kinds for report in reports for kinds in report.arms_like_subgoals.values()):
        return []
    return ["“=”: the arm happens to choose the very steps that are the subgoals, so nothing is compared there."]


def _planned(reports: Sequence[LayoutReport]) -> list[str]:
    planned = ", ".join(report.layout for report in reports if report.training.get("agent") == "planner")
    return [f"{planned}: nothing was trained; the agent is the exact planner."] if planned else []


def _unvalidated(study: Study) -> list[Text]:
    wish = "rating items are an unvalidated translation; [translations.{}] back_translation cites one"
    return [
        Text(f"{language}: {wish.format(language)}")  # As it stands: brackets are no markup here.
        for language in study.languages
        if study.validation(language) == "unvalidated"
    ]


def _listed(steps: Sequence[int]) -> str:
    return " ".join(str(step) for step in steps)


def _number(value: object) -> str:
    return "" if value is None else f"{value:,}"
