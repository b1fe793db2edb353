"""An explanation of a map as text: the path drawn on it leg by leg, and its importance as bars."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rich.columns import Columns
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.table import Table
from rich.text import Text

from webapp.explainer.explanation import Explanation
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.terminal_parts import (
    ASCII,
    ASKED,
    QUIET,
    UNICODE,
    Glyphs,
    importance_table,
    route_of,
    sentence_lines,
    summary_lines,
)
from webapp.explainer.questioner import Belief, believed_states
from webapp.explainer.solvers import Trajectory
from webapp.explainer.worlds.key_door import KeyDoorState, key_door_state
from webapp.explainer.worlds.layout import Cell, Layout

_PATH, _THING, _GOAL = "bold cyan", "bold yellow", "bold green"


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
        belief: The map on which the questioner planned the route, if they did.
        sentences: What to say of the subgoals below the table, by step.
    """

    layout: Layout
    mdp: DeterministicMDP
    explanation: Explanation
    title: str
    subtitle: str
    belief: Belief | None = None
    sentences: Mapping[int, str] = field(default_factory=dict)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        glyphs = ASCII if options.ascii_only else UNICODE
        cell_width = 2 if 2 * self.layout.width <= options.max_width else 1
        yield Text(self.title, style="bold")
        yield Text(self.subtitle, style=QUIET)
        yield Text()
        yield Columns(self._maps(glyphs, cell_width), padding=(0, 3))
        yield Text()
        yield self._table(glyphs, options.max_width)
        yield Text()
        if self.sentences:
            yield sentence_lines(self.explanation, self.sentences, glyphs)
            yield Text()
        asker = "" if self.belief is None else f" by somebody who believes in {self.belief.source}, and so in the route"
        yield from summary_lines(self.explanation, self.mdp, self._in_words, glyphs, asker)

    def _maps(self, glyphs: Glyphs, cell_width: int) -> list[RenderableType]:
        path = self.explanation.path
        ends = [step for step in self.explanation.subgoals if step < path.num_steps] + [path.num_steps]
        maps: list[RenderableType] = []
        first = 1
        for number, last in enumerate(ends, start=1):
            leg = Trajectory(path.states[first - 1 : last + 1], path.actions[first - 1 : last])
            title = f"{number}. steps {first}-{last}" if last > first else f"{number}. step {first}"
            maps.append(Group(Text(title), _map(self.layout, self._states(leg), _PATH, glyphs, cell_width)))
            first = last + 1
        if self.explanation.route is None:
            return maps
        asked = self._states(route_of(self.explanation, self.mdp))
        if self.belief is not None:
            believed = believed_states(self.belief, asked[0], self.explanation.route)
            maps.append(Group(Text("as believed"), _map(self.belief.layout, believed, ASKED, glyphs, cell_width)))
        title = "the route asked" if self.belief is None else "what comes of it"
        maps.append(Group(Text(title), _map(self.layout, asked, ASKED, glyphs, cell_width)))
        return maps

    def _states(self, leg: Trajectory) -> list[KeyDoorState]:
        return [key_door_state(self.mdp, state) for state in leg.states]

    def _table(self, glyphs: Glyphs, width: int) -> Table:
        def cells(step: int) -> list[str]:
            label = key_door_state(self.mdp, self.explanation.path.states[step - 1])
            at = f"{label.x},{label.y} {glyphs.arrows[label.heading]}"
            return [at, "key" if label.has_key else "", "open" if label.door_open else ""]

        headings = {"at": False, "has": False, "door": False}
        return importance_table(self.explanation, self.mdp.actions, headings, cells, glyphs, width)

    def _in_words(self, step: int) -> str:
        state = key_door_state(self.mdp, self.explanation.path.states[step - 1])
        action = self.mdp.actions[self.explanation.path.actions[step - 1]]
        facing = ("right", "down", "left", "up")[state.heading]
        key = "with the key" if state.has_key else "without the key"
        door = "open" if state.door_open else "locked"
        return f"step {step}, {action} at ({state.x}, {state.y}), facing {facing}, {key}, the door {door}"


def _map(layout: Layout, states: Sequence[KeyDoorState], style: str, glyphs: Glyphs, cell_width: int) -> Text:
    cells = _cells(layout, states, style, glyphs)
    drawing = Text(no_wrap=True)
    for y in range(layout.height):
        for x in range(layout.width):
            glyph, colour = cells.get((x, y), (glyphs.floor, QUIET))
            drawing.append((glyph if len(glyph) > 1 else f"{glyph} ")[:cell_width], colour)
        drawing.append("\n" if y < layout.height - 1 else "")
    return drawing


def _cells(layout: Layout, states: Sequence[KeyDoorState], style: str, glyphs: Glyphs) -> dict[Cell, tuple[str, str]]:
    """Return what stands in each cell of a leg's map, and its colour.

    A cell that the leg visits shows the way in which the agent leaves it or comes to rest.
    """
    cells = dict.fromkeys(layout.walls, (glyphs.wall, QUIET))
    cells[layout.door] = ("D", _THING)
    if not states[0].has_key:
        cells[layout.key] = ("K", _THING)
    for state in states:
        cells[state.x, state.y] = (glyphs.arrows[state.heading], style)
    cells[layout.goal] = ("G", style if (states[-1].x, states[-1].y) == layout.goal else _GOAL)
    return cells
