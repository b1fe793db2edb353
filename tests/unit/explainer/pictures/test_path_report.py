"""Explanations in every kind of terminal: no line is too long, and ASCII stays ASCII."""

from io import BytesIO, TextIOWrapper

import numpy as np
import pytest
from rich.console import Console, RenderableType

from tests.worlds import LAYOUTS
from webapp.explainer.explanation import Explanation, explain
from webapp.explainer.importance import exact_importance
from webapp.explainer.pictures.path_report import PathReport
from webapp.explainer.pictures.terminal import Report
from webapp.explainer.solvers import plan
from webapp.explainer.worlds.key_door import ACTIONS, tabulate

LAYOUT = LAYOUTS["simulation"]
WORLD = tabulate(LAYOUT)
POLICY = plan(WORLD)


def explained(kind: str = "return_probability") -> Explanation:
    assess = lambda path: exact_importance(kind, WORLD, POLICY, path)  # type: ignore[arg-type]
    return explain(WORLD, POLICY, assess, route=(ACTIONS.index("left"),))


def report() -> PathReport:
    return PathReport(WORLD, explained(), lambda state: f"the state {WORLD.states[state]!r}", "a world", "a question")


def printed(what: RenderableType, width: int, encoding: str = "utf-8") -> list[str]:
    page = TextIOWrapper(BytesIO(), encoding=encoding)
    Console(file=page, width=width).print(what)
    page.seek(0)
    return page.read().splitlines()


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
@pytest.mark.parametrize("width", [60, 61, 70, 80, 100, 160])
def test_no_line_is_too_long_and_nothing_is_left_out(width: int, encoding: str) -> None:
    maps = Report(LAYOUT, WORLD, explained(), "a map", "a question")
    for lines in (printed(report(), width, encoding), printed(maps, width, encoding)):
        assert max(map(len, lines)) <= width
        text = "".join(lines)
        assert "\N{HORIZONTAL ELLIPSIS}" not in text
        assert text.count("key point") == 2
        assert text.count("0.307") == 1


def test_bars_are_drawn_where_there_is_room_for_them() -> None:
    assert not any("█" in line for line in printed(report(), 60))
    assert sum("█" in line for line in printed(report(), 120)) > 10


def test_a_question_is_answered_in_the_words_of_the_world() -> None:
    lines = " ".join(printed(report(), 160))
    assert "Asked at step 1: left. That route does not reach the goal." in " ".join(lines.split())
    assert "Explanation: step 7, pickup in the state the state KeyDoorState(x=2, y=1" in " ".join(lines.split())


def test_the_scale_of_the_bars_holds_what_rewards_there_are() -> None:
    values = np.array([3.2, -0.5, 0.0])
    path = explained().path
    short = type(path)(path.states[:3], path.actions[:2])
    found = explained()
    cut = Explanation(short, type(found.importance)(values), (1,), None, 1, ())
    lines = printed(PathReport(WORLD, cut, str, "a world", "a question"), 120)
    assert any("-1 to 4" in line for line in lines)
