"""A coarse explanation as text: each coarse step with the steps that it covers, and its importance as a bar."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

from webapp.explainer.abstraction import CoarseWorld
from webapp.explainer.explanation import Explanation
from webapp.explainer.granularity import CoarsePath
from webapp.explainer.pictures.terminal_parts import (
    ASCII,
    ASKED,
    MARK_STYLES,
    QUIET,
    UNICODE,
    Glyphs,
    importance_table,
    level_of,
)

_ROOM_FOR_STATES = 100
"""On narrower consoles the coarse states are left out; the actions say what happens."""


@dataclass(frozen=True, slots=True)
class GranularityReport:
    """A coarse explanation, to be printed by a `rich` console of any width; ASCII where it knows nothing else.

    Attributes:
        coarse: The coarse world.
        found: The path that is explained, with the steps of the fine path that it covers.
        explanation: Of that path.
        title: The name of the map.
        subtitle: What was asked for, in a few words.
        question: The question in the steps of the map, if somebody asks.
    """

    coarse: CoarseWorld
    found: CoarsePath
    explanation: Explanation
    title: str
    subtitle: str
    question: str = ""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        glyphs = ASCII if options.ascii_only else UNICODE
        yield Text(self.title, style="bold")
        yield Text(self.subtitle, style=QUIET)
        yield Text()
        yield self._table(glyphs, options.max_width)
        yield Text()
        yield from self._summary(glyphs)

    def _table(self, glyphs: Glyphs, width: int) -> Table:
        path, spans = self.explanation.path, self.found.spans
        headings = {"covers": False, "in": True} if width >= _ROOM_FOR_STATES else {"covers": False}

        def cells(step: int) -> list[str]:
            covered = _span(spans[step - 1]) if step <= len(spans) else ""
            return [covered, str(self.coarse.mdp.states[path.states[step - 1]])][: len(headings)]

        return importance_table(self.explanation, self.coarse.mdp.actions, headings, cells, glyphs, width)

    def _summary(self, glyphs: Glyphs) -> list[Text]:
        explanation, num_steps = self.explanation, self.found.spans[-1][1]
        facts = f"{num_steps} steps seen as {explanation.path.num_steps}, {level_of(explanation)}. "
        lines = [Text(f"{facts}Subgoals: {self._listed(explanation.subgoals)}.")]
        if explanation.route is None:
            return lines
        route = (
            ", ".join(self.coarse.mdp.actions[action] for action in explanation.route) or "a route to no other place"
        )
        if self.question:
            lines.append(Text(self.question, style=ASKED))
        seen = "Seen so coarsely, at step" if self.question else "Asked at step"
        lines.append(Text(f"{seen} {explanation.from_step}: {route}.", style=ASKED))
        if explanation.explanation_step is None:
            return [*lines, Text("That route misses nothing.")]
        first = self._listed([explanation.explanation_step])
        lines.append(Text(f"That route misses {self._listed(explanation.key_points)}."))
        return [*lines, Text(f"{glyphs.marks['explanation']} Explanation: {first}.", style=MARK_STYLES["explanation"])]

    def _listed(self, steps: Sequence[int]) -> str:
        """Name steps by their actions and what they cover."""
        names = (self.coarse.mdp.actions[self.explanation.path.actions[step - 1]] for step in steps)
        spans = (_span(self.found.spans[step - 1]) for step in steps)
        return ", ".join(f"{name} ({span})" for name, span in zip(names, spans, strict=True)) or "none"


def _span(span: tuple[int, int]) -> str:
    first, last = span
    return str(first) if first == last else f"{first}-{last}"
