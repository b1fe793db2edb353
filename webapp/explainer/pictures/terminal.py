"""An explanation as text: the path drawn on the map leg by leg, and its importance as bars."""

import math
from dataclasses import dataclass

from rich.columns import Columns
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.measure import Measurement
from rich.segment import Segment
from rich.style import Style
from rich.table import Table
from rich.text import Text

from webapp.explainer.explanation import Explanation
from webapp.explainer.key_points import roll_out
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import Trajectory
from webapp.explainer.worlds.key_door import KeyDoorState
from webapp.explainer.worlds.layout import Cell, Layout

_PATH, _ASKED, _THING, _GOAL, _BAR, _QUIET = "bold cyan", "bold magenta", "bold yellow", "bold green", "cyan", "dim"
_MARKS = {"subgoal": "green", "key point": "yellow", "explanation": "bold yellow"}
_NARROWEST_BAR, _WIDEST_BAR = 10, 50


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


_UNICODE = Glyphs(
    arrows="→↓←↑",
    wall="██",
    floor="·",
    eighths=" ▏▎▍▌▋▊▉█",
    tick="┊",
    marks={"subgoal": "○", "key point": "●", "explanation": "★"},
    plus_minus="±",
)
_ASCII = Glyphs(
    arrows=">v<^",
    wall="##",
    floor=".",
    eighths=" #",
    tick="|",
    marks={"subgoal": "o", "key point": "*", "explanation": "!"},
    plus_minus="+-",
)


@dataclass(frozen=True, slots=True)
class Report:
    """An explanation of a key-door world, to be printed by a `rich` console of any width.

    It is plain text where the console has no colours, and ASCII where it knows no other characters.

    Attributes:
        layout: The map.
        mdp: A world whose labels are the map's `KeyDoorState`s.
        explanation: Of a path in that world.
        title: The name of the map.
        subtitle: What was asked for, in a few words.
    """

    layout: Layout
    mdp: DeterministicMDP
    explanation: Explanation
    title: str
    subtitle: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        glyphs = _ASCII if options.ascii_only else _UNICODE
        cell_width = 2 if 2 * self.layout.width <= options.max_width else 1
        yield Text(self.title, style="bold")
        yield Text(self.subtitle, style=_QUIET)
        yield Text()
        yield Columns(self._maps(glyphs, cell_width), padding=(0, 3))
        yield Text()
        yield self._table(glyphs, options.max_width)
        yield Text()
        yield from self._summary(glyphs)

    def _maps(self, glyphs: Glyphs, cell_width: int) -> list[RenderableType]:
        path = self.explanation.path
        ends = [step for step in self.explanation.subgoals if step < path.num_steps] + [path.num_steps]
        maps: list[RenderableType] = []
        first = 1
        for number, last in enumerate(ends, start=1):
            leg = Trajectory(path.states[first - 1 : last + 1], path.actions[first - 1 : last])
            title = f"{number}. steps {first}-{last}" if last > first else f"{number}. step {first}"
            maps.append(Group(Text(title), self._map(leg, _PATH, glyphs, cell_width)))
            first = last + 1
        if self.explanation.route is not None:
            maps.append(Group(Text("the route asked"), self._map(self._asked(), _ASKED, glyphs, cell_width)))
        return maps

    def _map(self, leg: Trajectory, style: str, glyphs: Glyphs, cell_width: int) -> Text:
        states = [_label(self.mdp, state) for state in leg.states]
        cells = _cells(self.layout, states, style, glyphs)
        drawing = Text(no_wrap=True)
        for y in range(self.layout.height):
            for x in range(self.layout.width):
                glyph, colour = cells.get((x, y), (glyphs.floor, _QUIET))
                drawing.append((glyph if len(glyph) > 1 else f"{glyph} ")[:cell_width], colour)
            drawing.append("\n" if y < self.layout.height - 1 else "")
        return drawing

    def _table(self, glyphs: Glyphs, width: int) -> Table:
        table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style=_QUIET, width=width)
        table.add_column("step", justify="right")
        table.add_column("at", no_wrap=True)
        table.add_column("has", no_wrap=True)
        table.add_column("door", no_wrap=True)
        table.add_column("action", no_wrap=True)
        table.add_column("importance", justify="right", no_wrap=True)
        table.add_column(f"0 to 1, {glyphs.tick} mean", no_wrap=True, ratio=1)
        table.add_column("", no_wrap=True)
        path = self.explanation.path
        for step, state in enumerate(path.states, start=1):
            label = _label(self.mdp, state)
            mark = self._mark(step)
            table.add_row(
                str(step) if step <= path.num_steps else "",
                f"{label.x},{label.y} {glyphs.arrows[label.heading]}",
                "key" if label.has_key else "",
                "open" if label.door_open else "",
                self.mdp.actions[path.actions[step - 1]] if step <= path.num_steps else Text("goal", style=_QUIET),
                self._number(step, glyphs),
                _Bar(float(self.explanation.importance.values[step - 1]), self.explanation.threshold, glyphs),
                Text(f"{glyphs.marks[mark]} {mark}", style=_MARKS[mark]) if mark else Text(),
                style=_MARKS[mark] if mark else "",
            )
        return table

    def _mark(self, step: int) -> str | None:
        if step == self.explanation.explanation_step:
            return "explanation"
        if step in self.explanation.key_points:
            return "key point"
        return "subgoal" if step in self.explanation.subgoals else None

    def _number(self, step: int, glyphs: Glyphs) -> str:
        value = f"{self.explanation.importance.values[step - 1]:.3f}"
        errors = self.explanation.importance.standard_errors
        return value if errors is None else f"{value} {glyphs.plus_minus}{errors[step - 1]:.3f}"

    def _summary(self, glyphs: Glyphs) -> list[Text]:
        explanation = self.explanation
        steps = _listed([self._named(step) for step in explanation.subgoals]) or "none"
        facts = f"{explanation.path.num_steps} steps, mean importance {explanation.threshold:.3f}. Subgoals: {steps}."
        lines = [Text(facts)]
        if explanation.route is None:
            return lines
        route = ", ".join(self.mdp.actions[action] for action in explanation.route)
        lines.append(Text(f"Asked at step {explanation.from_step}: {route}.", style=_ASKED))
        if explanation.explanation_step is None:
            lines.append(Text(self._nothing_missing()))
            return lines
        missed = _listed([self._named(step) for step in explanation.key_points])
        lines.append(Text(f"That route does not reach the goal. It misses {missed}."))
        answer = f"{glyphs.marks['explanation']} Explanation: {self._in_words(explanation.explanation_step)}."
        lines.append(Text(answer, style=_MARKS["explanation"]))
        return lines

    def _nothing_missing(self) -> str:
        if self.mdp.goal[self._asked().states[-1]]:
            return "That route reaches the goal, so it misses nothing."
        return "That route does not reach the goal, and misses none of the subgoals ahead."

    def _asked(self) -> Trajectory:
        start = self.explanation.path.states[self.explanation.from_step - 1]
        return roll_out(self.mdp, start, self.explanation.route or ())

    def _named(self, step: int) -> str:
        return f"step {step} ({self.mdp.actions[self.explanation.path.actions[step - 1]]})"

    def _in_words(self, step: int) -> str:
        state = _label(self.mdp, self.explanation.path.states[step - 1])
        action = self.mdp.actions[self.explanation.path.actions[step - 1]]
        facing = ("right", "down", "left", "up")[state.heading]
        key = "with the key" if state.has_key else "without the key"
        door = "open" if state.door_open else "locked"
        return f"step {step}, {action} at ({state.x}, {state.y}), facing {facing}, {key}, the door {door}"


@dataclass(frozen=True, slots=True)
class _Bar:
    """One importance as a bar from 0 to 1 that fills its column, with a tick at the threshold."""

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
        yield Segment(bar[tick] if above else self.glyphs.tick, Style.parse(_BAR if above else _QUIET))
        yield Segment(bar[tick + 1 :], Style.parse(_BAR))
        yield Segment.line()


def _filled(value: float, width: int, eighths: str) -> str:
    parts = len(eighths) - 1
    whole, rest = divmod(math.floor(max(0.0, min(1.0, value)) * width * parts + 0.5), parts)
    return (eighths[-1] * whole + (eighths[rest] if rest else "")).ljust(width)


def _cells(layout: Layout, states: list[KeyDoorState], style: str, glyphs: Glyphs) -> dict[Cell, tuple[str, str]]:
    """Return what stands in each cell of a leg's map, and its colour.

    A cell that the leg visits shows the way in which the agent leaves it or comes to rest.
    """
    cells = dict.fromkeys(layout.walls, (glyphs.wall, _QUIET))
    cells[layout.door] = ("D", _THING)
    if not states[0].has_key:
        cells[layout.key] = ("K", _THING)
    for state in states:
        cells[state.x, state.y] = (glyphs.arrows[state.heading], style)
    cells[layout.goal] = ("G", style if (states[-1].x, states[-1].y) == layout.goal else _GOAL)
    return cells


def _label(mdp: DeterministicMDP, state: int) -> KeyDoorState:
    label = mdp.states[state]
    if not isinstance(label, KeyDoorState):
        raise TypeError(f"this picture shows key-door worlds, and {label!r} is no state of one")
    return label


def _listed(names: list[str]) -> str:
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)
