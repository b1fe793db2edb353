"""A coarse explanation in the terminal, compared with what a person should read."""

import json
from io import BytesIO, TextIOWrapper

import pytest
from rich.console import Console

from tests.worlds import LAYOUTS
from webapp.explainer.abstraction import CoarseWorld
from webapp.explainer.explanation import Explanation
from webapp.explainer.granularity import CoarsePath, as_json, coarse_world, explain_coarsely
from webapp.explainer.key_points import roll_out
from webapp.explainer.pictures.granularity_table import GranularityReport
from webapp.explainer.questioner import believed_door_at, believed_route
from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds.key_door import start_state, tabulate


def explained(*, asked: bool) -> tuple[CoarseWorld, CoarsePath, Explanation]:
    layout = LAYOUTS["simulation"]
    mdp = tabulate(layout)
    coarse = coarse_world(mdp, layout, "events")
    route = roll_out(mdp, mdp.start, believed_route(believed_door_at(layout, (4, 2), start_state(layout))))
    return (coarse, *explain_coarsely(coarse, follow(mdp, plan(mdp)), route=route if asked else None))


def printed(width: int, encoding: str = "utf-8", *, asked: bool = False) -> list[str]:
    page = TextIOWrapper(BytesIO(), encoding=encoding)
    report = GranularityReport(*explained(asked=asked), title="simulation", subtitle="events")
    Console(file=page, width=width, no_color=True).print(report)
    page.seek(0)
    return [line.rstrip() for line in page.read().splitlines()]


def test_every_coarse_step_is_a_line_with_the_steps_that_it_covers() -> None:
    lines = printed(120)
    assert lines[:2] == ["simulation", "events"]
    rows = [line.split() for line in lines[4:] if line.strip()[:1].isdigit()][:9]
    assert [row[1] for row in rows] == ["1-5", "6-7", "8-13", "14", "15", "16", "17", "18-19", "20"]
    assert [row[0] for row in rows if "○" in row] == ["2", "6", "9"]
    subgoals = "take the key (6-7), enter room 2 (16), reach the goal (20)"
    assert " ".join(lines[-2:]).strip() == f"20 steps seen as 9, mean importance 0.400. Subgoals: {subgoals}."


def test_a_bar_is_as_long_as_the_importance_and_the_tick_stands_at_the_mean() -> None:
    lines = printed(300)
    bars = {line.split()[0]: line.split("0.")[-1][3:] for line in lines if line.strip()[:1] in set("1234567")}
    assert bars["2"].count("█") == 25
    assert bars["5"].count("█") == 33
    assert bars["1"].index("┊") == bars["3"].index("┊")
    full = next(line for line in lines if line.strip().startswith("9"))
    assert full.count("█") == 50


def test_what_a_route_misses_is_marked_and_named() -> None:
    lines = printed(140, asked=True)
    assert sum("★ explanation" in line for line in lines) == 1
    assert next(line for line in lines if "★" in line).split()[0] == "6"
    assert lines[-3:] == [
        "Asked at step 1: go to the key, take the key, go to the door, leave the door.",
        "That route misses enter room 2 (16), reach the goal (20).",
        "★ Explanation: enter room 2 (16).",
    ]


@pytest.mark.parametrize("width", [60, 80, 120])
def test_nothing_is_wider_than_the_console_and_ascii_stays_ascii(width: int) -> None:
    lines = printed(width, "ascii", asked=True)
    assert all(len(line) <= width and line.isascii() for line in lines)
    assert any("! ex" in line for line in lines)
    assert any("room 1, no key" in line for line in lines) == (width >= 100)


def test_other_programs_read_the_same_facts() -> None:
    coarse, found, explanation = explained(asked=True)
    read = json.loads(json.dumps(as_json(coarse, found, explanation)))
    assert read["granularity"] == "events"
    assert read["steps"][1] == [6, 7]
    assert read["subgoals"][0] == {
        "step": 2,
        "steps": [6, 7],
        "state": "room 1, no key, door shut, beside the key",
        "action": "take the key",
    }
    assert read["explanation"]["action"] == "enter room 2"
    assert [len(read[name]) for name in ("states", "actions", "importance")] == [10, 9, 10]
    unasked = as_json(*explained(asked=False))
    assert (unasked["explanation"], unasked["key_points"]) == (None, [])


def test_a_route_that_stays_where_it_is_is_said_to_do_so() -> None:
    layout = LAYOUTS["simulation"]
    mdp = tabulate(layout)
    coarse = coarse_world(mdp, layout, "rooms")
    path = follow(mdp, plan(mdp))
    found, explanation = explain_coarsely(coarse, path, route=roll_out(mdp, mdp.start, [1]))
    page = TextIOWrapper(BytesIO(), encoding="utf-8")
    Console(file=page, width=120).print(GranularityReport(coarse, found, explanation, "simulation", "rooms"))
    page.seek(0)
    assert page.read().splitlines()[-3:] == [
        "Asked at step 1: a route to no other place.",
        "That route misses reach the goal (17-20).",
        "★ Explanation: reach the goal (17-20).",
    ]
