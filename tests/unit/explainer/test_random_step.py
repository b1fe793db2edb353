import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.mdps import mdps
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.random_step import RandomStep


def matrix(next_state: np.ndarray, selectable: np.ndarray) -> np.ndarray:
    """A random step as a dense matrix, and one row more for whoever is lost."""
    num_states = len(next_state)
    dense = np.zeros((num_states + 1, num_states + 1))
    for state in range(num_states):
        targets = next_state[state][selectable[state]].tolist() or [state]
        for target in targets:
            dense[state, target] += 1 / len(targets)
    dense[num_states, num_states] = 1
    return dense


@given(mdps(max_states=12), st.integers(0, 5), st.data())
def test_pushing_all_starts_at_once_is_a_power_of_the_matrix(
    mdp: DeterministicMDP, num_steps: int, data: st.DataObject
) -> None:
    starts = data.draw(st.lists(st.integers(0, mdp.num_states - 1), min_size=1, max_size=6))
    found = RandomStep.of(mdp.next_state, mdp.selectable).push(np.array(starts), num_steps)
    expected = np.linalg.matrix_power(matrix(mdp.next_state, mdp.selectable), num_steps)[starts, :-1].T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


@given(st.integers(2, 9), st.integers(1, 3), st.integers(0, 4), st.integers(0, 2**32))
def test_whoever_leaves_for_a_state_outside_is_lost(
    num_states: int, num_actions: int, num_steps: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    next_state = rng.integers(0, num_states + 1, (num_states, num_actions))
    selectable = rng.random((num_states, num_actions)) < 0.7
    found = RandomStep.of(next_state, selectable).push(np.arange(num_states), num_steps)
    expected = np.linalg.matrix_power(matrix(next_state, selectable), num_steps)[:-1, :-1].T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


def test_a_start_that_every_fall_leads_back_to_takes_no_more_room_than_the_transitions() -> None:
    num_states = 1000
    onwards = np.minimum(np.arange(num_states) + 1, num_states - 1)
    next_state = np.stack((onwards, np.zeros_like(onwards)), axis=1)
    selectable = next_state != np.arange(num_states)[:, None]
    step = RandomStep.of(next_state, selectable)
    assert sum(map(len, step.layers)) + len(step.crowd) == selectable.sum()
    assert len(step.layers) == 4
    found = step.push(np.array([0, 500]), 3)
    expected = np.linalg.matrix_power(matrix(next_state, selectable), 3)[[0, 500], :-1].T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


def test_a_negative_number_of_random_actions_is_refused() -> None:
    step = RandomStep.of(np.array([[0]]), np.array([[False]]))
    assert step.push(np.array([0]), 7).tolist() == [[1.0]]
    with pytest.raises(ValueError, match="random actions must be 0 or larger, not -1"):
        step.push(np.array([0]), -1)
