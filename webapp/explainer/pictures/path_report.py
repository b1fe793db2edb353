"""An explanation of any world as text: the path as a list of states in words, and its importance as bars."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from webapp.explainer.explanation import Explanation
from webapp.explainer.pictures.terminal_parts import (
    ASCII,
    QUIET,
    UNICODE,
    importance_table,
    sentence_lines,
    summary_lines,
)
from webapp.explainer.stochastic import World


@dataclass(frozen=True, slots=True)
class PathReport:
    """An explanation of a path, to be printed by a `rich` console of any width.

    Attributes:
        world: The world in which it holds.
        explanation: Of a path in that world.
        describe: Says a state, by its index, in words.
        title: The name of the world.
        subtitle: What was asked for, in a few words.
        sentences: What to say of the subgoals below the table, by step.
    """

    world: World
    explanation: Explanation
    describe: Callable[[int], str]
    title: str
    subtitle: str
    sentences: Mapping[int, str] = field(default_factory=dict)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        glyphs = ASCII if options.ascii_only else UNICODE
        yield Text(self.title, style="bold")
        yield Text(self.subtitle, style=QUIET)
        yield Text()
        cells = lambda step: [self.describe(self.explanation.path.states[step - 1])]
        names, width = self.world.actions, options.max_width
        yield importance_table(self.explanation, names, {"state": True}, cells, glyphs, width)
        yield Text()
        if self.sentences:
            yield sentence_lines(self.explanation, self.sentences, glyphs)
            yield Text()
        yield from summary_lines(self.explanation, self.world, self._in_words, glyphs)

    def _in_words(self, step: int) -> str:
        path = self.explanation.path
        action = self.world.actions[path.actions[step - 1]]
        return f"step {step}, {action} in the state {self.describe(path.states[step - 1])}"
