"""The stability of an explanation as text: a table of shares, and in plain sentences what holds and what flips."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from webapp.explainer.pictures.stability_names import FACTOR_NAMES, level_name, num_ways, percent
from webapp.explainer.stability import Change, Count, Level, Stability, StepStability
from webapp.explainer.variants import Factor

_QUIET, _SUBGOAL, _FLIPS = "dim", "green", "bold yellow"
_MOST_ELSEWHERE = 5
_BAR_WIDTH = 10
_UNBOUNDED = 10_000


@dataclass(frozen=True, slots=True)
class _Glyphs:
    """The characters to draw with.

    Attributes:
        levels: A share from none to all, one character each; the first stands for none and the last for all.
        bar: The fill of a bar.
        subgoal: Before a step that is a subgoal of the explanation.
        flips: Before the word at a step that flips.
    """

    levels: str
    bar: str
    subgoal: str
    flips: str


_UNICODE = _Glyphs(levels="·▁▂▃▄▅▆▇█", bar="█", subgoal="○", flips="▲")
_ASCII = _Glyphs(levels=".123456789#", bar="#", subgoal="o", flips="!")


@dataclass(frozen=True, slots=True)
class StabilityReport:
    """A stability, to be printed by a `rich` console of any width.

    It is plain text where the console has no colours, and ASCII where it knows no other characters. The table shows
    percentages where they fit, and else one character for each share.

    Attributes:
        stability: Of one path.
        title: The name of the map or world.
        subtitle: What was asked for, in a few words.
    """

    stability: Stability
    title: str
    subtitle: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        found, glyphs = self.stability, _ASCII if options.ascii_only else _UNICODE
        yield Text(self.title, style="bold")
        yield Text(self.subtitle, style=_QUIET)
        yield Text()
        yield Text(_tried(found))
        yield Text()
        if any(step.overall.count for step in found.steps):
            tables = [_percentages(found, glyphs, bars=True), _percentages(found, glyphs, bars=False)]
            free = options.update(max_width=_UNBOUNDED)
            fitting = [table for table in tables if Measurement.get(console, free, table).maximum <= options.max_width]
            yield fitting[0] if fitting else _characters(found, glyphs)
            yield Text()
            yield from (Text(line, style=_QUIET) for line in _legend(found, glyphs, in_characters=not fitting))
            yield Text()
        yield from (Text(line) for line in verdict(found))


def verdict(found: Stability) -> tuple[str, ...]:
    """Say in sentences which subgoals hold, what flips and by which choice, and what lies elsewhere."""
    return (
        *_holding(found),
        *(_flipping(step, found) for step in found.flipping),
        *_by_ties(found),
        *_elsewhere(found),
    )


def _tried(found: Stability) -> str:
    parts = []
    for factor, levels in groupby(found.levels, key=lambda level: level.factor):
        names = [level_name(level, found.settings, full=True) for level in levels]
        parts.append(names[0] if factor in ("ties", "tie average") else f"{FACTOR_NAMES[factor]} {_listed(names)}")
    varied = f": {'; '.join(parts)}" if parts else ""
    return f"A path of {len(found.steps)} steps, explained in {num_ways(found)}{varied}."


def _percentages(found: Stability, glyphs: _Glyphs, *, bars: bool) -> Table:
    table = _table(padding=2 if bars else 1)
    table.add_column(f"in {num_ways(found)}" if bars else " all", no_wrap=True)
    for level in found.levels:
        table.add_column(level_name(level, found.settings), justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for step in _ever_subgoals(found):
        shares = [Text(percent(count), style=_QUIET if not count.count else "") for count in step.by_level]
        bar = f" {glyphs.bar * round(step.overall.share * _BAR_WIDTH)}" if bars else ""
        table.add_row(*_named(step, glyphs), f"{percent(step.overall):>4}{bar}", *shares, _mark(step, glyphs))
    return table


def _characters(found: Stability, glyphs: _Glyphs) -> Table:
    table = _table(padding=2)
    table.add_column("all", justify="right", no_wrap=True)
    factors = [(factor, list(levels)) for factor, levels in groupby(found.levels, key=lambda level: level.factor)]
    for factor, _ in factors:
        table.add_column(_SHORT_FACTORS[factor])
    table.add_column("", no_wrap=True)
    for step in _ever_subgoals(found):
        counts = iter(step.by_level)
        cells = ["".join(_character(next(counts), glyphs) for _ in levels) for _, levels in factors]
        table.add_row(*_named(step, glyphs), percent(step.overall), *cells, _mark(step, glyphs))
    return table


_SHORT_FACTORS: dict[Factor, str] = {
    "importance": "imp.",
    "random actions": "r",
    "threshold": "thr.",
    "ties": "ties",
    "tie average": "avg",
    "training seed": "seeds",
}


def _table(padding: int) -> Table:
    table = Table(box=None, padding=(0, padding, 0, 0), pad_edge=False, header_style=_QUIET)
    table.add_column("step", justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    table.add_column("action", no_wrap=True)
    return table


def _ever_subgoals(found: Stability) -> Iterator[StepStability]:
    return (step for step in found.steps if step.overall.count)


def _named(step: StepStability, glyphs: _Glyphs) -> tuple[str, Text, str]:
    return str(step.step), Text(glyphs.subgoal if step.is_subgoal else "", style=_SUBGOAL), step.action


def _mark(step: StepStability, glyphs: _Glyphs) -> Text:
    return Text(f"{glyphs.flips} flips", style=_FLIPS) if step.flips else Text("holds" if step.is_subgoal else "")


def _character(count: Count, glyphs: _Glyphs) -> str:
    """Choose the character of a share: that of none and of all stand for nothing else."""
    top = len(glyphs.levels) - 1
    if count.count in (0, count.total):
        return glyphs.levels[top if count.count else 0]
    return glyphs.levels[min(top - 1, 1 + int(count.share * (top - 1)))]


def _legend(found: Stability, glyphs: _Glyphs, *, in_characters: bool) -> Iterator[str]:
    never = sum(not step.overall.count for step in found.steps)
    if never:
        yield f"{never} of {len(found.steps)} steps are never a subgoal and are left out."
    if in_characters:
        for factor, levels in groupby(found.levels, key=lambda level: level.factor):
            if factor not in ("ties", "tie average"):
                names = ", ".join(level_name(level, found.settings) for level in levels)
                yield f"{_SHORT_FACTORS[factor]}: {names}, one character each."
        scale = f"{glyphs.levels[0]} none, {glyphs.levels[1]} to {glyphs.levels[-2]} some, {glyphs.levels[-1]} all"
        yield f"A character is the share of ways in which the step is a subgoal: {scale}."
    else:
        yield "Per cent of the ways in which the step is a subgoal, all else varied."
    yield f"{glyphs.subgoal}: a subgoal of the explanation, which is: {found.settings}."
    yield (
        f"{glyphs.flips} flips: one choice alone, or several at once, turn the step from a subgoal into none, or back, "
        f"in more than {found.settings.tolerance:.0%} of the ways."
    )


def _holding(found: Stability) -> Iterator[str]:
    if len(found.variants) == 1:
        yield "Nothing was tried beside the explanation itself."
        return
    subgoals = [step for step in found.steps if step.is_subgoal]
    if not subgoals:
        yield "The explanation has no subgoals."
    else:
        holding = [step for step in subgoals if not step.flips]
        subgoal = "1 subgoal" if len(subgoals) == 1 else f"{len(subgoals)} subgoals"
        head = f"{len(holding) or 'None'} of {subgoal} {'hold' if len(holding) > 1 else 'holds'}"
        if not holding:
            yield f"{head}."
        elif all(step.overall.count == step.overall.total for step in holding):
            yield f"{head} in all {num_ways(found)}: {_listed([_step(step) for step in holding])}."
        else:
            shares = [f"{_step(step)} in {percent(step.overall)}%" for step in holding]
            yield f"{head} in nearly all of {num_ways(found)}: {_listed(shares)}."
    together = [_step(step) for step in subgoals if step.flips and step.flips[0].factor is None]
    if together:
        more = "1 more holds" if len(together) == 1 else f"{len(together)} more hold"
        yield f"As long as only one choice differs, {more}: {_listed(together)}."
    if not any(step.flips and not step.is_subgoal for step in found.steps):
        yield "No other step flips."


def _flipping(step: StepStability, found: Stability) -> str:
    what, turned = ("a subgoal", "none") if step.is_subgoal else ("no subgoal", "one")
    causes = _listed([_cause(flip, found) for flip in step.flips])
    return f"{_step(step).capitalize()}, {what}, flips: it is {turned} {causes}."


def _cause(flip: Change, found: Stability) -> str:
    count, total = flip.differing.count, flip.differing.total
    if flip.factor is None:
        return f"where several choices differ at once ({count} of {total} ways, {percent(flip.differing)}%)"
    if flip.factor == "ties":
        return f"with ties broken otherwise in {_sampled(flip.differing)}"
    if flip.factor == "tie average":
        return "with all tied actions equally likely"
    names = [level_name(Level(flip.factor, value, ()), found.settings, full=True) for value in flip.values]
    return f"with {FACTOR_NAMES[flip.factor]} {_listed(names)} ({count} of {total} other ways)"


def _by_ties(found: Stability) -> Iterator[str]:
    """Say how the subgoals stand when only ties are broken otherwise, with an interval because the draws are random."""
    staying: dict[Count, list[str]] = {}
    for step in found.steps:
        for change in step.changes:
            if step.is_subgoal and change.factor == "ties":
                differing = change.differing
                staying.setdefault(Count(differing.total - differing.count, differing.total), []).append(str(step.step))
    if staying:
        parts = [f"{_listed(steps)} in {_sampled(count)}" for count, steps in staying.items()]
        yield f"Where only ties are broken otherwise, subgoals stay as follows: step {'; step '.join(parts)}."


def _sampled(count: Count) -> str:
    low, high = count.interval
    return f"{count.count} of {count.total} draws (95% interval {low:.0%} to {high:.0%})"


def _elsewhere(found: Stability) -> Iterator[str]:
    if not found.elsewhere:
        return
    names = [f"{action} in {_label(state)} ({count.count})" for (state, action), count in found.elsewhere]
    more = len(names) - _MOST_ELSEWHERE
    shown = names[:_MOST_ELSEWHERE] + ([f"{more} more"] if more > 0 else [])
    yield f"Subgoals that are not on this path, and in how many ways: {_listed(shown)}."


def _step(step: StepStability) -> str:
    return f"step {step.step} ({step.action})"


def _label(state: Hashable) -> str:
    return f"({', '.join(map(str, state))})" if isinstance(state, tuple) else str(state)


def _listed(names: Sequence[str]) -> str:
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)
