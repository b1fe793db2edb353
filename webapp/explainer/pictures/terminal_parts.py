"""What every explanation in a terminal is made of: its glyphs, the table of its importance, and its summary."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.segment import Segment
from rich.style import Style
from rich.table import Table
from rich.text import Text

from webapp.explainer.explanation import Explanation, certain
from webapp.explainer.key_points import roll_out
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import World

ASKED, QUIET = "bold magenta", "dim"
MARK_STYLES = {"subgoal": "green", "key point": "yellow", "explanation": "bold yellow"}
_BAR = "cyan"
_SHORTEST_BAR, _NARROWEST_BAR, _WIDEST_BAR = 4, 10, 50
_SMALLEST_SHOWN = 0.0005
_WORDS = 30
"""So wide a column in words should be at least."""
_LEVELS = {"mean": "mean", "top-k": "top k", "largest-gap": "largest gap"}


@dataclass(frozen=True, slots=True)
class Glyphs:
    """The characters to draw with.

    Attributes:
        arrows: The agent and its steps, by heading: right, down, left, up.
        wall: Two characters, one map cell wide.
        floor: One character.
        eighths: A bar's last character, from empty to full.
        tick: Where the threshold crosses a bar.
        marks: A sign for each name in the last column of the table.
        plus_minus: Between a number and its standard error.
    """

    arrows: str
    wall: str
    floor: str
    eighths: str
    tick: str
    marks: dict[str, str]
    plus_minus: str


UNICODE = Glyphs(
    arrows="→↓←↑",
    wall="██",
    floor="·",
    eighths=" ▏▎▍▌▋▊▉█",
    tick="┊",
    marks={"subgoal": "○", "key point": "●", "explanation": "★"},
    plus_minus="±",
)
ASCII = Glyphs(
    arrows=">v<^",
    wall="##",
    floor=".",
    eighths=" #",
    tick="|",
    marks={"subgoal": "o", "key point": "*", "explanation": "!"},
    plus_minus="+-",
)


def importance_table(
    explanation: Explanation,
    actions: Sequence[str],
    headings: Mapping[str, bool],
    cells: Callable[[int], Sequence[str]],
    glyphs: Glyphs,
    width: int,
) -> Table:
    """Draw up the path with one row per state: where, which action, how important, and what it is.

    Args:
        explanation: What is shown.
        actions: The names of the world's actions.
        headings: Of the columns that say where the agent is, and whether what they say is in words, which may wrap.
        cells: What to write into these columns, for a step from 1 to T + 1.
        glyphs: What to draw with.
        width: In characters. Where there is little room, the bars give way.
    """
    low, high = scale(explanation)
    has_bars = width - _width_without_bars(explanation, actions, headings, cells) >= _SHORTEST_BAR
    # An ellipsis would be no ASCII, so what has no room is cropped or folded.
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style=QUIET, width=width if has_bars else None)
    table.add_column("step", justify="right", no_wrap=True, overflow="crop")
    for heading, in_words in headings.items():
        table.add_column(heading, no_wrap=not in_words, overflow="fold", ratio=2 if in_words and has_bars else None)
    table.add_column("action", no_wrap=has_bars, overflow="fold")
    table.add_column("importance", justify="right", no_wrap=True, overflow="crop")
    if has_bars:
        legend = f"{low:g} to {high:g}, {glyphs.tick} {_LEVELS[explanation.rule]}"
        table.add_column(legend, overflow="fold", ratio=1)
    table.add_column("", no_wrap=True, overflow="crop")
    path = explanation.path
    for step in range(1, len(path.states) + 1):
        mark = mark_of(explanation, step)
        value = float(explanation.importance.values[step - 1])
        table.add_row(
            str(step) if step <= path.num_steps else "",
            *cells(step),
            actions[path.actions[step - 1]] if step <= path.num_steps else Text("goal", style=QUIET),
            _number(explanation, step, glyphs),
            *([Bar((value - low) / (high - low), (explanation.threshold - low) / (high - low), glyphs)] * has_bars),
            Text(f"{glyphs.marks[mark]} {mark}", style=MARK_STYLES[mark]) if mark else Text(),
            style=MARK_STYLES[mark] if mark else "",
        )
    return table


def _width_without_bars(
    explanation: Explanation,
    actions: Sequence[str],
    headings: Mapping[str, bool],
    cells: Callable[[int], Sequence[str]],
) -> int:
    steps = range(1, len(explanation.path.states) + 1)
    rows = [cells(step) for step in steps]
    marks = (mark_of(explanation, step) or "" for step in steps)
    widths = [len("step"), max(len(actions[action]) for action in explanation.path.actions), len("importance")]
    widths += [
        _WORDS if in_words else max(len(heading), *(len(row[place]) for row in rows))
        for place, (heading, in_words) in enumerate(headings.items())
    ]
    widths.append(2 + max(map(len, marks)))
    return sum(widths) + 2 * (len(widths) + 1)


def scale(explanation: Explanation) -> tuple[float, float]:
    """Return where the bars of an explanation begin and end: 0 and 1 for chances, else what its rewards need."""
    values = explanation.importance.values
    return min(0.0, float(np.floor(values.min()))), max(1.0, float(np.ceil(values.max())))


def mark_of(explanation: Explanation, step: int) -> str | None:
    """Return what a step is, the most telling first: the explanation, a key point, a subgoal, or nothing."""
    if step == explanation.explanation_step:
        return "explanation"
    if step in explanation.key_points:
        return "key point"
    return "subgoal" if step in explanation.subgoals else None


def summary_lines(
    explanation: Explanation,
    world: World,
    in_words: Callable[[int], str],
    glyphs: Glyphs,
    asker: str = "",
) -> list[Text]:
    """Say how long the path is, which steps are subgoals, and what the route asked about misses.

    Args:
        explanation: What is shown.
        world: In which it holds.
        in_words: Says a step in words, for the explanation itself.
        glyphs: What to draw with.
        asker: Who asks, as the words between the step and the route.
    """
    names = world.actions
    steps = listed([named(explanation, names, step) for step in explanation.subgoals]) or "none"
    num_steps = explanation.path.num_steps
    lines = [Text(f"{num_steps} step{'s' if num_steps > 1 else ''}, {level_of(explanation)}. Subgoals: {steps}.")]
    if explanation.route is None:
        return lines
    actions = ", ".join(names[action] for action in explanation.route)
    lines.append(Text(f"Asked at step {explanation.from_step}{asker or ':'} {actions}.", style=ASKED))
    if explanation.explanation_step is None:
        return [*lines, Text(_nothing_missing(explanation, world))]
    missed = listed([named(explanation, names, step) for step in explanation.key_points])
    answer = f"{glyphs.marks['explanation']} Explanation: {in_words(explanation.explanation_step)}."
    lines.append(Text(f"That route does not reach the goal. It misses {missed}."))
    return [*lines, Text(answer, style=MARK_STYLES["explanation"])]


def level_of(explanation: Explanation) -> str:
    """Say where the threshold lies."""
    name = "mean importance" if explanation.rule == "mean" else f"threshold ({_LEVELS[explanation.rule]})"
    return f"{name} {explanation.threshold:.3f}"


def route_of(explanation: Explanation, world: World) -> Trajectory:
    """Return where the questioner's actions lead, each with its most probable outcome."""
    start = explanation.path.states[explanation.from_step - 1]
    return roll_out(certain(world), start, explanation.route or ())


def _nothing_missing(explanation: Explanation, world: World) -> str:
    if world.goal[route_of(explanation, world).states[-1]]:
        return "That route reaches the goal, so it misses nothing."
    return "That route does not reach the goal, and misses none of the subgoals ahead."


def named(explanation: Explanation, actions: Sequence[str], step: int) -> str:
    """Name a step by its number and its action."""
    return f"step {step} ({actions[explanation.path.actions[step - 1]]})"


def sentence_lines(explanation: Explanation, sentences: Mapping[int, str], glyphs: Glyphs) -> Table:
    """Write one sentence per line, each behind the sign of its step."""
    lines = Table.grid(padding=(0, 1, 0, 0))
    lines.add_column()
    lines.add_column(overflow="fold")
    for step, sentence in sentences.items():
        mark = mark_of(explanation, step)
        style = MARK_STYLES[mark] if mark else ""
        lines.add_row(Text(glyphs.marks[mark] if mark else "", style), Text(sentence, style))
    return lines


def listed(names: Sequence[str]) -> str:
    """Join names with commas and a last "and"."""
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def _number(explanation: Explanation, step: int, glyphs: Glyphs) -> str:
    number = float(explanation.importance.values[step - 1])
    value = f"{number:.3f}" if not number or abs(number) >= _SMALLEST_SHOWN else f"{number:.0e}"
    errors = explanation.importance.standard_errors
    return value if errors is None else f"{value} {glyphs.plus_minus}{errors[step - 1]:.3f}"


@dataclass(frozen=True, slots=True)
class Bar:
    """A share from 0 to 1 as a bar that fills its column, with a tick at the threshold."""

    value: float
    threshold: float
    glyphs: Glyphs

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(_NARROWEST_BAR, _WIDEST_BAR)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width = min(options.max_width, _WIDEST_BAR)
        bar = _filled(self.value, width, self.glyphs.eighths)
        tick = max(0, min(width - 1, int(self.threshold * width)))
        yield Segment(bar[:tick], Style.parse(_BAR))
        above = bar[tick] == self.glyphs.eighths[-1]
        yield Segment(bar[tick] if above else self.glyphs.tick, Style.parse(_BAR if above else QUIET))
        yield Segment(bar[tick + 1 :], Style.parse(_BAR))
        yield Segment.line()


def _filled(value: float, width: int, eighths: str) -> str:
    parts = len(eighths) - 1
    whole, rest = divmod(math.floor(max(0.0, min(1.0, value)) * width * parts + 0.5), parts)
    return (eighths[-1] * whole + (eighths[rest] if rest else "")).ljust(width)
