"""A comparison of selectors as text: one table of what each chooses, one of its curve over the budget."""

import sys
from dataclasses import dataclass
from itertools import groupby

from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from webapp.explainer.comparison import SOURCES, Comparison, Measure, Rating

_QUIET, _OURS = "dim", "bold green"
_NARROWEST_CURVE = 10
_SMALLEST_SHOWN = 0.0005
_UNICODE_LEVELS, _ASCII_LEVELS = "▁▂▃▄▅▆▇█", "_.:-=+*#"


@dataclass(frozen=True, slots=True)
class ComparisonReport:
    """A comparison, to be printed by a `rich` console of any width.

    Attributes:
        comparison: Of the selectors on one path.
        title: The name of the map.
        subtitle: What was asked for, in a few words.
    """

    comparison: Comparison
    title: str
    subtitle: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        comparison = self.comparison
        steps = ", ".join(map(str, comparison.subgoals)) or "none"
        yield Text(_printable(self.title, options), style="bold")
        yield Text(_printable(self.subtitle, options), style=_QUIET)
        yield Text()
        yield Text(
            f"A path of {_counted(comparison.path.num_steps)}. Subgoals of the paper: {steps}. "
            f"Every selector chooses k = {comparison.budget}."
        )
        yield Text()
        yield from self._choices(console, options)
        yield Text()
        yield from (Text(_printable(line, options), style=_QUIET) for line in self._legend())
        yield Text()
        yield self._curves(_ASCII_LEVELS if options.ascii_only else _UNICODE_LEVELS)
        yield from (Text(line, style=_QUIET) for line in self._why_none())
        yield Text()
        sources = "; ".join(f"{name}: {source}" for name, source in SOURCES.items())
        yield Text(f"Sources. {sources}.", style=_QUIET)

    def _choices(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield one table if it fits; else the steps below it, and at the narrowest each error below its mean."""
        plus_minus = "+-" if options.ascii_only else "±"
        whole = self._numbers(f" {plus_minus}", with_steps=True)
        if _fits(whole, console, options):
            yield whole
            return
        numbers = self._numbers(f" {plus_minus}", with_steps=False)
        yield numbers if _fits(numbers, console, options) else self._numbers(f"\n{plus_minus}", with_steps=False)
        yield Text()
        yield self._steps()

    def _numbers(self, plus_minus: str, *, with_steps: bool) -> Table:
        table = _table()
        table.add_column("selector", no_wrap=True, overflow="crop")
        if with_steps:
            table.add_column("steps", no_wrap=True, overflow="crop")
        for name in ("overlap", "fidelity", "drop", "ms"):
            table.add_column(name, justify="right", no_wrap=True, overflow="crop")
        for rating in self.comparison.ratings:
            table.add_row(
                rating.selector,
                *([_steps(rating)] if with_steps else []),
                _overlap(rating, self.comparison.budget),
                _number(rating.fidelity, plus_minus),
                _number(rating.drop, plus_minus),
                f"{rating.seconds * 1000:.1f}",
                style=_style(rating),
            )
        return table

    def _steps(self) -> Table:
        table = _table()
        table.add_column("selector", no_wrap=True, overflow="crop")
        table.add_column("steps", overflow="fold")
        for rating in self.comparison.ratings:
            table.add_row(rating.selector, _steps(rating), style=_style(rating))
        return table

    def _legend(self) -> list[str]:
        comparison = self.comparison
        facts = next(rating for rating in comparison.ratings if rating.selector == "landmark facts")
        chosen = [
            f"step {step} {why}"
            for step, why in zip(facts.steps or (), facts.reasons, strict=True)
            if step not in facts.fillers
        ]
        fidelity = (
            f"fidelity: probability of reaching the goal within {comparison.horizon} actions when the policy is "
            "followed at the chosen steps only, random actions elsewhere."
        )
        brackets = "in brackets: filled up to k; the method names no such step."
        return [
            *([brackets] if any(rating.fillers for rating in comparison.ratings) else []),
            "overlap: chosen steps that are subgoals of the paper.",
            fidelity,
            f"drop: how much it falls from {comparison.policy_fidelity:.3g} when just the chosen steps act at random.",
            f"landmark facts chosen: {'; '.join(chosen) or 'none'}.",
            *(f"{rating.selector}: {rating.note}." for rating in comparison.ratings if rating.note),
        ]

    def _why_none(self) -> list[str]:
        """Say why equation 1 has no solution, for the selectors where it has none."""
        comparison = self.comparison
        unmet = [rating for rating in comparison.ratings if rating.smallest is None]
        if not unmet:
            return []
        alpha, own = f"{comparison.alpha:g}", f"{comparison.policy_fidelity:.3g}"
        within = f"reaches the goal within {comparison.horizon} actions with probability {own}"
        if comparison.policy_fidelity <= comparison.alpha:
            return ["", f"none: the policy, followed everywhere, {within}; even that does not exceed {alpha}."]
        everything = f"k = {comparison.path.num_steps} gives {unmet[0].curve[-1].value:.3g}"
        return ["", f"none: {everything}, no more than {alpha}; the policy, followed off the path too, {within}."]

    def _curves(self, levels: str) -> Table:
        table = _table()
        num_steps, alpha, scale = self.comparison.path.num_steps, self.comparison.alpha, self.comparison.scale
        table.add_column("selector", no_wrap=True, overflow="crop")
        table.add_column(f"fidelity (0 to {scale:.3g}) for k = 0 to {num_steps}", overflow="fold")
        table.add_column(f"first k above {alpha:g}", justify="right", no_wrap=True, overflow="crop")
        for rating in self.comparison.ratings:
            values = tuple(measure.value / scale for measure in rating.curve)
            smallest = "none" if rating.smallest is None else str(rating.smallest)
            table.add_row(rating.selector, _Curve(values, levels), smallest, style=_style(rating))
        return table


@dataclass(frozen=True, slots=True)
class _Curve:
    """Numbers from 0 to 1 as a row of bars; where there is no room for all, evenly spaced ones with both ends."""

    values: tuple[float, ...]
    levels: str

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(min(_NARROWEST_CURVE, len(self.values)), len(self.values))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        last = len(self.values) - 1
        width = min(options.max_width, len(self.values))
        shown = [self.values[round(place * last / max(1, width - 1))] for place in range(width)]
        top = len(self.levels) - 1
        yield Segment("".join(self.levels[min(top, int(value * len(self.levels)))] for value in shown))
        yield Segment.line()


def _table() -> Table:
    return Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style=_QUIET)


def _fits(table: Table, console: Console, options: ConsoleOptions) -> bool:
    return Measurement.get(console, options.update(max_width=sys.maxsize), table).maximum <= options.max_width


def _steps(rating: Rating) -> Text:
    if rating.steps is None:
        return Text("mean of draws", style=_QUIET)
    runs = groupby(rating.steps, key=lambda step: step in rating.fillers)
    texts = [(filled, ", ".join(map(str, run))) for filled, run in runs]
    return Text(", ".join(f"({text})" if filled else text for filled, text in texts))


def _counted(num_steps: int) -> str:
    return "1 step" if num_steps == 1 else f"{num_steps} steps"


def _style(rating: Rating) -> str:
    return _OURS if rating.selector == "subgoals" else ""


def _overlap(rating: Rating, budget: int) -> str:
    exact = rating.overlap.standard_error is None
    return f"{rating.overlap.value:.0f} of {budget}" if exact else f"{rating.overlap.value:.1f} of {budget}"


def _number(measure: Measure, plus_minus: str) -> str:
    value = _shown(measure.value)
    return value if measure.standard_error is None else f"{value}{plus_minus}{_shown(measure.standard_error)}"


def _shown(value: float) -> str:
    """Write three decimals, or the magnitude of what they would show as nothing."""
    if value == 0:
        return "0.000"  # Never -0.000.
    return f"{value:.3f}" if abs(value) >= _SMALLEST_SHOWN else f"{value:.0e}"


def _printable(text: str, options: ConsoleOptions) -> str:
    """Write what the terminal has no letters for as escapes: a state's label or a map's name may hold anything."""
    return text.encode("ascii", "backslashreplace").decode() if options.ascii_only else text
