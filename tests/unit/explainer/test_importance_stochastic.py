"""Importance in worlds with chances: by hand, against fractions, and against the deterministic solver."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.mdps import mdps
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, some_path
from tests.worlds import LAYOUTS
from webapp.explainer import importance_stochastic
from webapp.explainer.importance import Importance, exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import Trajectory, distances_to_goal, follow, plan, tie_averaged_policy
from webapp.explainer.stochastic import AnyPolicy, StochasticMDP, World, from_deterministic, from_outcomes
from webapp.explainer.worlds.key_door import tabulate

ROUNDING = 1e-11
"""The worlds of these tests hold decimals of fractions, which a discounted sum magnifies."""
GOLDEN = 1e-14


def return_probability(world: World, policy: AnyPolicy, path: Trajectory, random_steps: int) -> Importance:
    """Never takes the way without a linear system, whatever the world."""
    return _complete(importance_stochastic.return_probability(world, policy, path, random_steps))


def ace(world: World, policy: AnyPolicy, path: Trajectory, random_steps: int) -> Importance:
    return _complete(importance_stochastic.ace(world, policy, path, random_steps))


def reward_importance(world: World, policy: AnyPolicy, path: Trajectory, discount: float = 0.99) -> Importance:
    return _complete(importance_stochastic.reward_importance(world, policy, path, discount))


def _complete(found: importance_stochastic.Bounded) -> Importance:
    values, bound = found
    return Importance(np.append(values, 0.0), error_bound=bound)


def world(num_actions: int, outcomes: list[tuple[int, int, int, float]], ends: list[int]) -> StochasticMDP:
    """States by index, up to the last end, which is the goal."""
    index = np.arange(ends[-1] + 1)
    terminal, goal = np.isin(index, ends), index == ends[-1]
    names = [f"a{action}" for action in range(num_actions)]
    return from_outcomes(index.tolist(), names, outcomes, terminal=terminal, goal=goal, start=0 if 0 not in ends else 1)


def first_action(mdp: StochasticMDP | DeterministicMDP) -> np.ndarray:
    return np.zeros(mdp.num_states, dtype=np.int32)


def test_by_hand_the_gamblers_ruin() -> None:
    # 0 broke, 3 rich, one step up with 2/3 and down with 1/3. No action can be random: each may end the episode, or is
    # the only one. Back to 1: up to 2 (2/3), then down (1/3): 2/9. Back to 2: down (1/3), then up (2/3): 2/9.
    # Rich from 1: x1 = 2/3 x2 and x2 = 2/3 + 1/3 x1, so 4/7 and 6/7; nobody moves when the only action is forbidden.
    # Rewards at discount 1/2: v2 = 2/3 + v1/6 and v1 = v2/3, so v2 = 12/17 and v1 = 4/17; without the action, nothing.
    outcomes = [(s, 0, s + side, p) for s in (1, 2) for side, p in ((1, 2 / 3), (-1, 1 / 3))]
    mdp, path = world(1, outcomes, [0, 3]), Trajectory((1, 2, 3), (0, 0))
    for random_steps in (0, 5):
        returned = return_probability(mdp, first_action(mdp), path, random_steps)
        assert returned.values == pytest.approx([2 / 9, 2 / 9, 0], abs=GOLDEN)
        assert ace(mdp, first_action(mdp), path, random_steps).values == pytest.approx([4 / 7, 6 / 7, 0], abs=GOLDEN)
    rewards = reward_importance(mdp, first_action(mdp), path, discount=0.5)
    assert rewards.values == pytest.approx([4 / 17, 12 / 17, 0], abs=GOLDEN)


def test_by_hand_a_step_that_slips() -> None:
    # 0 --a0--> 1 half the time, else it stays; 1 --a0--> goal 2; a1 leads from 1 back to 0 and does nothing in 0.
    # Selectable: a0 in 0, a1 in 1. One random action from 0: half in 0, from where the policy's next step returns with
    # 1/2; half in 1, from where it leaves: 1/4. Two: half (0 again: half 0, half 1), half (1, back to 0), so 3/4 in 0
    # and 3/8 return. From 1: one leads to 0, from where the policy surely comes: 1. Two: half in 0 (returns), half in 1
    # (leaves): 1/2. Without random actions: 0 stays on itself with 1/2, 1 never returns.
    mdp = world(2, [(0, 0, 1, 0.5), (0, 0, 0, 0.5), (0, 1, 0, 1), (1, 0, 2, 1), (1, 1, 0, 1)], [2])
    path = Trajectory((0, 1, 2), (0, 0))
    for random_steps, expected in ((0, [1 / 2, 0, 0]), (1, [1 / 4, 1, 0]), (2, [3 / 8, 1 / 2, 0])):
        found = return_probability(mdp, first_action(mdp), path, random_steps)
        assert found.values == pytest.approx(expected, abs=GOLDEN)
    # The goal lies behind 0 and 1 only, so that whoever may not act there misses it: 1 for both.
    assert ace(mdp, first_action(mdp), path, 2).values == pytest.approx([1, 1, 0], abs=GOLDEN)


DETOUR = [
    (0, 0, 1, 1),
    (0, 1, 2, 1),
    (1, 0, 3, 1),
    (1, 1, 0, 1),
    (2, 0, 3, 0.5),
    (2, 0, 0, 0.5),
    (2, 1, 2, 1),
]
"""0 leads to 1 and that to the goal 3; a1 goes from 0 to a detour, 2, that arrives half the time or starts over."""


def test_by_hand_a_detour_that_may_start_over() -> None:
    mdp, path = world(2, DETOUR, [3]), Trajectory((0, 1, 3), (0, 0))
    # One random action from 0: half in 1 (never back), half in 2 (back with 1/2): 1/4. From 1: only back to 0, and from
    # there the policy comes to 1: 1.
    returned = return_probability(mdp, first_action(mdp), path, 1)
    assert returned.values == pytest.approx([1 / 4, 1, 0], abs=GOLDEN)
    # a0 forbidden in 0: surely to 2, and from there to the goal with 1/2: 1 - 1/2. In 1: back to 0 and then stuck in 1.
    assert ace(mdp, first_action(mdp), path, 1).values == pytest.approx([1 / 2, 1, 0], abs=GOLDEN)
    # Discount 1/2: v1 = 1, v0 = 1/2, v2 = 1/2 + 1/4 v0. Always a1 in 0: v = 1/2 (1/2 + 1/4 v) = 2/7, lost 1/2 - 2/7.
    # Always a1 in 1: it goes round for ever, lost 1.
    lost = reward_importance(mdp, first_action(mdp), path, discount=0.5)
    assert lost.values == pytest.approx([3 / 14, 1, 0], abs=GOLDEN)


def test_by_hand_rewards_that_the_world_names() -> None:
    # As above, but every action costs 1 and entering the goal from 1 by a0 pays 5 on top: r = 4 there, else -1.
    # Discount 1/2: v1 = 4, v0 = -1 + 2 = 1, and always a1 in 0: v = -1 + 1/2 (-1 + 1/4 v) = -3/2 + v/8 = -12/7.
    mdp = world(2, DETOUR, [3])
    reward = np.full((4, 2), -1.0)
    reward[1, 0], reward[3] = 4, 0
    costly = from_outcomes(
        mdp.states, mdp.actions, DETOUR, terminal=mdp.terminal, goal=mdp.goal, start=0, reward=reward
    )
    lost = reward_importance(costly, first_action(mdp), Trajectory((0, 1, 3), (0, 0)), discount=0.5)
    # In 1: v = -1 + 1/2 (-1 + 1/2 v) = -3/2 + v/4 = -2, lost 6.
    assert lost.values == pytest.approx([19 / 7, 6, 0], abs=1e-13)


def test_by_hand_two_ways_that_are_equally_short() -> None:
    # 0 leads by a0 to 1 and by a1 to 2; both lead by a0 to the goal 3 and by a1 back. One random action from 1 leads to
    # 0, from where the averaged policy comes back to 1 half the time, and the planner's always.
    table = np.array([[1, 2], [3, 0], [3, 0], [3, 3]], dtype=np.int32)
    ends = np.array([False, False, False, True])
    mdp = DeterministicMDP(("s", "u", "v", "G"), ("a0", "a1"), table, ends, ends, 0)
    path, averaged = follow(mdp, plan(mdp)), tie_averaged_policy(mdp)
    assert averaged[:3].tolist() == [[0.5, 0.5], [1, 0], [1, 0]]
    assert return_probability(mdp, averaged, path, 1).values == pytest.approx([0, 1 / 2, 0], abs=GOLDEN)
    assert return_probability(mdp, plan(mdp), path, 1).values == pytest.approx([0, 1, 0], abs=GOLDEN)
    # In 0 both actions are optimal, so none is left; without a0 in 1, half arrive by way of 2.
    assert ace(mdp, averaged, path, 1).values == pytest.approx([1, 1 / 2, 0], abs=GOLDEN)


@given(fraction_worlds(max_states=4), st.integers(0, 2))
@settings(max_examples=60)
def test_importance_equals_brute_force_in_fractions(drawn: FractionWorld, random_steps: int) -> None:
    path = some_path(drawn)
    assume(path is not None)
    assert path is not None
    mdp, policy = as_mdp(drawn), policy_of(drawn)
    states = path.states[:-1]
    returned = return_probability(mdp, policy, path, random_steps)
    caused = ace(mdp, policy, path, random_steps)
    lost = reward_importance(mdp, policy, path, discount=0.9)
    agree(returned, [drawn.return_probability(state, random_steps) for state in states])
    agree(caused, [drawn.ace(state, random_steps) for state in states])
    agree(lost, [drawn.reward_importance(state, Fraction(9, 10)) for state in states])


def agree(found: Importance, expected: list[Fraction]) -> None:
    assert found.values == pytest.approx([*map(float, expected), 0.0], abs=found.error_bound + ROUNDING)
    assert found.error_bound < 1e-9


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_six_layouts_agree_with_the_deterministic_solver(name: str) -> None:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    path = follow(mdp, policy)
    for kind, solve in (("return_probability", return_probability), ("ace", ace)):
        expected = exact_importance(kind, mdp, policy, path, 10)  # type: ignore[arg-type]
        found = solve(from_deterministic(mdp), policy, path, 10)
        assert found.values == pytest.approx(expected.values, abs=1e-9)


def test_the_order_of_the_actions_makes_no_difference_under_the_averaged_policy() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    backwards = replace(mdp, actions=mdp.actions[::-1], next_state=mdp.next_state[:, ::-1])
    path = follow(mdp, plan(mdp))
    mirrored = Trajectory(path.states, tuple(mdp.num_actions - 1 - action for action in path.actions))
    for solve in (return_probability, ace):
        values = solve(mdp, tie_averaged_policy(mdp), path, 10).values
        assert solve(backwards, tie_averaged_policy(backwards), mirrored, 10).values == pytest.approx(values, abs=1e-12)
        single = solve(mdp, plan(mdp), path, 10).values
        assert np.abs(solve(backwards, plan(backwards), mirrored, 10).values - single).max() > 0.1


@given(mdps())
def test_the_averaged_policy_takes_each_shortest_way_alike(mdp: DeterministicMDP) -> None:
    distances, policy = distances_to_goal(mdp), tie_averaged_policy(mdp)
    for state in np.flatnonzero(np.isfinite(distances) & ~mdp.terminal):
        nearer = [distances[after] == distances[state] - 1 for after in mdp.next_state[state]]
        assert policy[state].tolist() == [near / sum(nearer) for near in nearer]
    assert policy.sum(axis=1) == pytest.approx(np.ones(mdp.num_states))


def test_a_path_that_the_policy_cannot_take_is_refused() -> None:
    mdp = world(2, DETOUR, [3])
    for path, message in (
        (Trajectory((0, 2, 3), (1, 0)), r"the path leaves the policy in 0"),
        (Trajectory((0, 2, 3), (0, 0)), r"the path leaves the policy in 0"),
        (Trajectory((0, 1), (0,)), r"the path must end in a goal, not in 1"),
    ):
        for solve in (return_probability, ace):
            with pytest.raises(ValueError, match=message):
                solve(mdp, first_action(mdp), path, 1)
        with pytest.raises(ValueError, match=message):
            reward_importance(mdp, first_action(mdp), path)


def test_numbers_out_of_range_are_refused() -> None:
    mdp, path = world(2, DETOUR, [3]), Trajectory((0, 1, 3), (0, 0))
    for solve in (return_probability, ace):
        with pytest.raises(ValueError, match=r"random actions must be 0 or larger, not -1"):
            solve(mdp, first_action(mdp), path, -1)
    for discount in (-0.1, 1.0, float("nan")):
        with pytest.raises(ValueError, match=r"the discount must lie from 0 up to, not including, 1"):
            reward_importance(mdp, first_action(mdp), path, discount)


@pytest.mark.parametrize(
    ("values", "bound", "message"),
    [
        ([], 0.0, r"importance must have shape \[T \+ 1\], not \(0,\)"),
        ([0.5, 0.5], 0.0, r"the target's importance is 0 by definition"),
        ([np.nan, 0.0], 0.0, r"importance must be finite numbers"),
        ([0.5, 0.0], np.nan, r"an error bound is 0 or larger, not nan"),
    ],
)
def test_importance_that_cannot_be_is_refused(values: list[float], bound: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Importance(np.array(values), error_bound=bound)


def test_a_path_of_the_target_alone_has_the_importance_zero() -> None:
    mdp, path = world(2, DETOUR, [3]), Trajectory((3,), ())
    for found in (return_probability(mdp, first_action(mdp), path, 1), reward_importance(mdp, first_action(mdp), path)):
        assert (found.values.tolist(), found.error_bound) == ([0.0], 0.0)


def test_a_policy_that_loops_where_the_path_does_not_go_neither_returns_nor_arrives() -> None:
    # As the detour, but from 2 the policy stays there for ever. One random action from 0: half in 1, half in 2.
    looping = [entry for entry in DETOUR if entry[:2] not in {(2, 0), (2, 1)}] + [(2, 0, 2, 1.0), (2, 1, 3, 1.0)]
    mdp, path = world(2, looping, [3]), Trajectory((0, 1, 3), (0, 0))
    assert return_probability(mdp, first_action(mdp), path, 1).values == pytest.approx([0, 1, 0], abs=GOLDEN)
    # Allowed, half arrive from 0; denied, all are in 2. From 1 all go back to 0: allowed they arrive, denied not.
    assert ace(mdp, first_action(mdp), path, 1).values == pytest.approx([1 / 2, 1, 0], abs=GOLDEN)
    # Discount 1/2: v0 = 1/2, and always a1 there ends in 2 for ever.
    lost = reward_importance(mdp, first_action(mdp), path, discount=0.5)
    assert lost.values == pytest.approx([1 / 2, 1, 0], abs=GOLDEN)
