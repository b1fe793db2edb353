"""The chance of getting somewhere, against fractions, against value iteration, and at the edges."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.mdps import mdps_with_policy
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, reach_in_fractions
from webapp.explainer import solvers
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.reachability import random_phase, reach_probability
from webapp.explainer.stochastic import StochasticMDP, from_deterministic, from_outcomes

ROUNDING = 1e-13
"""The worlds of these tests hold decimals of fractions: their own rounding is no part of a solver's error."""


def line(chances: list[tuple[int, int, float]], num_states: int, ends: list[int]) -> StochasticMDP:
    """A world with a single action; its goal is the last of the states that end the episode."""
    terminal = np.isin(np.arange(num_states), ends)
    goal = np.arange(num_states) == ends[-1]
    outcomes = [(state, 0, after, chance) for state, after, chance in chances]
    return from_outcomes(range(num_states), ["on"], outcomes, terminal=terminal, goal=goal, start=ends[0] + 1)


def ruin(num_states: int, win: float) -> StochasticMDP:
    """The gambler's ruin: up with one chance, down with the rest, until broke in 0 or rich in the last state."""
    steps = [(s, s + side, chance) for s in range(1, num_states - 1) for side, chance in ((1, win), (-1, 1 - win))]
    return line(steps, num_states, [0, num_states - 1])


@pytest.mark.parametrize("direct_limit", [0, 10**6])
@pytest.mark.parametrize(("num_states", "win"), [(4, 2 / 3), (30, 0.5), (200, 0.55), (200, 0.45)])
def test_the_gamblers_ruin_ends_as_its_formula_says(num_states: int, win: float, direct_limit: int) -> None:
    # The textbook's (1 - x^i) / (1 - x^n) with x = lose / win, or i / n where the game is fair; 4/7 and 6/7 for n = 3.
    mdp, last = ruin(num_states, win), num_states - 1
    ratio, i = (1 - win) / win, np.arange(num_states)
    formula = i / last if win == 0.5 else (1 - ratio**i) / (1 - ratio**last)
    found = reach_probability(mdp, np.zeros(num_states, dtype=np.int32), mdp.goal, direct_limit=direct_limit)
    assert found.values == pytest.approx(formula, abs=found.error_bound + ROUNDING)
    assert found.error_bound < 1e-9


@pytest.mark.parametrize("direct_limit", [0, 10**6])
@given(world=fraction_worlds(), data=st.data())
def test_every_chance_equals_its_fraction_within_the_bound(
    direct_limit: int, world: FractionWorld, data: st.DataObject
) -> None:
    targets = data.draw(st.sets(st.sampled_from(world.states)))
    chain = world.chain()
    truth = reach_in_fractions(chain, targets)
    flags = np.isin(np.arange(len(world.states)), list(targets))
    found = reach_probability(as_mdp(world), policy_of(world), flags, direct_limit=direct_limit)
    for state, chance in truth.items():
        assert abs(found.values[state] - float(chance)) <= found.error_bound + ROUNDING
        assert (found.values[state] == 0) == (chance == 0)
        assert chance != 1 or found.values[state] == 1


def test_a_state_that_is_hardly_ever_left_is_as_exact_as_any_other() -> None:
    # It leaves for the goal as often as for the trap; 1 - 2e-17 rounds to 1, so the plain system would be singular.
    mdp = line([(1, 0, 1e-17), (1, 2, 1e-17), (1, 1, 1.0)], 3, [0, 2])
    found = reach_probability(mdp, np.zeros(3, dtype=np.int32), mdp.goal)
    assert found.values.tolist() == [0, 0.5, 1]


def test_loops_never_arrive_and_certainties_need_no_numbers() -> None:
    mdp = line([(1, 1, 1.0), (2, 1, 0.5), (2, 3, 0.5), (3, 2, 0.9), (3, 4, 0.1), (5, 4, 0.1), (5, 5, 0.9)], 6, [0, 4])
    found = reach_probability(mdp, np.zeros(6, dtype=np.int32), mdp.goal)
    # x3 = .1 + .9 x2 and x2 = .5 x3, so x3 = 2/11.
    assert found.values == pytest.approx([0, 0, 1 / 11, 2 / 11, 1, 1], abs=1e-15)
    certain = reach_probability(mdp, np.zeros(6, dtype=np.int32), ~mdp.terminal)
    assert (certain.values.tolist(), certain.error_bound) == ([0, 1, 1, 1, 0, 1], 0)


def frozen_lake() -> tuple[StochasticMDP, dict[tuple[int, int], list[tuple[float, int]]]]:
    """The slippery lake as a world, and its own table."""
    table = gymnasium.make("FrozenLake-v1", map_name="4x4", is_slippery=True).unwrapped.P  # type: ignore[attr-defined]
    rows = {(s, a): [(p, after) for p, after, _, _ in table[s][a]] for s in table for a in table[s]}
    ended = {after for s in table for a in table[s] for _, after, _, end in table[s][a] if end}
    flags = np.isin(np.arange(16), list(ended))
    outcomes = [(s, a, after, p) for (s, a), row in rows.items() if s not in ended for p, after in row]
    goal = np.arange(16) == 15
    return from_outcomes(range(16), list("<v>^"), outcomes, terminal=flags, goal=goal, start=0), rows


@pytest.mark.parametrize("kind", ["optimal", "random"])
def test_slippery_frozen_lake_agrees_with_a_plain_value_iteration(kind: str) -> None:
    mdp, rows = frozen_lake()
    optimal = dict(enumerate([0, 3, 3, 3, 0, 0, 0, 0, 3, 1, 0, 0, 0, 2, 1, 0]))
    values = dict.fromkeys(range(16), 0.0) | {15: 1.0}
    for _ in range(5000):
        for state in (0, 1, 2, 3, 4, 6, 8, 9, 10, 13, 14):
            actions = [optimal[state]] if kind == "optimal" else range(4)
            worth = [sum(p * values[after] for p, after in rows[state, a]) for a in actions]
            values[state] = sum(worth) / len(worth)
    policy = np.array(list(optimal.values())) if kind == "optimal" else np.full((16, 4), 0.25)
    found = reach_probability(mdp, policy, mdp.goal)
    assert found.values == pytest.approx(list(values.values()), abs=1e-9)
    assert found.error_bound < 1e-12


def test_the_best_policy_crosses_the_slippery_lake_14_times_in_17() -> None:
    mdp, _ = frozen_lake()
    policy = np.array([0, 3, 3, 3, 0, 0, 0, 0, 3, 1, 0, 0, 0, 2, 1, 0])
    assert reach_probability(mdp, policy, mdp.goal).values[0] == pytest.approx(14 / 17, abs=1e-12)


def test_a_set_that_is_no_set_of_states_is_refused() -> None:
    mdp = ruin(4, 0.5)
    wrong: list[Any] = [mdp.goal[:2], mdp.goal.astype(np.float64)]
    for targets in wrong:
        with pytest.raises(ValueError, match=r"the set must be \[4\] booleans"):
            reach_probability(mdp, np.zeros(4, dtype=np.int32), targets)


@given(mdps_with_policy(), st.integers(0, 4), st.booleans())
def test_certain_outcomes_spread_as_in_the_deterministic_solver(
    world: tuple[DeterministicMDP, np.ndarray], num_steps: int, denied: bool
) -> None:
    mdp, policy = world
    pair = (mdp.start, int(policy[mdp.start]))
    found = random_phase(from_deterministic(mdp), mdp.start, num_steps, forbidden=(pair,) if denied else ())
    expected = solvers.random_phase(mdp, mdp.start, num_steps, forbidden=pair if denied else None)
    assert found == pytest.approx(expected, abs=1e-12)


def test_random_actions_spread_by_the_chances_of_their_outcomes() -> None:
    # From 1, one step up or down would end the episode, so nothing is selectable; from 2 of 0..4 both sides are open.
    mdp = ruin(5, 0.75)
    assert random_phase(mdp, 1, 3).tolist() == [0, 1, 0, 0, 0]
    assert random_phase(mdp, 2, 1).tolist() == [0, 0.25, 0, 0.75, 0]


def test_a_random_phase_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match=r"random actions must be 0 or larger, not -1"):
        random_phase(ruin(4, 0.5), 1, -1)
    with pytest.raises(ValueError, match=r"an index from 0 to 3, not 4"):
        random_phase(ruin(4, 0.5), 4, 1)
