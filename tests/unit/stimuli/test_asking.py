"""The agent's answer to a route, in a small world whose every number is known."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds.key_door import ACTIONS, tabulate
from webapp.explainer.worlds.layout import parse_layout
from webapp.stimuli.asking import answer
from webapp.stimuli.world_table import WorldTable

SMALL = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
PATH = follow(SMALL, plan(SMALL))
WORLD = WorldTable(
    layout="small",
    actions=ACTIONS,
    start=SMALL.start,
    next_states=tuple(map(tuple, SMALL.next_state.tolist())),
    terminal=frozenset(SMALL.terminal.nonzero()[0].tolist()),
    goals=frozenset(SMALL.goal.nonzero()[0].tolist()),
    policy=tuple(plan(SMALL).tolist()),
    path_states=PATH.states,
    path_actions=tuple(ACTIONS[action] for action in PATH.actions),
    subgoals=(1, 5, 7),
)
WAY = ("pickup", "left", "left", "forward", "toggle", "forward", "forward")


def test_the_agents_own_way_lacks_nothing() -> None:
    found = answer(WORLD, WAY)
    assert (found.reaches_goal, found.num_actions, found.num_agent_actions) == (True, 7, 7)
    assert (found.passed, found.key_points, found.explanation) == ((1, 5, 7), (), None)
    assert found.shown == (1, 5, 7)


def test_a_way_about_is_longer_and_what_comes_after_the_goal_is_not_counted() -> None:
    found = answer(WORLD, ("right", "left", *WAY, "forward", "toggle"))
    assert (found.reaches_goal, found.num_actions, found.num_agent_actions) == (True, 9, 7)
    assert found.key_points == ()


def test_a_way_that_stops_on_the_way_lacks_the_rest_and_the_first_of_it_is_the_explanation() -> None:
    found = answer(WORLD, WAY[:4])
    assert (found.reaches_goal, found.num_actions) == (False, 4)
    assert (found.passed, found.key_points, found.explanation, found.shown) == ((1,), (5, 7), 5, (5, 7))


def test_no_way_at_all_lacks_everything() -> None:
    assert answer(WORLD, ()).key_points == (1, 5, 7)


def test_a_question_that_begins_later_is_about_what_lies_ahead() -> None:
    found = answer(WORLD, WAY[2:], from_step=3)
    assert (found.reaches_goal, found.num_actions, found.num_agent_actions) == (True, 5, 5)
    assert (found.subgoals, found.shown) == ((5, 7), (5, 7))
    assert answer(WORLD, (), from_step=6).explanation == 7
    with pytest.raises(ValueError, match="no step 8"):
        answer(WORLD, (), from_step=8)


@given(st.lists(st.sampled_from(ACTIONS), max_size=30), st.integers(1, 7))
def test_every_subgoal_ahead_is_on_the_route_or_missing_unless_the_goal_is_reached(route: list[str], step: int) -> None:
    found = answer(WORLD, route, step)
    assert sorted((*found.passed, *found.key_points)) == list(found.passed if found.reaches_goal else found.subgoals)
    assert found.shown
    assert found.num_actions <= len(route)
    assert not found.reaches_goal or found.num_actions >= found.num_agent_actions
