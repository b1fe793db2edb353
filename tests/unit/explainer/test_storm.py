"""Storm, a model checker that shares no code with ours, on random stochastic worlds.

It runs where it is made for, and is missed loudly there: an import that fails is a failure and no skip.
"""

import platform
import sys
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.benchmarks.reachability import Problem, key_door_table, problem, storm_check
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, reach_in_fractions
from webapp.explainer.reachability import chain_reach_probability, markov_chain, reach_probability
from webapp.explainer.seeding import stream
from webapp.explainer.stochastic import from_outcomes
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import parse_layout

__test__ = (sys.platform, platform.machine()) == ("linux", "x86_64")
"""Storm is made for no other platform; pytest collects nothing here where this is false."""
STORM = 1e-5
"""Storm stops where its iteration moves by less than 1e-6, which is no bound; ten times that held in every draw."""


@given(world=fraction_worlds(), data=st.data())
@settings(max_examples=60)
def test_storm_finds_the_same_chances_on_drawn_worlds(world: FractionWorld, data: st.DataObject) -> None:
    targets = data.draw(st.sets(st.sampled_from(world.states)))
    mdp, flags = as_mdp(world), np.isin(np.arange(len(world.states)), list(targets))
    ours = reach_probability(mdp, policy_of(world), flags)
    storms = storm_check(Problem(markov_chain(mdp, policy_of(world)), flags))()
    assert ours.values == pytest.approx(storms, abs=STORM)


@given(world=fraction_worlds(), data=st.data())
@settings(max_examples=40)
def test_storm_in_exact_rationals_agrees_with_the_fractions_and_with_ours(
    world: FractionWorld, data: st.DataObject
) -> None:
    targets = data.draw(st.sets(st.sampled_from(world.states)))
    chain = world.chain()
    exact = rational_storm(chain, targets)
    assert exact == reach_in_fractions(chain, targets)
    flags = np.isin(np.arange(len(world.states)), list(targets))
    ours = reach_probability(as_mdp(world), policy_of(world), flags)
    assert ours.values == pytest.approx([float(exact[state]) for state in world.states], abs=ours.error_bound + 1e-13)


def rational_storm(chain: dict[int, dict[int, Fraction]], targets: set[int]) -> dict[int, Fraction]:
    import stormpy  # noqa: PLC0415 - only for the platforms that it is made for.

    rational = stormpy.Rational
    builder = stormpy.datastructures.SparseMatrixBuilder[rational](len(chain), len(chain), force_dimensions=False)
    for state in sorted(chain):
        for after in sorted(chain[state]):
            chance = chain[state][after]
            builder.add_next_value(state, after, rational(chance.numerator) / rational(chance.denominator))
    labels = stormpy.models.StateLabeling(len(chain))
    for label, states in (("init", {0}), ("target", targets)):
        labels.add_label(label)
        for state in states:
            labels.add_label_to_state(label, state)
    parts = stormpy.models.SparseModelComponents[rational](transition_matrix=builder.build(), state_labeling=labels)
    model = stormpy.models.SparseDtmc[rational](parts)
    formula = stormpy.parse_properties('P=? [F "target"]')[0]
    found = stormpy.model_checking(model, formula, environment=stormpy.environments.exact())
    return {state: Fraction(str(chance)) for state, chance in enumerate(found.get_value_vector())}


@pytest.mark.parametrize("seed", range(8))
def test_storm_agrees_on_worlds_of_thousands_of_states_in_every_shape(seed: int) -> None:
    # Beyond the size at which a system is factorised; near and far moves, with and without ends that are no goal.
    rng = stream(seed, "storm")
    num_states, num_actions = 3000, 3
    reach = [3, 30, 300, num_states][seed % 4]
    origin = np.repeat(np.arange(num_states), num_actions * 3)
    action = np.tile(np.repeat(np.arange(num_actions), 3), num_states)
    after = np.clip(origin + rng.integers(-reach, reach + 1, len(origin)), 0, num_states - 1)
    chance = rng.dirichlet(np.ones(3), num_states * num_actions).ravel()
    terminal = np.arange(num_states) % (500 if reach == num_states else 50) == 0
    alive = ~terminal[origin]
    outcomes = np.column_stack((origin, action, after, chance))[alive]
    goal = terminal & (np.arange(num_states) > num_states // 2)
    mdp = from_outcomes(range(num_states), ["a", "b", "c"], outcomes, terminal=terminal, goal=goal, start=1)
    policy = rng.dirichlet(np.ones(num_actions), num_states)
    chain = markov_chain(mdp, policy)
    ours = chain_reach_probability(chain, goal)
    assert ours.values == pytest.approx(storm_check(Problem(chain, goal), eigen=True)(), abs=STORM)
    assert ours.error_bound < 1e-9


def test_the_chain_of_the_benchmark_is_solved_as_by_storm() -> None:
    asked = problem(30)
    ours = chain_reach_probability(asked.chain, asked.targets, precision=1e-9)
    assert ours.values == pytest.approx(storm_check(asked)(), abs=STORM)
    assert ours.error_bound <= 1e-9


ROOM = """
#########
#>..#...#
#...#...#
#...D...#
#...#...#
#.K.#...#
#...#..G#
#########
"""


def test_the_world_of_the_benchmark_follows_the_key_door_rules() -> None:
    table, ended, start = key_door_table(6)
    mdp = tabulate(parse_layout(ROOM.strip()))
    place, queue = {mdp.start: start}, [mdp.start]
    for state in queue:
        assert mdp.goal[state] == ended[place[state]]
        for after, expected in zip(mdp.next_state[state].tolist(), table[place[state]].tolist(), strict=True):
            if after not in place:
                place[after] = expected
                queue.append(after)
            assert place[after] == expected
    # The goal lies in a corner that is entered rightwards or downwards; two headings in two stages are never taken.
    assert len(set(place.values())) == mdp.num_states == len(table) - 4
