"""Planning where actions have chances, against every policy, every way, and what is known of shortest paths."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.mdps import mdps, mdps_with_policy
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of
from webapp.explainer import solvers
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import NeverArrives
from webapp.explainer.stochastic import StochasticMDP, from_deterministic, from_outcomes
from webapp.explainer.stochastic_planning import (
    best_plan,
    most_probable,
    most_probable_path,
    plan_world,
    tie_averaged_plan,
)


def transitions(mdp: StochasticMDP) -> np.ndarray:
    """`[S, A, S]`, dense."""
    dense = np.zeros((mdp.num_states * mdp.num_actions, mdp.num_states))
    for row in range(len(dense)):
        places = slice(mdp.row_start[row], mdp.row_start[row + 1])
        dense[row, mdp.next_state[places]] = mdp.probability[places]
    return dense.reshape(mdp.num_states, mdp.num_actions, mdp.num_states)


def values_of(mdp: StochasticMDP, policy: tuple[int, ...], discount: float) -> np.ndarray:
    """`[S]`: the expected discounted goal indicator of a policy, by dense elimination."""
    moves = transitions(mdp)[np.arange(mdp.num_states), policy]
    moves[mdp.terminal] = 0.0
    inside = np.eye(mdp.num_states) - discount * moves
    return np.linalg.solve(inside, np.where(mdp.terminal, mdp.goal.astype(np.float64), 0.0))


def slippery_grid(size: int, slip: float = 0.1) -> StochasticMDP:
    """A square room with the goal in a corner; each move may go to either side of where it should."""
    moves = ((1, 0), (0, 1), (-1, 0), (0, -1))
    outcomes = []
    for x, y in itertools.product(range(size), repeat=2):
        for action, (turn, chance) in itertools.product(range(4), ((0, 1 - 2 * slip), (1, slip), (-1, slip))):
            dx, dy = moves[(action + turn) % 4]
            row, column = np.clip((x + dx, y + dy), 0, size - 1).tolist()
            outcomes.append((x * size + y, action, row * size + column, chance))
    goal = np.arange(size * size) == size * size - 1
    inside = [each for each in outcomes if not goal[each[0]]]
    return from_outcomes(range(size * size), ["down", "right", "up", "left"], inside, terminal=goal, goal=goal, start=0)


def line(num_states: int, stay: float) -> StochasticMDP:
    """A corridor to the last state: the first action waits, the second moves on unless it fails."""
    goal = np.arange(num_states) == num_states - 1
    outcomes = [
        outcome
        for state in range(num_states - 1)
        for outcome in ((state, 0, state, 1.0), (state, 1, state, stay), (state, 1, state + 1, 1 - stay))
    ]
    return from_outcomes(range(num_states), ["wait", "go"], outcomes, terminal=goal, goal=goal, start=0)


@settings(max_examples=30)
@given(fraction_worlds(max_states=4), st.sampled_from([0.5, 0.9, 0.99]))
def test_no_policy_is_better_anywhere(world: FractionWorld, discount: float) -> None:
    mdp = as_mdp(world)
    policies = itertools.product(range(mdp.num_actions), repeat=mdp.num_states)
    best = np.max([values_of(mdp, policy, discount) for policy in policies], axis=0)
    found = best_plan(mdp, discount)
    assert found.values == pytest.approx(best, abs=1e-12)
    assert found.error_bound < 1e-9
    worth = discount * transitions(mdp) @ best
    alive = ~mdp.terminal
    assert found.action_values[alive] == pytest.approx(worth[alive], abs=1e-12)
    near = np.isclose(worth, worth.max(axis=1, keepdims=True), rtol=1e-11, atol=0)
    far = worth < worth.max(axis=1, keepdims=True) * (1 - 1e-7)
    assert np.all(found.optimal[near])
    assert not np.any(found.optimal[far])
    own = values_of(mdp, tuple(plan_world(mdp, discount).tolist()), discount)
    assert own == pytest.approx(best, abs=1e-12)


@settings(max_examples=30)
@given(mdps())
def test_without_chance_the_best_plan_takes_shortest_paths(mdp: DeterministicMDP) -> None:
    certain = from_deterministic(mdp)
    assert np.array_equal(plan_world(certain), solvers.plan(mdp))
    assert tie_averaged_plan(certain) == pytest.approx(solvers.tie_averaged_policy(mdp))
    distances = solvers.distances_to_goal(mdp)
    assert best_plan(certain, 0.9).values == pytest.approx(np.where(np.isinf(distances), 0.0, 0.9**distances))
    assert np.array_equal(plan_world(mdp), solvers.plan(mdp))
    assert np.array_equal(tie_averaged_plan(mdp), solvers.tie_averaged_policy(mdp))


@settings(max_examples=30)
@given(fraction_worlds(), st.data())
def test_what_is_optimal_does_not_depend_on_how_states_are_numbered(world: FractionWorld, data: st.DataObject) -> None:
    mdp = as_mdp(world)
    new = np.array(data.draw(st.permutations(range(mdp.num_states))))
    old = np.argsort(new)
    outcomes = [(new[s], a, new[t], float(p)) for (s, a), row in world.outcomes.items() for t, p in row.items()]
    renumbered = from_outcomes(
        [f"s{state}" for state in old],
        mdp.actions,
        outcomes,
        terminal=mdp.terminal[old],
        goal=mdp.goal[old],
        start=int(new[0]),
    )
    assert np.array_equal(best_plan(renumbered).optimal[new], best_plan(mdp).optimal)


@pytest.mark.parametrize("size", [5, 40])
def test_a_symmetric_room_has_a_symmetric_plan_and_ties_on_its_diagonal(size: int) -> None:
    mdp = slippery_grid(size)
    optimal = best_plan(mdp).optimal.reshape(size, size, 4)
    mirrored = np.transpose(optimal, (1, 0, 2))[:, :, [1, 0, 3, 2]]
    assert np.array_equal(optimal, mirrored)
    diagonal = optimal[np.arange(size - 1), np.arange(size - 1)]
    assert np.all(diagonal[:, :2])
    chances = tie_averaged_plan(mdp).reshape(size, size, 4)
    assert chances[2, 2].tolist() == [0.5, 0.5, 0.0, 0.0]
    assert np.all(plan_world(mdp).reshape(size, size)[np.arange(size - 1), np.arange(size - 1)] == 0)


@pytest.mark.parametrize(("stay", "discount"), [(0.5, 0.99), (0.9, 0.9), (0.0, 0.5)])
def test_a_corridor_is_worth_what_its_series_says(stay: float, discount: float) -> None:
    # From one state to the next: the sum of (discount * stay)^k * discount * (1 - stay) over k.
    mdp = line(200, stay)
    hop = discount * (1 - stay) / (1 - discount * stay)
    found = best_plan(mdp, discount)
    assert found.values == pytest.approx(hop ** (199 - np.arange(200)), rel=1e-9)
    assert plan_world(mdp, discount)[:-1].tolist() == [1] * 199


def test_where_there_is_no_hope_every_action_is_as_good_as_any_other() -> None:
    terminal = np.array([False, True, True, False])
    goal = np.array([False, False, True, False])
    outcomes = [(0, 0, 1, 1.0), (0, 1, 2, 0.5), (0, 1, 3, 0.5), (3, 0, 3, 1.0), (3, 1, 1, 1.0)]
    mdp = from_outcomes("abcd", ["x", "y"], outcomes, terminal=terminal, goal=goal, start=0)
    assert plan_world(mdp).tolist() == [1, 0, 0, 0]
    assert tie_averaged_plan(mdp).tolist() == [[0, 1], [0.5, 0.5], [0.5, 0.5], [0.5, 0.5]]
    hopeless = from_outcomes("abcd", ["x", "y"], outcomes, terminal=terminal, goal=~terminal & False, start=0)
    assert not best_plan(hopeless).values.any()


def test_a_sure_way_beats_a_short_one_only_if_one_is_patient() -> None:
    # One action wins at once with 0.9 and else loses; the other waits ten steps and wins for sure.
    goal, terminal = np.arange(12) == 10, np.arange(12) >= 10
    outcomes = [(0, 0, 10, 0.9), (0, 0, 11, 0.1), (0, 1, 1, 1.0)]
    outcomes += [(state, action, state + 1, 1.0) for state in range(1, 10) for action in (0, 1)]
    mdp = from_outcomes(range(12), ["dash", "stroll"], outcomes, terminal=terminal, goal=goal, start=0)
    assert plan_world(mdp, 0.9)[0] == 0
    assert plan_world(mdp, 0.99)[0] == 1


@pytest.mark.parametrize("discount", [0.0, 1.0, -0.5, 1.5, math.nan, 0.99999999])
def test_a_discount_out_of_range_is_refused(discount: float) -> None:
    for world in (line(3, 0.5), most_probable(line(3, 0.5))):
        with pytest.raises(ValueError, match=f"the discount must be above 0 and at most 0.999999, not {discount}"):
            plan_world(world, discount)


def test_a_goal_too_far_to_be_worth_anything_is_told() -> None:
    with pytest.raises(ValueError, match=r"so far from 0 that it is worth nothing at discount 0\.5; take a larger"):
        plan_world(line(900, 0.1), 0.5)


@given(fraction_worlds())
def test_the_most_probable_outcome_of_each_action_is_taken_for_sure(world: FractionWorld) -> None:
    found = most_probable(as_mdp(world))
    assert isinstance(found, DeterministicMDP)
    for (state, action), chances in world.outcomes.items():
        assert found.next_state[state, action] == min(s for s, p in chances.items() if p == max(chances.values()))


def test_thirds_tie_though_they_are_not_equal_in_floats() -> None:
    terminal = np.array([False, False, True])
    third = 1 / 3
    outcomes = [(0, 0, 0, third), (0, 0, 1, (1 - third) / 2), (0, 0, 2, (1 - third) / 2), (1, 0, 2, 1.0)]
    mdp = from_outcomes("abc", ["go"], outcomes, terminal=terminal, goal=terminal, start=0)
    assert most_probable(mdp).next_state[0, 0] == 0


def test_a_world_without_chance_is_its_own_most_probable_one() -> None:
    mdp = most_probable(line(4, 0.6))
    assert most_probable(mdp) is mdp


def ways(world: FractionWorld) -> Iterator[tuple[float, int]]:
    """Yield chance and length of every way from state 0 to a goal that visits no state twice."""

    def extend(state: int, chance: float, seen: frozenset[int]) -> Iterator[tuple[float, int]]:
        if state in world.goals:
            yield chance, len(seen) - 1
        if state in world.ended:
            return
        for action, share in world.policy[state].items():
            for after, probability in world.outcomes[state, action].items():
                if after not in seen:
                    yield from extend(after, chance * float(share * probability), seen | {after})

    yield from extend(0, 1.0, frozenset({0}))


@settings(max_examples=50)
@given(fraction_worlds())
def test_no_way_to_a_goal_is_more_probable_or_as_probable_and_shorter(world: FractionWorld) -> None:
    mdp, policy = as_mdp(world), policy_of(world)
    known = list(ways(world))
    if not known:
        with pytest.raises(NeverArrives, match="never reaches a goal from the start 's0'"):
            most_probable_path(mdp, policy)
        return
    path = most_probable_path(mdp, policy)
    assert path.states[0] == 0
    assert path.states[-1] in world.goals
    chance = math.prod(
        float(world.policy[state][action] * world.outcomes[state, action][after])
        for (state, action), after in zip(path.pairs, path.states[1:], strict=True)
    )
    best = max(p for p, _ in known)
    assert chance == pytest.approx(best, rel=1e-7)
    assert path.num_steps == min(length for p, length in known if p == pytest.approx(best, rel=1e-10))


@settings(max_examples=50)
@given(mdps_with_policy())
def test_without_chance_the_policy_is_followed(case: tuple[DeterministicMDP, np.ndarray]) -> None:
    mdp, policy = case
    one_hot = np.eye(mdp.num_actions)[policy]
    try:
        path = solvers.follow(mdp, policy)
    except NeverArrives:
        for same in (policy, one_hot):
            with pytest.raises(NeverArrives):
                most_probable_path(mdp, same)
        return
    assert most_probable_path(mdp, policy) == path
    assert most_probable_path(mdp, one_hot) == path
    assert most_probable_path(from_deterministic(mdp), policy) == path


def test_of_equally_probable_ways_the_shortest_is_taken() -> None:
    terminal = np.array([False, False, False, False, True])
    outcomes = [(0, 0, 1, 0.5), (0, 0, 3, 0.5), (1, 0, 2, 1.0), (2, 0, 4, 1.0), (3, 0, 4, 1.0)]
    mdp = from_outcomes("abcde", ["go"], outcomes, terminal=terminal, goal=terminal, start=0)
    assert most_probable_path(mdp, np.zeros(5, dtype=np.int32)).states == (0, 3, 4)


def test_equally_probable_ways_of_the_same_length_are_told_apart_by_state() -> None:
    terminal = np.array([False, False, False, True])
    outcomes = [
        (0, 0, 2, (1 - 1 / 3) / 2),
        (0, 0, 1, 1 / 3),
        (0, 0, 0, (1 - 1 / 3) / 2),
        (1, 0, 3, 1.0),
        (2, 0, 3, 1.0),
    ]
    mdp = from_outcomes("abcd", ["go"], outcomes, terminal=terminal, goal=terminal, start=0)
    assert most_probable_path(mdp, np.zeros(4, dtype=np.int32)).states == (0, 1, 3)


@pytest.mark.parametrize("discount", [0.99, 0.999999])
def test_patience_costs_no_accuracy(discount: float) -> None:
    """With much patience values settle slowly: the first guess is wrong and has to be improved."""
    mdp = slippery_grid(12, slip=0.3)
    found = best_plan(mdp, discount)
    worth = discount * transitions(mdp) @ found.values
    alive = ~mdp.terminal
    assert worth[alive].max(axis=1) == pytest.approx(found.values[alive], rel=1e-11)
    # A corridor with a trap beside each state: the risky action is quick, the safe one takes thousands of tries.
    goal, terminal = np.arange(8) == 6, np.arange(8) >= 6
    safe = [(s, 0, after, p) for s in range(6) for after, p in ((s, 0.999), (s + 1, 0.001))]
    risky = [(s, 1, after, p) for s in range(6) for after, p in ((s + 1, 0.9), (7, 0.1))]
    slow = from_outcomes(range(8), ["safe", "risky"], safe + risky, terminal=terminal, goal=goal, start=0)
    best = max(discount * 0.001 / (1 - discount * 0.999), discount * 0.9)
    assert best_plan(slow, discount).values[0] == pytest.approx(best**6, rel=1e-9)


def test_a_policy_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="a policy must have shape"):
        most_probable_path(line(4, 0.5), np.zeros(7, dtype=np.int32))
    with pytest.raises(ValueError, match="must sum to 1"):
        most_probable_path(line(4, 0.5), np.full((4, 2), 0.7))
