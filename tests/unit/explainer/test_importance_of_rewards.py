"""What the best action is worth: by hand, by walking, and against fractions, with and without a linear system."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.mdps import mdps_with_policy, oracle_of
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, some_path
from tests.worlds import LAYOUTS
from webapp.explainer import importance_stochastic
from webapp.explainer.importance import exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan
from webapp.explainer.stochastic import StochasticMDP, from_outcomes
from webapp.explainer.worlds.key_door import tabulate

ROUNDING = 1e-11
"""The worlds of these tests hold decimals of fractions, which a discounted sum magnifies."""


@st.composite
def worlds_with_detours(draw: st.DrawFn) -> tuple[DeterministicMDP, np.ndarray]:
    """Draw a world whose first action always leads on, its second anywhere, its third nowhere, and mix the three.

    The policy leads on. The second arrives as well or comes back, and to wait often has the higher plain value.
    """
    size = draw(st.integers(2, 8))
    rows = [(draw(st.integers(s + 1, size - 1)), draw(st.integers(0, size - 1)), s) for s in range(size - 1)]
    order = draw(st.permutations(range(3)))
    table = np.array([*rows, (size - 1,) * 3], dtype=np.int32)[:, order]
    end = np.arange(size) == size - 1
    mdp = DeterministicMDP(tuple(range(size)), ("a0", "a1", "a2"), table, end, end.copy(), 0)
    return mdp, np.full(size, order.index(0), dtype=np.int32)


@given(
    st.one_of(mdps_with_policy(), worlds_with_detours()),
    st.sampled_from([0, Fraction(1, 2), Fraction(9, 10), Fraction(99, 100)]),
)
def test_reward_importance_needs_no_linear_system(
    world: tuple[DeterministicMDP, np.ndarray], discount: Fraction
) -> None:
    mdp, policy = world
    try:
        path = follow(mdp, policy)
    except NeverArrives:
        assume(False)
        raise
    found = exact_importance("reward_importance", mdp, policy, path, discount=float(discount))
    assert found.error_bound == 0
    expected, bound = importance_stochastic.reward_importance(mdp, policy, path, float(discount))
    np.testing.assert_allclose(found.values[:-1], expected, rtol=0, atol=bound + 1e-12)
    oracle = oracle_of(mdp, policy)
    walked = [float(oracle.reward_importance(state, Fraction(discount))) for state in path.states[:-1]]
    np.testing.assert_allclose(found.values[:-1], walked, rtol=0, atol=1e-12)


def test_by_hand_what_an_action_is_worth() -> None:
    # 0 leads to 1 by a0 and to 2 by a1; 1 to the goal 4 by a0 and back by a1; 2 to 3, 3 to the goal; a2 stays.
    # Discount 1/2: from 1 the goal is entered at once, 1; from 0, 1/2; the detour from 0 takes three actions, 1/4.
    # Without a0, 1 goes back for ever and earns nothing.
    table = np.array([[1, 2, 0], [4, 0, 1], [3, 3, 2], [4, 4, 3], [4, 4, 4]], dtype=np.int32)
    end = np.arange(5) == 4
    mdp = DeterministicMDP(tuple(range(5)), ("a0", "a1", "a2"), table, end, end.copy(), 0)
    policy = np.zeros(5, dtype=np.int32)
    found = exact_importance("reward_importance", mdp, policy, follow(mdp, policy), discount=0.5)
    assert found.values.tolist() == [1 / 4, 1, 0]


def test_by_hand_waiting_for_ever_is_not_the_best_other_action() -> None:
    # 0 leads to the goal 3 by a0, waits by a1, and takes the detour 1, 2 by a2. Discount 1/2: a0 is worth 1, the detour
    # enters the goal with the third action, 1/4, lost 3/4. Waiting once and then going on is worth 1/2, more than the
    # detour: ranked by that, it would be repeated for ever, and all of the 1 lost. In 1 and 2 one can but wait.
    table = np.array([[3, 0, 1], [2, 1, 1], [3, 2, 2], [3, 3, 3]], dtype=np.int32)
    end = np.arange(4) == 3
    mdp = DeterministicMDP(tuple(range(4)), ("on", "wait", "detour"), table, end, end.copy(), 0)
    policy = np.zeros(4, dtype=np.int32)
    found = exact_importance("reward_importance", mdp, policy, follow(mdp, policy), discount=0.5)
    assert found.values.tolist() == [3 / 4, 0]
    detour = Trajectory((1, 2, 3), (0, 0))
    assert exact_importance("reward_importance", mdp, policy, detour, discount=0.5).values.tolist() == [1 / 2, 1, 0]


def test_most_steps_of_open_floor_cost_a_detour_and_not_all_there_is() -> None:
    # Picking up what is not there waits anywhere, and waiting for ever would lose all at most steps. From the start the
    # goal is 20 actions off, worth .99^19; who may not go on there turns first and arrives two actions later. Step 7
    # picks up the key, worth .99^13: without it nobody arrives.
    mdp = tabulate(LAYOUTS["simulation"])
    path = follow(mdp, plan(mdp))
    found = exact_importance("reward_importance", mdp, plan(mdp), path).values[:-1]
    assert found[0] == pytest.approx(0.99**19 - 0.99**21, abs=1e-12)
    assert found[6] == pytest.approx(0.99**13, abs=1e-12)
    assert np.count_nonzero(found < 0.04) == 12
    assert {step + 1 for step in np.flatnonzero(found > 0.8)} == {6, 7, 13, 14, 15, 16, 19, 20}


def test_of_equally_good_other_actions_the_one_that_does_not_lead_back_is_taken_in_any_order() -> None:
    # 0 leads to the goal 4. Its other actions lead to 1, from which the policy returns to 0, and to 2, from which it
    # goes by 3: both two actions from the goal. Whoever always goes to 1 goes round for ever; by 3 it takes three
    # actions, worth 1/4 at the discount 1/2.
    table = np.array([[4, 1, 2], [0, 1, 1], [3, 2, 2], [4, 3, 3], [4, 4, 4]], dtype=np.int32)
    end = np.arange(5) == 4
    for order in ([0, 1, 2], [0, 2, 1]):
        mdp = DeterministicMDP(tuple(range(5)), ("a0", "a1", "a2"), table[:, order], end, end.copy(), 0)
        policy = np.zeros(5, dtype=np.int32)
        found = exact_importance("reward_importance", mdp, policy, follow(mdp, policy), discount=0.5)
        assert found.values.tolist() == [3 / 4, 0]


def test_where_nothing_else_can_be_done_all_is_lost() -> None:
    table = np.array([[1], [2], [2]], dtype=np.int32)
    end = np.arange(3) == 2
    mdp = DeterministicMDP(tuple(range(3)), ("on",), table, end, end.copy(), 0)
    policy = np.zeros(3, dtype=np.int32)
    found = exact_importance("reward_importance", mdp, policy, follow(mdp, policy), discount=0.5)
    assert found.values.tolist() == [1 / 2, 1, 0]


def try_or_detour() -> StochasticMDP:
    """0 leads to the goal 2 by a0 and a3; a1 gets there one time in four and else stays, a2 goes by 1."""
    outcomes = [(0, 0, 2, 1), (0, 1, 2, 0.25), (0, 1, 0, 0.75), (0, 2, 1, 1), (0, 3, 2, 1)]
    outcomes += [(1, action, 2, 1) for action in range(4)]
    end = np.arange(3) == 2
    return from_outcomes(range(3), ("a0", "a1", "a2", "a3"), outcomes, terminal=end, goal=end, start=0)


def test_by_hand_the_other_action_is_the_best_one_while_the_prohibition_lasts() -> None:
    # Discount 1/2: a0 and a3 are worth 1, and so is being in 1: the detour a2 is worth 1/2, lost 1/2. Trying a1 once
    # and then going on is worth 1/4 + 1/2 * 3/4 = 5/8, more than the detour. Ranked by that it would be tried again and
    # again, v = 1/4 + 3/8 v = 2/5, and 3/5 lost.
    mdp, path = try_or_detour(), Trajectory((0, 2), (0,))
    either = np.array([[1 / 2, 0, 0, 1 / 2], [1, 0, 0, 0], [1, 0, 0, 0]])
    found = exact_importance("reward_importance", mdp, either, path, discount=0.5)
    assert found.values == pytest.approx([1 / 2, 0], abs=1e-14)
    # Where all but a1 may be taken it alone is left, and is tried again and again. Free: (1 + 1/2 + 1) / 3.
    third = np.array([[1 / 3, 0, 1 / 3, 1 / 3], [1, 0, 0, 0], [1, 0, 0, 0]])
    found = exact_importance("reward_importance", mdp, third, path, discount=0.5)
    assert found.values == pytest.approx([5 / 6 - 2 / 5, 0], abs=1e-14)


@given(st.one_of(fraction_worlds(max_states=4), fraction_worlds(max_states=4, waiting=True)))
@settings(max_examples=80)
def test_the_other_action_is_the_best_of_all_worlds_that_forbid_the_policys(drawn: FractionWorld) -> None:
    path = some_path(drawn)
    assume(path is not None)
    assert path is not None
    lost = exact_importance("reward_importance", as_mdp(drawn), policy_of(drawn), path, discount=0.9)
    expected = [float(drawn.reward_importance(state, Fraction(9, 10))) for state in path.states[:-1]]
    assert lost.values == pytest.approx([*expected, 0.0], abs=lost.error_bound + ROUNDING)
    assert lost.error_bound < 1e-9


@given(fraction_worlds())
@settings(max_examples=200)
def test_where_a_state_is_not_met_again_the_other_action_has_the_highest_plain_value(drawn: FractionWorld) -> None:
    path = some_path(drawn)
    assume(path is not None)
    assert path is not None
    lost = exact_importance("reward_importance", as_mdp(drawn), policy_of(drawn), path, discount=0.9)
    for state, found in zip(path.states[:-1], lost.values, strict=False):
        if drawn.others(state) and not drawn.meets_again(state):
            worth = drawn.action_values(state, Fraction(9, 10))
            own = sum(share * worth[action] for action, share in drawn.policy[state].items())
            expected = own - max(worth[action] for action in drawn.others(state))
            assert found == pytest.approx(float(expected), abs=lost.error_bound + ROUNDING)


def test_a_discount_out_of_range_or_a_path_off_the_policy_is_refused_for_rewards() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    path = follow(mdp, policy)
    for discount in (-0.1, 1.0, float("nan")):
        with pytest.raises(ValueError, match="the discount must lie from 0 up to, not including, 1"):
            exact_importance("reward_importance", mdp, policy, path, discount=discount)
    with pytest.raises(ValueError, match="the path leaves the policy"):
        exact_importance("reward_importance", mdp, policy, Trajectory(path.states, (4, *path.actions[1:])))
