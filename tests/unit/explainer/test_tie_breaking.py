from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.mdps import mdps, planned_path
from webapp.explainer.mdp import DeterministicMDP, enumerate_mdp
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.tie_breaking import check_optimal_actions, every_tie, random_tie_break, shortest_path_actions


def open_floor(size: int = 4) -> DeterministicMDP:
    """A square without walls, crossed from one corner to the other: every way that never turns back is as short."""
    moves = ((1, 0), (0, 1), (-1, 0), (0, -1))

    def step(cell: tuple[int, int], action: int) -> tuple[tuple[int, int], bool]:
        x, y = (min(size - 1, max(0, part + move)) for part, move in zip(cell, moves[action], strict=True))
        return (x, y), (x, y) == (size - 1, size - 1)

    return enumerate_mdp((0, 0), ("east", "south", "west", "north"), step)


def steps_left(mdp: DeterministicMDP, state: int) -> int | None:
    """How far the goal is, found by walking everywhere from the state."""
    known = {state: 0}
    for here in (queue := [state]):
        if mdp.goal[here]:
            return known[here]
        for after in mdp.next_state[here].tolist():
            if after not in known:
                known[after] = known[here] + 1
                queue.append(after)
    return None


@given(mdps())
def test_an_action_is_optimal_where_the_goal_comes_one_step_nearer(mdp: DeterministicMDP) -> None:
    optimal = shortest_path_actions(mdp)
    left = [steps_left(mdp, state) for state in range(mdp.num_states)]
    for state in range(mdp.num_states):
        for action in range(mdp.num_actions):
            here, after = left[state], left[mdp.next_state[state, action]]
            nearer = here is not None and after is not None and after == here - 1
            assert optimal[state, action] == nearer


@given(mdps(), st.integers(0, 5), st.integers(1, 5))
def test_a_random_tie_break_keeps_the_path_and_is_as_short_from_everywhere_else(
    mdp: DeterministicMDP, seed: int, number: int
) -> None:
    policy, path = planned_path(mdp)
    drawn = random_tie_break(shortest_path_actions(mdp), policy, path, seed, number)
    assert drawn.dtype == policy.dtype
    assert follow(mdp, drawn) == path
    for state in range(mdp.num_states):
        left = steps_left(mdp, state)
        if left is not None:
            assert follow(mdp, drawn, state).num_steps == left
        elif not mdp.terminal[state]:
            assert drawn[state] == policy[state]


def test_each_optimal_action_is_drawn_equally_often_and_states_apart() -> None:
    mdp = open_floor()
    policy = plan(mdp)
    path = follow(mdp, policy)
    optimal, num_draws = shortest_path_actions(mdp), 1000
    drawn = [random_tie_break(optimal, policy, path, 0, number) for number in range(1, num_draws + 1)]
    one, other = mdp.index[0, 1], mdp.index[1, 2]
    for state in (one, other):
        assert Counter(int(each[state]) for each in drawn)[0] == pytest.approx(num_draws / 2, abs=80)
    assert sum(each[one] == each[other] for each in drawn) == pytest.approx(num_draws / 2, abs=80)


def test_a_draw_depends_on_the_seed_and_on_its_number_alone() -> None:
    mdp = open_floor()
    policy = plan(mdp)
    path, optimal = follow(mdp, policy), shortest_path_actions(mdp)
    draws = {
        (seed, number): tuple(random_tie_break(optimal, policy, path, seed, number))
        for seed in (0, 1)
        for number in (1, 2)
    }
    assert len(set(draws.values())) == 4
    assert draws[1, 2] == tuple(random_tie_break(optimal, policy, path, 1, 2))


def test_all_optimal_actions_are_equally_likely_where_ties_are_not_broken() -> None:
    mdp = open_floor(3)
    chances = every_tie(shortest_path_actions(mdp), plan(mdp))
    np.testing.assert_array_equal(chances[mdp.index[0, 0]], [0.5, 0.5, 0, 0])
    np.testing.assert_array_equal(chances[mdp.index[2, 0]], [0, 1, 0, 0])
    np.testing.assert_array_equal(chances.sum(axis=1), np.ones(mdp.num_states))


def test_where_nothing_is_optimal_the_policy_stays_by_its_likeliest_action() -> None:
    optimal = np.array([[True, True, False], [False, False, False]])
    likely = np.array([[0.2, 0.2, 0.6], [0.1, 0.6, 0.3]])
    nowhere = Trajectory((0,), ())
    for policy in (likely, np.array([2, 1], dtype=np.int32)):
        assert random_tie_break(optimal, policy, nowhere, 0, 1)[1] == 1
        np.testing.assert_array_equal(every_tie(optimal, policy), [[0.5, 0.5, 0], [0, 1, 0]])


def test_a_table_of_optimal_actions_must_fit_and_allow_the_path() -> None:
    mdp = open_floor()
    path = follow(mdp, plan(mdp))
    check_optimal_actions(mdp, shortest_path_actions(mdp), path)
    with pytest.raises(ValueError, match=r"optimal actions must be \(16, 4\) booleans, not \(4, 16\) of bool"):
        check_optimal_actions(mdp, shortest_path_actions(mdp).T, path)
    with pytest.raises(ValueError, match=r"must be \(16, 4\) booleans, not \(16, 4\) of int"):
        check_optimal_actions(mdp, shortest_path_actions(mdp).astype(int), path)
    with pytest.raises(ValueError, match=r"'east', which the path takes in \(0, 0\), is none; name the optimal"):
        check_optimal_actions(mdp, shortest_path_actions(mdp) & np.array([False, True, True, True]), path)
