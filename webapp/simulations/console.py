"""A sweep as a terminal shows it: how many runs are done and how long it still takes, and at the end the claims."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta

import pandas as pd
from rich import box
from rich.console import Console, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from webapp.simulations.claims import overall
from webapp.simulations.sweeps import ReportRuns


@contextmanager
def shown_runs(console: Console) -> Iterator[ReportRuns]:
    """Show how many runs are done, the time since the start, and the time that is left.

    A terminal shows a bar; a log gets a line for each stack that is done.
    """
    columns = (TextColumn("learning"), BarColumn(), MofNCompleteColumn(), TextColumn("runs, elapsed"))
    times = (TimeElapsedColumn(), TextColumn("left"), _TimeLeft())
    with Progress(*columns, *times, console=console, disable=not console.is_terminal) as bars:
        task = bars.add_task("learning", total=None, at_first=None)

        def report(done: int, total: int) -> None:
            at_first = bars.tasks[task].fields["at_first"]
            bars.update(task, completed=done, total=total, at_first=done if at_first is None else at_first)
            if not console.is_terminal and at_first is not None:
                console.print(f"{done} of {total} runs are done, left: {time_left(bars.tasks[task])}")

        yield report


def time_left(task: Task) -> str:
    """Return the time left at the mean speed of this session, or `?` before the first stack is done.

    Stacks finish many runs at once, and seldom, so the speed of the last moments would say nothing.
    """
    new = task.completed - (task.fields["at_first"] or 0)
    if task.total is None or not new or task.elapsed is None:
        return "?"
    return str(timedelta(seconds=round(task.elapsed * (task.total - task.completed) / new)))


class _TimeLeft(ProgressColumn):
    """The time left, as hours, minutes and seconds."""

    def render(self, task: Task) -> Text:
        """Write it."""
        return Text(time_left(task))


def claims_table(claims: pd.DataFrame) -> RenderableType:
    """Lay out the claims of an experiment, one line each, whatever its kind.

    Claims on every estimator of importance are summed up: so many of them support it.
    """
    lines = _over_estimators(claims) if "estimator" in claims.columns else _with_counts(claims)
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    headings = [name for name in _HEADINGS if name in lines.columns]
    for name in headings:
        table.add_column(_HEADINGS[name], overflow="fold")
    for row in lines.to_dict("records"):
        table.add_row(*("" if pd.isna(row[name]) else str(row[name]) for name in headings))
    return table


def _with_counts(claims: pd.DataFrame) -> pd.DataFrame:
    """Say in one cell each what the paper's test found, and how many comparisons hold, do not, or are undecided."""
    tests = zip(claims["paper_test_agrees"], claims["paper_tests"], strict=True)
    counts = zip(*(claims[name] for name in ("holds", "does_not_hold", "undecided")), strict=True)
    return claims.assign(
        tested=[f"{agree} of {made}" for agree, made in tests], counts=["/".join(map(str, each)) for each in counts]
    )


def _over_estimators(claims: pd.DataFrame) -> pd.DataFrame:
    lines = []
    for (claim, importance), each in claims.groupby(["claim", "importance"], sort=False, dropna=False):
        verdicts = each["verdict"].dropna().tolist()
        supported = f"{verdicts.count('holds')} of {len(verdicts)}"
        verdict = overall(verdicts) if verdicts else ""
        lines.append({"claim": claim, "importance": importance, "estimators": supported, "verdict": verdict})
    return pd.DataFrame(lines)


_HEADINGS = {
    "statement": "claim",
    "claim": "claim",
    "source": "section",
    "variant": "variant",
    "importance": "importance",
    "estimators": "holds for",
    "tested": "paper's test",
    "counts": "yes/no/open",
    "verdict": "verdict",
}
