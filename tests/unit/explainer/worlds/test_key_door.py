import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.worlds import LAYOUTS, lay_out, layouts, reachable_states
from webapp.explainer.mdp import enumerate_mdp
from webapp.explainer.worlds.key_door import (
    ACTIONS,
    FORWARD,
    LEFT,
    PICKUP,
    RIGHT,
    TOGGLE,
    KeyDoorState,
    cell_ahead,
    enumerate_from,
    start_state,
    step,
    tabulate,
)
from webapp.explainer.worlds.layout import Layout, LayoutError

ROOM = lay_out(
    "######",
    "#>K#G#",
    "#..D.#",
    "######",
)
FACING_KEY = KeyDoorState(1, 1, 0, 0, 0)
FACING_DOOR = KeyDoorState(2, 2, 0, 0, 0)


def play(layout: Layout, state: KeyDoorState, *actions: int) -> tuple[KeyDoorState, bool]:
    ended = False
    for action in actions:
        assert not ended
        state, ended = step(layout, state, action)
    return state, ended


def test_the_actions_are_in_the_order_of_their_indices() -> None:
    assert ACTIONS == ("forward", "left", "right", "pickup", "toggle")
    assert [ACTIONS[i] for i in (FORWARD, LEFT, RIGHT, PICKUP, TOGGLE)] == list(ACTIONS)


def test_an_episode_begins_without_key_before_a_shut_door() -> None:
    assert start_state(ROOM) == FACING_KEY


@pytest.mark.parametrize(("heading", "ahead"), [(0, (6, 5)), (1, (5, 6)), (2, (4, 5)), (3, (5, 4))])
def test_headings_run_clockwise_from_the_right(heading: int, ahead: tuple[int, int]) -> None:
    assert cell_ahead(KeyDoorState(5, 5, heading, 0, 0)) == ahead


def test_four_turns_either_way_end_as_they_began() -> None:
    assert play(ROOM, FACING_KEY, LEFT)[0].heading == 3
    assert play(ROOM, FACING_KEY, RIGHT)[0].heading == 1
    assert play(ROOM, FACING_KEY, *[LEFT] * 4) == (FACING_KEY, False)
    assert play(ROOM, FACING_KEY, *[RIGHT] * 4) == (FACING_KEY, False)


def test_the_key_blocks_its_cell_until_it_is_taken() -> None:
    assert play(ROOM, FACING_KEY, FORWARD) == (FACING_KEY, False)
    assert play(ROOM, FACING_KEY, PICKUP) == (FACING_KEY._replace(has_key=1), False)
    assert play(ROOM, FACING_KEY, PICKUP, FORWARD) == (KeyDoorState(2, 1, 0, 1, 0), False)


def test_the_door_opens_and_shuts_only_with_the_key() -> None:
    with_key = FACING_DOOR._replace(has_key=1)
    assert play(ROOM, FACING_DOOR, TOGGLE) == (FACING_DOOR, False)
    assert play(ROOM, with_key, FORWARD) == (with_key, False)
    assert play(ROOM, with_key, TOGGLE) == (with_key._replace(door_open=1), False)
    assert play(ROOM, with_key, TOGGLE, TOGGLE) == (with_key, False)
    believed_open = FACING_DOOR._replace(door_open=1)
    assert play(ROOM, believed_open, TOGGLE) == (believed_open, False)
    assert play(ROOM, believed_open, FORWARD) == (believed_open._replace(x=3), False)


def test_the_episode_ends_on_the_goal() -> None:
    with_key = FACING_DOOR._replace(has_key=1)
    after, ended = play(ROOM, with_key, TOGGLE, FORWARD, FORWARD, LEFT, FORWARD)
    assert (after, ended) == (KeyDoorState(4, 1, 3, 1, 1), True)


@pytest.mark.parametrize("action", [PICKUP, TOGGLE, FORWARD])
def test_an_action_that_cannot_act_changes_nothing(action: int) -> None:
    before_wall = KeyDoorState(1, 2, 1, 1, 1)
    assert step(ROOM, before_wall, action) == (before_wall, False)


@pytest.mark.parametrize("action", [-1, 5])
def test_an_unknown_action_is_refused(action: int) -> None:
    with pytest.raises(ValueError, match=f"there is no action {action}"):
        step(ROOM, FACING_KEY, action)


def test_the_simulation_layout_has_the_papers_number_of_states() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    assert mdp.num_states == 308
    assert mdp.states[mdp.start] == KeyDoorState(2, 6, 3, 0, 0)


@settings(max_examples=40)
@given(layouts())
def test_the_table_says_what_the_rules_say(layout: Layout) -> None:
    mdp = enumerate_from(layout, start_state(layout))
    assert set(mdp.states) == set(reachable_states(layout))
    for i, state in enumerate(mdp.states):
        assert isinstance(state, KeyDoorState)
        assert mdp.goal[i] == mdp.terminal[i] == ((state.x, state.y) == layout.goal)
        if not mdp.terminal[i]:
            after = [mdp.states[j] for j in mdp.next_state[i]]
            assert after == [step(layout, state, action)[0] for action in range(len(ACTIONS))]


@settings(max_examples=40)
@given(layouts(), st.data())
def test_the_states_are_numbered_breadth_first_from_wherever_one_begins(layout: Layout, data: st.DataObject) -> None:
    begun = [state for state in reachable_states(layout) if (state.x, state.y) != layout.goal]
    start = data.draw(st.sampled_from(begun))._replace(door_open=data.draw(st.integers(0, 1)))
    expected = enumerate_mdp(start, ACTIONS, lambda state, action: step(layout, state, action))
    found = enumerate_from(layout, start)
    assert found.states == expected.states
    for part in ("next_state", "terminal", "goal"):
        np.testing.assert_array_equal(getattr(found, part), getattr(expected, part))
    assert (found.actions, found.start) == (expected.actions, expected.start)


def test_more_states_than_allowed_are_refused() -> None:
    layout = LAYOUTS["simulation"]
    assert enumerate_from(layout, start_state(layout), max_states=308).num_states == 308
    with pytest.raises(ValueError, match="more than 307 states can be reached; raise the limit or abstract them"):
        enumerate_from(layout, start_state(layout), max_states=307)


@pytest.mark.parametrize(
    "rows",
    [
        ("#####", "#>#G#", "#K#D#", "#####"),  # The door is on the far side.
        ("######", "#>D.G#", "###.K#", "######"),  # The key is behind the door.
        ("######", "#>#D##", "#K##G#", "######"),  # Walls all around.
    ],
)
def test_a_goal_out_of_reach_is_refused_with_its_place(rows: tuple[str, ...]) -> None:
    layout = lay_out(*rows)
    x, y = layout.goal
    with pytest.raises(LayoutError, match="the goal cannot be reached") as caught:
        tabulate(layout, "house.txt")
    assert str(caught.value).startswith(f"house.txt, line {y + 1}, column {x + 1}: ")
    assert (caught.value.line, caught.value.column) == (y + 1, x + 1)
    assert rows[y][x] == "G"


def test_the_smallest_corridor_is_a_world() -> None:
    corridor = lay_out("###", "#v#", "#K#", "#D#", "#G#", "###")
    mdp = tabulate(corridor)
    route = [PICKUP, FORWARD, TOGGLE, FORWARD, FORWARD]
    assert play(corridor, start_state(corridor), *route) == (KeyDoorState(1, 4, 1, 1, 1), True)
    assert mdp.num_states == 4 * (1 + 2 + 3) + 1  # Cells without key, with key, with open door; and the goal.
