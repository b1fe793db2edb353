from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.mdps import mdps, mdps_with_policy
from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import (
    NeverArrives,
    Trajectory,
    distances_to_goal,
    follow,
    meeting_places,
    plan,
    policy_successors,
    random_phase,
    steps_to_goal,
)
from webapp.explainer.worlds.key_door import tabulate


def shortest_length(mdp: DeterministicMDP, start: int) -> float:
    """Search forwards, which the solver does not."""
    queue, lengths = deque([start]), {start: 0}
    while queue:
        state = queue.popleft()
        if mdp.goal[state]:
            return lengths[state]
        for after in mdp.next_state[state].tolist():
            if after not in lengths:
                lengths[after] = lengths[state] + 1
                queue.append(after)
    return float("inf")


def walk(mdp: DeterministicMDP, policy: np.ndarray, state: int) -> tuple[list[int], bool]:
    """Return the states that the policy visits and whether it reaches a goal."""
    visited = [state]
    while not mdp.terminal[state]:
        state = int(mdp.next_state[state, policy[state]])
        if state in visited:
            return visited, False
        visited.append(state)
    return visited, bool(mdp.goal[state])


@given(mdps())
def test_distances_are_those_of_a_forward_search_from_every_state(mdp: DeterministicMDP) -> None:
    expected = [shortest_length(mdp, state) for state in range(mdp.num_states)]
    np.testing.assert_array_equal(distances_to_goal(mdp), expected)


@given(mdps())
def test_the_planner_takes_a_shortest_path_and_the_first_action_that_does(mdp: DeterministicMDP) -> None:
    policy = plan(mdp)
    for state in np.flatnonzero(~mdp.terminal):
        ahead = [shortest_length(mdp, after) for after in mdp.next_state[state].tolist()]
        assert policy[state] == ahead.index(min(ahead))


@given(mdps())
def test_the_planners_path_is_as_long_as_the_distance_or_there_is_none(mdp: DeterministicMDP) -> None:
    length = shortest_length(mdp, mdp.start)
    if length == float("inf"):
        with pytest.raises(NeverArrives):
            follow(mdp, plan(mdp))
    else:
        assert follow(mdp, plan(mdp)).num_steps == length


@given(mdps_with_policy(), st.data())
def test_following_a_policy_ends_in_a_goal_or_names_where_it_loops(
    world: tuple[DeterministicMDP, np.ndarray], data: st.DataObject
) -> None:
    mdp, policy = world
    start = data.draw(st.integers(0, mdp.num_states - 1))
    visited, arrives = walk(mdp, policy, start)
    if arrives:
        path = follow(mdp, policy, start)
        assert list(path.states) == visited
        assert all(mdp.next_state[state, action] == path.states[i + 1] for i, (state, action) in enumerate(path.pairs))
    else:
        with pytest.raises(NeverArrives, match=r"never reaches the goal: .*'s\d'"):
            follow(mdp, policy, start)


def test_a_loop_is_named_by_a_state_that_lies_on_it() -> None:
    table = np.array([[1], [2], [1], [3]], dtype=np.int32)
    end = np.array([False, False, False, True])
    mdp = DeterministicMDP(("tail", "near", "far", "goal"), ("go",), table, end, end.copy(), 0)
    with pytest.raises(NeverArrives, match="it loops through 'near'"):
        follow(mdp, np.zeros(4, dtype=np.int32))


def test_a_path_that_starts_in_the_goal_has_no_steps() -> None:
    mdp = tabulate(lay_out("#####", "#>KD#", "###G#", "#####"))
    goal = int(np.flatnonzero(mdp.goal)[0])
    assert follow(mdp, plan(mdp), goal) == Trajectory((goal,), ())


@given(mdps_with_policy())
def test_a_policys_steps_to_the_goal_are_counted_by_walking(world: tuple[DeterministicMDP, np.ndarray]) -> None:
    mdp, policy = world
    walks = [walk(mdp, policy, state) for state in range(mdp.num_states)]
    expected = [len(visited) - 1 if arrives else float("inf") for visited, arrives in walks]
    np.testing.assert_array_equal(steps_to_goal(mdp, policy), expected)


@given(mdps_with_policy(), st.data())
def test_who_passes_through_a_place_of_the_path_meets_it_there_or_before(
    world: tuple[DeterministicMDP, np.ndarray], data: st.DataObject
) -> None:
    mdp, policy = world
    arriving = [state for state in range(mdp.num_states) if walk(mdp, policy, state)[1]]
    path = follow(mdp, policy, data.draw(st.sampled_from(arriving)))
    meeting = meeting_places(mdp, policy, path)
    for state in range(mdp.num_states):
        visited, arrives = walk(mdp, policy, state)
        passes = [place for place, on_path in enumerate(path.states) if on_path in visited]
        assert passes == list(range(meeting[state], path.num_steps + 1))
        assert arrives == (meeting[state] <= path.num_steps + 1)


def test_a_policy_on_a_long_corridor_is_followed_to_its_end() -> None:
    length = 1000
    after = np.minimum(np.arange(length) + 1, length - 1).astype(np.int32)[:, None]
    end = np.arange(length) == length - 1
    mdp = DeterministicMDP(tuple(range(length)), ("on",), after, end, end.copy(), 0)
    policy = np.zeros(length, dtype=np.int32)
    assert steps_to_goal(mdp, policy).tolist() == distances_to_goal(mdp).tolist() == list(range(length - 1, -1, -1))
    path = follow(mdp, policy, length - 2)
    assert meeting_places(mdp, policy, path).tolist() == [0] * (length - 1) + [1]


@pytest.mark.parametrize("ask", [steps_to_goal, policy_successors])
@pytest.mark.parametrize(
    ("policy", "problem"),
    [
        (np.zeros(3, dtype=np.int32), r"must have shape \(2,\), not \(3,\)"),
        (np.array([1, 0]), r"action indices from 0 to 0"),
        (np.array([-1, 0]), r"action indices from 0 to 0"),
        (np.array([0.5, 0.0]), r"action indices from 0 to 0"),
    ],
)
def test_a_policy_that_is_none_of_the_world_is_refused(
    ask: Callable[[DeterministicMDP, np.ndarray], object], policy: np.ndarray, problem: str
) -> None:
    end = np.array([False, True])
    mdp = DeterministicMDP(("here", "goal"), ("go",), np.array([[1], [1]], dtype=np.int32), end, end, 0)
    with pytest.raises(ValueError, match=problem):
        ask(mdp, policy)
    assert policy_successors(mdp, np.array([0, 7])).tolist() == [1, 1]  # What is said of a goal is never used.


@given(mdps(), st.integers(0, 6), st.data())
def test_the_random_phase_is_a_power_of_the_matrix_of_random_steps(
    mdp: DeterministicMDP, num_steps: int, data: st.DataObject
) -> None:
    start = data.draw(st.integers(0, mdp.num_states - 1))
    forbidden = data.draw(
        st.none() | st.tuples(st.integers(0, mdp.num_states - 1), st.integers(0, mdp.num_actions - 1))
    )
    matrix = np.zeros((mdp.num_states, mdp.num_states))
    for state in range(mdp.num_states):
        allowed = [
            after
            for action, after in enumerate(mdp.next_state[state].tolist())
            if after != state and not mdp.terminal[after] and (state, action) != forbidden
        ]
        for after in allowed or [state]:
            matrix[state, after] += 1 / len(allowed or [state])
    expected = np.linalg.matrix_power(matrix, num_steps)[start]
    found = random_phase(mdp, start, num_steps, forbidden=forbidden)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert found.sum() == pytest.approx(1)


@pytest.mark.parametrize("name", LAYOUTS)
def test_random_actions_never_reach_the_goal(name: str) -> None:
    mdp = tabulate(LAYOUTS[name])
    path = follow(mdp, plan(mdp))
    for state in path.states[:-1]:
        assert not random_phase(mdp, state, 10)[mdp.terminal].any()


def test_a_negative_number_of_random_actions_is_refused() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    with pytest.raises(ValueError, match="must be 0 or larger, not -2"):
        random_phase(mdp, 0, -2)


def test_a_trajectory_joins_each_two_states_by_an_action() -> None:
    with pytest.raises(ValueError, match="2 actions join 3 states, not 2"):
        Trajectory((0, 1), (0, 0))


@given(mdps())
def test_what_is_left_of_a_path_follows_on_what_was_cut_off(mdp: DeterministicMDP) -> None:
    assume(0 < shortest_length(mdp, mdp.start) < float("inf"))
    path = follow(mdp, plan(mdp))
    for step in range(1, path.num_steps + 1):
        left = path.from_step(step)
        assert path.states[: step - 1] + left.states == path.states
        assert path.actions[: step - 1] + left.actions == path.actions
    for step in (0, path.num_steps + 1):
        with pytest.raises(ValueError, match=f"no step {step}; the path has steps 1 to {path.num_steps}"):
            path.from_step(step)
