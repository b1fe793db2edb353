import numpy as np
import pytest

from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.questioner import (
    NoSplit,
    believed_door_at,
    believed_open_door,
    believed_route,
    find_split,
)
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan
from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState, start_state, step, tabulate
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
