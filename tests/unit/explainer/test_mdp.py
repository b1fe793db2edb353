from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.explainer.mdp import DeterministicMDP, enumerate_mdp

LADDER: dict[str, Any] = {
    "states": ("bottom", "middle", "top"),
    "actions": ("up", "wait"),
    "next_state": np.array([[1, 0], [2, 1], [2, 2]], dtype=np.int32),
    "terminal": np.array([False, False, True]),
    "goal": np.array([False, False, True]),
    "start": 0,
}


def test_an_mdp_knows_its_sizes_and_the_indices_of_its_states() -> None:
    mdp = DeterministicMDP(**LADDER)
    assert (mdp.num_states, mdp.num_actions) == (3, 2)
    assert mdp.index == {"bottom": 0, "middle": 1, "top": 2}


def test_a_random_step_may_change_the_state_but_not_end_the_episode() -> None:
    assert DeterministicMDP(**LADDER).selectable.tolist() == [[True, False], [False, False], [False, False]]


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"states": ()}, "needs states and actions, not 0 and 2"),
        ({"actions": ()}, "needs states and actions, not 3 and 0"),
        ({"states": ("bottom", "top", "top")}, "not distinct"),
        ({"next_state": np.zeros((3, 3), dtype=np.int32)}, r"shape \(3, 2\), not \(3, 3\)"),
        ({"next_state": np.array([[1, 0], [3, 1], [2, 2]])}, "state indices from 0 to 2"),
        ({"next_state": np.array([[1, 0], [-1, 1], [2, 2]])}, "state indices from 0 to 2"),
        ({"terminal": np.array([False, True])}, r"terminal must have shape \(3,\), not \(2,\)"),
        ({"goal": np.array([True])}, r"goal must have shape \(3,\), not \(1,\)"),
        ({"goal": np.array([False, True, True])}, "a goal state must be terminal"),
        ({"next_state": np.array([[1, 0], [2, 1], [2, 0]])}, "must lead back to it"),
        ({"start": 3}, "from 0 to 2, not 3"),
        ({"start": -1}, "from 0 to 2, not -1"),
    ],
)
def test_parts_that_do_not_fit_are_refused(changes: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        DeterministicMDP(**LADDER | changes)


def test_states_are_enumerated_breadth_first_with_actions_in_order() -> None:
    after = {"a": "bc", "b": "da", "c": "ed", "d": "dd"}
    mdp = enumerate_mdp(
        "a", ("first", "second"), lambda state, action: (after[state][action], after[state][action] == "e")
    )
    assert mdp.states == ("a", "b", "c", "d", "e")
    assert mdp.next_state.tolist() == [[1, 2], [3, 0], [4, 3], [3, 3], [4, 4]]
    assert mdp.terminal.tolist() == mdp.goal.tolist() == [False, False, False, False, True]
    assert mdp.start == 0


@given(st.integers(1, 60), st.integers(1, 60), st.data())
def test_counting_round_a_clock_reaches_every_multiple(size: int, stride: int, data: st.DataObject) -> None:
    first = data.draw(st.integers(0, size - 1))
    mdp = enumerate_mdp(first, ("on", "stay"), lambda hour, action: ((hour + stride * (1 - action)) % size, False))
    assert mdp.num_states == size // np.gcd(size, stride)
    assert not mdp.terminal.any()
    assert mdp.next_state[:, 1].tolist() == list(range(mdp.num_states))
    assert mdp.next_state[:, 0].tolist() == [*range(1, mdp.num_states), 0]


def test_more_states_than_allowed_are_refused() -> None:
    assert enumerate_mdp(0, ("on",), lambda n, _: (min(n + 1, 9), False), max_states=10).num_states == 10
    with pytest.raises(ValueError, match="more than 9 states"):
        enumerate_mdp(0, ("on",), lambda n, _: (min(n + 1, 9), False), max_states=9)


def test_a_state_that_ends_the_episode_on_one_way_in_only_is_refused() -> None:
    with pytest.raises(ValueError, match="'b' ends the episode on one way in and not on another"):
        enumerate_mdp("a", ("in", "end"), lambda _, action: ("b", action == 1))
