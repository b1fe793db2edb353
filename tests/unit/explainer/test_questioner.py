import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.worlds import LAYOUTS, lay_out, layouts, reachable_states
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.questioner import (
    Belief,
    NoSplit,
    believed_door_at,
    believed_open_door,
    believed_route,
    believed_states,
    find_split,
    mistaken_route,
)
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan
from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState, start_state, step, tabulate
from webapp.explainer.worlds.layout import Cell, Layout, LayoutError
from webapp.explainer.worlds.view import key_in_view

ROOMY = LAYOUTS["experiment2-a"]


def planned(name: str) -> tuple[DeterministicMDP, Trajectory]:
    mdp = tabulate(LAYOUTS[name])
    return mdp, follow(mdp, plan(mdp))


def test_an_open_door_is_walked_through_without_the_key() -> None:
    start = start_state(ROOMY)
    state, reached = start._replace(door_open=1), False
    for action in believed_route(believed_open_door(ROOMY, start)):
        assert not reached
        state, reached = step(ROOMY, state, action)
    assert reached
    assert not state.has_key


def test_who_believes_in_another_door_fetches_the_key_for_it() -> None:
    layout = LAYOUTS["simulation"]
    belief = believed_door_at(layout, (4, 2), start_state(layout))
    route = [ACTIONS[action] for action in believed_route(belief)]
    assert route.count("pickup") == route.count("toggle") == 1
    assert all(not isinstance(s, KeyDoorState) or (s.x, s.y) != layout.door for s in belief.states)


def test_a_door_can_only_be_believed_in_an_inner_wall() -> None:
    with pytest.raises(ValueError, match=r"inner wall"):
        believed_door_at(ROOMY, ROOMY.start, start_state(ROOMY))


def test_a_goal_that_nobody_could_reach_gives_no_route() -> None:
    walled_in = lay_out("######", "#>#KD#", "####G#", "######")
    with pytest.raises(NeverArrives):
        believed_route(believed_open_door(walled_in, start_state(walled_in)))


@pytest.mark.parametrize("name", ["experiment2-a", "experiment2-b"])
def test_at_the_split_the_agent_surprises_and_the_key_has_not_been_seen(name: str) -> None:
    mdp, path = planned(name)
    layout = LAYOUTS[name]
    question = find_split(layout, mdp, path)
    step_number = question.from_step
    states = [state for state in mdp.states if isinstance(state, KeyDoorState)]
    assert not any(key_in_view(layout, states[state]) for state in path.states[:step_number])
    assert question.route[0] != path.actions[step_number - 1]
    assert question.video_actions + question.announced_actions == path.actions[: step_number + 1]
    assert len(question.video_actions) >= 2
    for later in range(step_number + 1, path.num_steps):
        seen = any(key_in_view(layout, states[state]) for state in path.states[:later])
        believed = believed_route(believed_open_door(layout, states[path.states[later - 1]]))
        assert seen or believed[0] == path.actions[later - 1]


@pytest.mark.parametrize("name", ["experiment1-a", "experiment1-c"])
def test_a_path_on_which_the_key_is_seen_at_once_has_no_split(name: str) -> None:
    mdp, path = planned(name)
    with pytest.raises(NoSplit, match="no step of this path can be asked about"):
        find_split(LAYOUTS[name], mdp, path)


def test_a_split_needs_as_many_actions_before_and_after_as_are_shown() -> None:
    mdp, path = planned("experiment2-a")
    split = find_split(ROOMY, mdp, path).from_step
    earliest = find_split(ROOMY, mdp, path, min_video_actions=split - 1, num_announced=1)
    assert (earliest.from_step, len(earliest.announced_actions)) == (split, 1)
    with pytest.raises(NoSplit):
        find_split(ROOMY, mdp, path, min_video_actions=split)
    with pytest.raises(NoSplit):
        find_split(ROOMY, mdp, path, num_announced=path.num_steps)


@pytest.mark.parametrize(("video", "announced"), [(-1, 2), (2, 0)])
def test_a_question_that_announces_nothing_is_refused(video: int, announced: int) -> None:
    mdp, path = planned("experiment2-a")
    with pytest.raises(ValueError, match=f"not {video} and {announced}"):
        find_split(ROOMY, mdp, path, min_video_actions=video, num_announced=announced)


def test_only_key_door_worlds_can_be_asked_about() -> None:
    end = np.array([False, True])
    other = DeterministicMDP(("a", "b"), ("go",), np.array([[1], [1]], dtype=np.int32), end, end.copy(), 0)
    with pytest.raises(TypeError, match="'a' is no state of one"):
        find_split(ROOMY, other, Trajectory((0, 1), (0,)))


def test_of_several_surprising_steps_the_last_before_the_key_comes_into_view_is_asked_about() -> None:
    corridor = lay_out("############", "#K.....>D.G#", "############")
    mdp = tabulate(corridor)
    path = follow(mdp, plan(mdp))
    assert [ACTIONS[action] for action in path.actions[:7]] == ["left", "left", *["forward"] * 5]
    question = find_split(corridor, mdp, path)
    # Going back towards the door would be right at each of steps 3 to 6; at step 7 the key lies two cells ahead.
    assert question.from_step == 6
    assert [ACTIONS[action] for action in question.route] == ["left", "left", *["forward"] * 6]


@pytest.mark.parametrize("name", LAYOUTS)
def test_who_believes_what_is_true_goes_as_the_planner_goes(name: str) -> None:
    layout = LAYOUTS[name]
    mdp, path = planned(name)
    for number in range(1, path.num_steps + 1):
        state = mdp.states[path.states[number - 1]]
        assert isinstance(state, KeyDoorState)
        assert mistaken_route(layout, Belief(layout), state) == path.from_step(number).actions


def test_the_state_of_the_agent_is_taken_over_and_not_the_one_drawn_on_the_believed_map() -> None:
    real = lay_out("########", "#>KD..G#", "########")
    belief = Belief(lay_out("########", "#K.D<.G#", "########"))
    with_key = KeyDoorState(2, 1, 2, 1, 0)
    route = [ACTIONS[action] for action in mistaken_route(real, belief, with_key)]
    assert route == ["left", "left", "toggle", *["forward"] * 4]
    door_open = with_key._replace(door_open=1, heading=0)
    assert [ACTIONS[action] for action in mistaken_route(real, belief, door_open)] == ["forward"] * 4


@st.composite
def beliefs(draw: st.DrawFn) -> tuple[Layout, Layout, KeyDoorState]:
    """Draw a world, what somebody takes for it with its cells in another order, and a state of the real one."""
    real = draw(layouts(6))
    rows = str(real).split()
    order = iter(draw(st.permutations("".join(row[1:-1] for row in rows[1:-1]))))
    mixed = [f"#{''.join(next(order) for _ in row[1:-1])}#" for row in rows[1:-1]]
    state = draw(st.sampled_from([s for s in reachable_states(real) if (s.x, s.y) != real.goal]))
    return real, lay_out(rows[0], *mixed, rows[-1]), state


@given(drawn=beliefs())
@settings(max_examples=100)
def test_a_believed_route_is_a_shortest_one_or_refused(drawn: tuple[Layout, Layout, KeyDoorState]) -> None:
    real, believed, state = drawn
    symbol = str(believed).split()[state.y][state.x]
    barred = symbol in "#G" or (symbol == "K" and not state.has_key) or (symbol == "D" and not state.door_open)
    levels = _cells_reached(believed, state)
    if barred or believed.goal not in set().union(*levels):
        with pytest.raises(LayoutError, match="where this believed map has" if barred else "cannot be reached"):
            mistaken_route(real, Belief(believed), state)
        return
    route = mistaken_route(real, Belief(believed), state)
    states = believed_states(Belief(believed), state, route)
    assert states[0] == state
    assert [(s.x, s.y) == believed.goal for s in states] == [False] * len(route) + [True]
    assert len(route) == next(n for n, cells in enumerate(levels) if believed.goal in cells)


def _cells_reached(layout: Layout, state: KeyDoorState) -> list[set[Cell]]:
    """Return the cells in which the agent can be after 0, 1, 2, ... actions, without going back to a state."""
    frontier, known, levels = {state}, {state}, []
    while frontier:
        levels.append({(s.x, s.y) for s in frontier})
        inside = [s for s in frontier if (s.x, s.y) != layout.goal]
        frontier = {step(layout, s, action)[0] for s in inside for action in range(len(ACTIONS))} - known
        known |= frontier
    return levels


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (("#######", "#>KDG.#", "#######"), "line 3, column 7: the believed map is 7 cells wide and 3 high, the"),
        (("########", "##>KD.G#", "########"), r"line 2, column 2: .* at \(1, 1\), where .* has a wall"),
        (("########", "#G>KD..#", "########"), r"line 2, column 2: .* at \(1, 1\), where .* has the goal"),
        (("########", "#K>D..G#", "########"), r"line 2, column 2: .* at \(1, 1\), where .* has the key"),
        (("########", "#DK>..G#", "########"), r"line 2, column 2: .* at \(1, 1\), where .* has a locked door"),
        (("########", "#>KD.#G#", "########"), r"line 2, column 7: .* cannot be reached from \(1, 1\), where the"),
        (("########", "#>D..#G#", "####K###", "########"), "line 4, column 8: the believed map is"),
    ],
)
def test_a_map_that_does_not_fit_the_agents_state_is_refused(rows: tuple[str, ...], message: str) -> None:
    real = lay_out("########", "#>KD..G#", "########")
    with pytest.raises(LayoutError, match=f"^b.txt, {message}"):
        mistaken_route(real, Belief(lay_out(*rows), "b.txt"), start_state(real))


def test_a_key_in_hand_and_an_open_door_are_no_obstacles() -> None:
    real = lay_out("########", "#>KD..G#", "########")
    belief = Belief(lay_out("########", "#.>D.KG#", "########"))
    assert len(mistaken_route(real, belief, KeyDoorState(5, 1, 0, 1, 1))) == 1
    assert len(mistaken_route(real, belief, KeyDoorState(3, 1, 0, 1, 1))) == 3
