import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.mdps import mdps, mdps_with_policy, oracle_of
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.rollouts import arrivals, returns, walk_randomly
from webapp.explainer.seeding import stream
from webapp.explainer.solvers import random_phase


@given(mdps(), st.integers(0, 5), st.integers(0, 2**32), st.data())
def test_random_walkers_only_go_where_random_actions_can_lead(
    mdp: DeterministicMDP, num_steps: int, seed: int, data: st.DataObject
) -> None:
    pairs = st.tuples(st.integers(0, mdp.num_states - 1), st.integers(0, mdp.num_actions - 1))
    forbidden = data.draw(st.none() | pairs)
    starts = np.arange(mdp.num_states).repeat(3)
    ends = walk_randomly(
        mdp, starts, num_steps, stream(seed), forbidden=None if forbidden is None else [forbidden] * len(starts)
    )
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        assert random_phase(mdp, start, num_steps, forbidden=forbidden)[end] > 0


def test_random_walkers_spread_as_the_exact_random_phase_does() -> None:
    table = np.array([[1, 2, 0], [0, 3, 1], [0, 1, 3], [0, 1, 2], [4, 4, 4]], dtype=np.int32)
    table[3, 2] = 4
    end = np.array([False, False, False, False, True])
    mdp = DeterministicMDP(tuple("abcdg"), ("x", "y", "z"), table, end, end.copy(), 0)
    for forbidden in (None, (0, 1)):
        expected = random_phase(mdp, 0, 3, forbidden=forbidden)
        ends = walk_randomly(
            mdp,
            np.zeros(20_000, dtype=np.int64),
            3,
            stream(5),
            forbidden=None if forbidden is None else [forbidden] * 20_000,
        )
        shares = np.bincount(ends, minlength=5) / 20_000
        assert np.all(np.abs(shares - expected) <= 4 * np.sqrt(expected * (1 - expected) / 20_000) + 1e-12)


@given(mdps_with_policy())
def test_walkers_return_and_arrive_exactly_where_a_single_walk_would(
    world: tuple[DeterministicMDP, np.ndarray],
) -> None:
    mdp, policy = world
    oracle = oracle_of(mdp, policy)
    everywhere = np.arange(mdp.num_states)
    for featured in range(mdp.num_states):
        # The featured state may itself lie on a loop: the oracle then meets it, as the loop of Algorithm 1 does.
        expected = [oracle.comes_to(state, featured) for state in range(mdp.num_states)]
        np.testing.assert_array_equal(returns(mdp, policy, everywhere, np.full_like(everywhere, featured)), expected)
        expected = [oracle.reaches_goal(state, featured) for state in range(mdp.num_states)]
        np.testing.assert_array_equal(
            arrivals(mdp, policy, everywhere, blocked=np.full_like(everywhere, featured)), expected
        )
    expected = [oracle.reaches_goal(state, None) for state in range(mdp.num_states)]
    np.testing.assert_array_equal(arrivals(mdp, policy, everywhere), expected)


def test_walkers_leave_the_states_they_were_given_as_they_are() -> None:
    table = np.array([[1], [1]], dtype=np.int32)
    end = np.array([False, True])
    mdp = DeterministicMDP(("a", "b"), ("go",), table, end, end.copy(), 0)
    starts = np.zeros(3, dtype=np.int64)
    policy = np.zeros(2, dtype=np.int32)
    assert arrivals(mdp, policy, starts).all()
    assert not returns(mdp, policy, starts, starts).any()
    assert starts.tolist() == [0, 0, 0]


def test_a_negative_number_of_random_actions_is_refused() -> None:
    table = np.array([[0]], dtype=np.int32)
    end = np.array([False])
    mdp = DeterministicMDP(("a",), ("go",), table, end, end.copy(), 0)
    with pytest.raises(ValueError, match="must be 0 or larger, not -3"):
        walk_randomly(mdp, np.zeros(1, dtype=np.int64), -3, stream(0))
