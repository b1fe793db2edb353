"""What is drawn from an urn has the chances that the world and the choice of actions give it."""

from collections.abc import Mapping
from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.mdps import mdps
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.stochastic import from_deterministic, from_outcomes
from webapp.explainer.urns import Urns, fill_urns, side_by_side, uniform


def chances_of(urns: Urns, row: int) -> dict[int, float]:
    """Draw every token once, and weigh it."""
    places = range(urns.row_start[row], urns.row_start[row + 1])
    found: dict[int, float] = {}
    for place in places:
        keep = 1.0 if urns.keep is None else float(urns.keep[place])
        assert 0 <= keep <= 1
        for state, chance in ((int(urns.token[place]), keep), (int(urns.other[place]), 1 - keep)):
            found[state] = found.get(state, 0.0) + chance / len(places)
    return {state: chance for state, chance in found.items() if chance > 1e-12}


def agree(found: Mapping[int, float], expected: Mapping[int, Fraction]) -> None:
    assert found.keys() == expected.keys()
    assert all(abs(found[state] - float(expected[state])) < 1e-9 for state in expected)


@given(fraction_worlds())
def test_the_policys_urns_hold_its_chain(world: FractionWorld) -> None:
    mdp = as_mdp(world)
    urns = fill_urns(mdp, np.arange(mdp.num_states), policy_of(world))
    for state, expected in world.chain().items():
        agree(chances_of(urns, state), {after: chance for after, chance in expected.items() if chance})


@given(mdps())
def test_a_random_action_in_a_world_without_chance_is_one_whole_number(mdp: DeterministicMDP) -> None:
    urns = fill_urns(from_deterministic(mdp), np.arange(mdp.num_states), uniform(mdp.selectable))
    counts = [int(number) for number in mdp.selectable.sum(axis=1) if number]
    assert urns.width == int(np.lcm.reduce([1, *counts]))
    for state in range(mdp.num_states):
        after = [int(s) for s, allowed in zip(mdp.next_state[state], mdp.selectable[state], strict=True) if allowed]
        after = after or [state]
        agree(chances_of(urns, state), {s: Fraction(after.count(s), len(after)) for s in after})


@given(st.lists(st.floats(1e-9, 1), min_size=1, max_size=120))
def test_chances_of_any_kind_and_number_are_kept(weights: list[float]) -> None:
    chances = np.array(weights) / np.sum(weights)
    goal = len(weights)
    end = np.arange(goal + 1) == goal
    outcomes = [(0, 0, after + 1 if goal > 1 else 1, chance) for after, chance in enumerate(chances)]
    outcomes += [(state, 0, state, 1.0) for state in range(1, goal)]
    mdp = from_outcomes(list(range(goal + 1)), ["go"], outcomes, terminal=end, goal=end.copy(), start=0)
    found = chances_of(fill_urns(mdp, np.arange(1), np.ones((1, 1))), 0)
    for after, chance in enumerate(chances):
        assert abs(found.get(after + 1, 0.0) - chance) < 1e-9


def test_where_no_action_is_taken_the_state_stays_and_states_may_come_in_any_order() -> None:
    end = np.array([False, False, True])
    mdp = from_outcomes(
        ["a", "b", "c"],
        ["x", "y"],
        [(0, 0, 1, 1), (0, 1, 2, 1), (1, 0, 0, 0.25), (1, 0, 2, 0.75), (1, 1, 1, 1)],
        terminal=end,
        goal=end.copy(),
        start=0,
    )
    urns = fill_urns(mdp, np.array([1, 0, 1]), np.array([[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]]))
    assert [chances_of(urns, row) for row in range(3)] == [{1: 1.0}, {1: 0.5, 2: 0.5}, {0: 0.25, 2: 0.75}]
    assert urns.width == 4


def test_chances_that_are_no_parts_of_a_small_whole_need_a_second_draw() -> None:
    end = np.array([False, True])
    mdp = from_outcomes([0, 1], ["x"], [(0, 0, 0, 0.123), (0, 0, 1, 0.877)], terminal=end, goal=end.copy(), start=0)
    urns = fill_urns(mdp, np.arange(2), np.ones((2, 1)))
    assert urns.width is None
    agree(chances_of(urns, 0), {0: Fraction(123, 1000), 1: Fraction(877, 1000)})


@given(fraction_worlds(max_states=4), st.integers(1, 3))
def test_copies_of_a_world_keep_to_themselves(world: FractionWorld, num_copies: int) -> None:
    mdp = as_mdp(world)
    one = fill_urns(mdp, np.arange(mdp.num_states), policy_of(world))
    states = np.tile(np.arange(mdp.num_states), num_copies)
    copies = side_by_side(fill_urns(mdp, states, np.tile(policy_of(world), (num_copies, 1))), num_copies)
    for row in range(len(states)):
        copy, state = divmod(row, mdp.num_states)
        first = copy * mdp.num_states
        expected = {first + after: chance for after, chance in chances_of(one, state).items()}
        found = chances_of(copies, row)
        assert found.keys() == expected.keys()
        assert all(abs(found[after] - expected[after]) < 1e-9 for after in expected)
