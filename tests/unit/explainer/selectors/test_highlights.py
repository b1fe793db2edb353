from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.mdps import mdps_with_policy
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, reach_in_fractions
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.selectors import context_frames, highlights, highlights_steps, q_gaps
from webapp.explainer.solvers import Trajectory, tie_averaged_policy
from webapp.explainer.stochastic import from_deterministic


def discounted(mdp: DeterministicMDP, policy: np.ndarray, state: int, discount: float) -> float:
    """Walk, and discount the reward by the number of steps."""
    worth = 1.0
    for _ in range(mdp.num_states + 1):
        if mdp.goal[state]:
            return worth
        if mdp.terminal[state]:
            return 0.0
        state = int(mdp.next_state[state, policy[state]])
        worth *= discount
    return 0.0


@given(mdps_with_policy(), st.sampled_from([0.5, 0.99, 1.0]))
def test_a_gap_is_the_best_minus_the_worst_action_that_changes_the_state(
    world: tuple[DeterministicMDP, np.ndarray], discount: float
) -> None:
    mdp, policy = world
    gaps = q_gaps(mdp, policy, discount)
    for state in range(mdp.num_states):
        after = {int(new) for new in mdp.next_state[state]} - {state}
        worth = [discounted(mdp, policy, new, discount) for new in after]
        assert gaps[state] == pytest.approx(max(worth) - min(worth) if worth else 0.0, abs=1e-12)


def expected_worth(world: FractionWorld, discount: Fraction) -> dict[int, Fraction]:
    """Solve for the discounted reward of arriving: at each step the episode breaks off with the rest of a chance."""
    broken_off = len(world.states)
    chain = world.chain()
    thinned = {
        state: {after: discount * p for after, p in moves.items()} | {broken_off: 1 - discount}
        for state, moves in chain.items()
        if state not in world.ended
    }
    ended = {state: {state: Fraction(1)} for state in (*world.ended, broken_off)}
    return reach_in_fractions(thinned | ended, world.goals)


@settings(max_examples=60)
@given(fraction_worlds(), st.sampled_from([Fraction(1, 2), Fraction(99, 100), Fraction(1)]))
def test_in_a_stochastic_world_a_gap_compares_expected_values(world: FractionWorld, discount: Fraction) -> None:
    worth = expected_worth(world, discount)
    gaps = q_gaps(as_mdp(world), policy_of(world), float(discount))
    for state in world.states:
        after = [world.outcomes[state, action] for action in range(world.num_actions)]
        means = [sum(p * worth[new] for new, p in chances.items()) for chances in after if set(chances) != {state}]
        assert gaps[state] == pytest.approx(float(max(means) - min(means)) if means else 0.0, abs=1e-9)


@given(mdps_with_policy())
def test_a_world_with_certain_outcomes_has_the_same_gaps_either_way(world: tuple[DeterministicMDP, np.ndarray]) -> None:
    mdp, policy = world
    assert q_gaps(from_deterministic(mdp), policy) == pytest.approx(q_gaps(mdp, policy), abs=1e-12)
    averaged = tie_averaged_policy(mdp)
    assert q_gaps(mdp, averaged) == pytest.approx(q_gaps(from_deterministic(mdp), averaged), abs=1e-12)


@pytest.mark.parametrize("discount", [0.0, -1.0, 1.01, float("nan")])
def test_a_discount_outside_its_range_is_refused(discount: float) -> None:
    goal = np.array([True])
    mdp = DeterministicMDP(("end",), ("x",), np.zeros((1, 1), dtype=np.int32), goal, goal, 0)
    with pytest.raises(ValueError, match="the discount must lie above 0 and be at most 1"):
        q_gaps(mdp, np.zeros(1, dtype=np.int32), discount)


def straight(num_steps: int) -> Trajectory:
    return Trajectory(tuple(range(num_steps + 1)), (0,) * num_steps)


@given(st.lists(st.integers(0, 5), min_size=2, max_size=20), st.integers(1, 6), st.data())
def test_the_budget_is_filled_and_the_largest_gap_is_always_chosen(
    gaps: list[int], min_gap: int, data: st.DataObject
) -> None:
    path = straight(len(gaps) - 1)
    count = data.draw(st.integers(1, path.num_steps))
    steps = highlights_steps(np.array(gaps, dtype=np.float64), path, count, min_gap)
    assert list(steps) == sorted(set(steps))
    assert len(steps) == count
    assert 1 + int(np.argmax(gaps[:-1])) in steps
    if count > 1 and (2 * min_gap - 1) * (count - 1) < path.num_steps:  # However unluckily the first ones lie.
        assert min(np.diff(steps)) >= min_gap


def test_steps_that_lie_too_close_are_passed_over_while_there_are_others() -> None:
    gaps = np.array([0.1, 0.9, 0.8, 0.2, 0.3, 0.0])
    assert highlights_steps(gaps, straight(5), 2) == (2, 5)
    assert highlights_steps(gaps, straight(5), 2, min_gap=1) == (2, 3)
    assert highlights_steps(gaps, straight(5), 4) == (2, 3, 4, 5)


def test_a_minimum_gap_below_one_is_refused() -> None:
    with pytest.raises(ValueError, match="the minimum gap must be 1 or larger, not 0"):
        highlights_steps(np.zeros(3), straight(2), 1, min_gap=0)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_gap_without_an_order_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match=f"the importance of step 2 must be a finite number, not {value}"):
        highlights_steps(np.array([0.1, value, 0.0]), straight(2), 1)


def test_the_context_is_cut_off_at_the_ends_of_the_path() -> None:
    assert context_frames((1, 4, 6), 6) == ((1, 2), (3, 5), (5, 7))
    assert context_frames((3,), 6, context=9) == ((1, 7),)
    assert context_frames((3,), 6, context=0) == ((3, 3),)
    with pytest.raises(ValueError, match="the context must be 0 states or more, not -1"):
        context_frames((1,), 6, context=-1)


def test_an_interval_far_beyond_the_path_costs_nothing() -> None:
    assert highlights_steps(np.array([0.1, 0.9, 0.8, 0.0]), straight(3), 2, min_gap=10**9) == (2, 3)


def greedy(gaps: np.ndarray, num_steps: int, count: int, distance: int) -> list[int]:
    """Take the step with the largest gap among those that are far enough from all before, and so on."""
    chosen: list[int] = []
    while len(chosen) < count:
        left = [s for s in range(1, num_steps + 1) if all(abs(s - other) >= distance for other in chosen)]
        if not left:
            break
        chosen.append(max(left, key=lambda step: (gaps[step - 1], -step)))
    return sorted(chosen)


@given(st.integers(1, 12), st.integers(1, 30), st.integers(0, 2**32 - 1), st.data())
def test_the_distance_in_use_is_the_largest_that_fills_the_budget(
    num_steps: int, min_gap: int, seed: int, data: st.DataObject
) -> None:
    count = data.draw(st.integers(1, num_steps))
    goal = np.arange(num_steps + 1) == num_steps
    after = np.minimum(np.arange(num_steps + 1) + 1, num_steps)
    back = np.random.default_rng(seed).integers(0, num_steps, num_steps + 1)
    table = np.stack([after, back], axis=1).astype(np.int32)
    table[num_steps] = num_steps
    mdp = DeterministicMDP(tuple(range(num_steps + 1)), ("go", "jump"), table, goal, goal, 0)
    policy = np.zeros(num_steps + 1, dtype=np.int32)
    ready = highlights(mdp, policy, straight(num_steps), min_gap=min_gap)
    assert ready.distance is not None
    distance, gaps = ready.distance(count), q_gaps(mdp, policy)
    assert 1 <= distance <= min_gap
    assert list(ready.choose(count)) == greedy(gaps, num_steps, count, distance)
    for wider in range(distance + 1, min_gap + 1):
        assert len(greedy(gaps, num_steps, count, wider)) < count


def test_the_reason_is_the_gap() -> None:
    goal = np.array([False, False, True])
    mdp = DeterministicMDP(
        ("a", "b", "c"), ("x", "y"), np.array([[1, 2], [1, 2], [2, 2]], dtype=np.int32), goal, goal, 0
    )
    ready = highlights(mdp, np.array([1, 1, 0], dtype=np.int32), Trajectory((0, 2), (1,)), discount=0.5)
    assert ready.reason is not None
    assert (ready.choose(1), ready.reason(1)) == ((1,), "Q gap 0.5")
