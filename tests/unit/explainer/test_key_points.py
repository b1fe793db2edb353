import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.mdps import mdps
from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.key_points import key_point_steps, roll_out
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import distances_to_goal, follow, plan
from webapp.explainer.worlds.key_door import FORWARD, LEFT, PICKUP, RIGHT, TOGGLE, tabulate

CORRIDOR = tabulate(lay_out("#######", "#>KD.G#", "#######"))
PATH = follow(CORRIDOR, plan(CORRIDOR))
EVERY_STEP = tuple(range(1, PATH.num_steps + 1))


def test_the_corridor_is_walked_as_expected() -> None:
    assert PATH.actions == (PICKUP, FORWARD, TOGGLE, FORWARD, FORWARD, FORWARD)


def test_a_route_misses_the_pairs_that_it_does_not_contain() -> None:
    assert key_point_steps(CORRIDOR, PATH, (1, 3, 6), [PICKUP, LEFT, RIGHT, FORWARD]) == (3, 6)


def test_the_same_state_with_another_action_is_missed() -> None:
    assert key_point_steps(CORRIDOR, PATH, (1,), [FORWARD, FORWARD]) == (1,)


def test_a_route_that_reaches_the_goal_misses_nothing_even_where_it_differs() -> None:
    detour = [LEFT, LEFT, LEFT, LEFT, *PATH.actions]
    assert key_point_steps(CORRIDOR, PATH, EVERY_STEP, detour) == ()
    assert key_point_steps(CORRIDOR, PATH, EVERY_STEP, [*PATH.actions, LEFT, TOGGLE]) == ()


def test_whoever_does_nothing_misses_every_subgoal_ahead() -> None:
    assert key_point_steps(CORRIDOR, PATH, (1, 3, 6), []) == (1, 3, 6)
    assert key_point_steps(CORRIDOR, PATH, (1, 3, 6), [], from_step=3) == (3, 6)


def test_a_question_asked_on_the_way_starts_from_there() -> None:
    assert key_point_steps(CORRIDOR, PATH, EVERY_STEP, [TOGGLE, FORWARD], from_step=3) == (5, 6)


def test_a_subgoal_that_lies_behind_is_no_key_point() -> None:
    assert key_point_steps(CORRIDOR, PATH, (1, 6), [LEFT], from_step=2) == (6,)


@pytest.mark.parametrize("step", [0, 7])
def test_a_question_at_a_step_that_is_not_on_the_path_is_refused(step: int) -> None:
    with pytest.raises(ValueError, match=f"no step {step}; the path has steps 1 to 6"):
        key_point_steps(CORRIDOR, PATH, (1,), [LEFT], from_step=step)


def test_an_action_or_a_state_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="no action 5; there are 5, from 0"):
        roll_out(CORRIDOR, 0, [LEFT, 5])
    with pytest.raises(ValueError, match="no state -1"):
        roll_out(CORRIDOR, -1, [LEFT])


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_agents_own_path_misses_nothing_and_its_beginning_only_what_follows(name: str) -> None:
    mdp = tabulate(LAYOUTS[name])
    path = follow(mdp, plan(mdp))
    every_step = tuple(range(1, path.num_steps + 1))
    assert key_point_steps(mdp, path, every_step, path.actions) == ()
    for stop in range(path.num_steps):
        assert key_point_steps(mdp, path, every_step, path.actions[:stop]) == every_step[stop:]


@given(mdps(), st.data())
def test_key_points_are_the_subgoals_ahead_that_the_route_never_takes(
    mdp: DeterministicMDP, data: st.DataObject
) -> None:
    assume(0 < distances_to_goal(mdp)[mdp.start] < np.inf)
    path = follow(mdp, plan(mdp))
    subgoals = sorted(data.draw(st.sets(st.integers(1, path.num_steps))))
    step = data.draw(st.integers(1, path.num_steps))
    route = data.draw(st.lists(st.integers(0, mdp.num_actions - 1), max_size=6))
    state, taken = path.states[step - 1], set()
    for action in route:
        if not mdp.terminal[state]:
            taken.add((state, action))
            state = int(mdp.next_state[state, action])
    missed = [t for t in subgoals if t >= step and (path.states[t - 1], path.actions[t - 1]) not in taken]
    expected = () if mdp.goal[state] else tuple(missed)
    assert key_point_steps(mdp, path, subgoals, route, step) == expected


@given(mdps(), st.data())
def test_rolling_out_stops_where_the_episode_ends(mdp: DeterministicMDP, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, mdp.num_states - 1))
    route = data.draw(st.lists(st.integers(0, mdp.num_actions - 1), max_size=8))
    rolled_out = roll_out(mdp, start, route)
    assert rolled_out.states[0] == start
    assert list(rolled_out.actions) == route[: rolled_out.num_steps]
    assert not mdp.terminal[list(rolled_out.states[:-1])].any()
    assert rolled_out.num_steps == len(route) or mdp.terminal[rolled_out.states[-1]]
    assert all(mdp.next_state[pair] == rolled_out.states[i + 1] for i, pair in enumerate(rolled_out.pairs))
