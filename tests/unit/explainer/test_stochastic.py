"""Worlds with chances: what they are made of and what is refused."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from tests.mdps import mdps
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds
from webapp.explainer.labels import RowLabels
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.stochastic import StochasticMDP, action_probabilities, from_deterministic, from_outcomes

ENDS = np.array([False, False, True])
OUTCOMES = [
    (0, 0, 1, 0.5),
    (0, 0, 0, 0.5),
    (0, 1, 0, 1.0),
    (1, 0, 2, 0.25),
    (1, 0, 0, 0.75),
    (1, 1, 0, 1.0),
]
"""From 0 `go` slips half the time; from 1 it arrives in one of four tries and else falls back, and `back` goes back."""


def build(outcomes: object = OUTCOMES, **changes: Any) -> StochasticMDP:  # noqa: ANN401 - parts that do not fit.
    parts: dict[str, Any] = {"terminal": ENDS, "goal": ENDS, "start": 0} | changes
    return from_outcomes(("s", "t", "G"), ("go", "back"), outcomes, **parts)  # type: ignore[arg-type]


def test_random_actions_may_change_the_state_and_cannot_end_the_episode() -> None:
    assert build().selectable.tolist() == [[True, False], [False, True], [False, False]]


def test_outcomes_named_twice_add_up_and_impossible_ones_are_dropped() -> None:
    split = [(0, 0, 1, 0.25), (0, 0, 1, 0.25), (0, 0, 0, 0.5), (0, 0, 2, 0.0), *OUTCOMES[2:]]
    mdp = build(split)
    assert mdp.next_state.tolist() == build().next_state.tolist()
    assert mdp.probability.tolist() == build().probability.tolist()
    assert mdp.selectable[0, 0]


def test_the_chance_of_entering_the_goal_is_known_for_every_action() -> None:
    assert build().goal_chance.tolist() == [[0, 0], [0.25, 0], [0, 0]]


def test_states_are_found_by_their_labels() -> None:
    assert build().index == {"s": 0, "t": 1, "G": 2}


@given(mdps())
def test_a_deterministic_world_keeps_its_outcomes_and_its_selectable_actions(mdp: DeterministicMDP) -> None:
    world = from_deterministic(mdp)
    assert np.array_equal(world.next_state.reshape(mdp.next_state.shape), mdp.next_state)
    assert np.array_equal(world.selectable, mdp.selectable)
    assert (world.states, world.actions, world.start) == (mdp.states, mdp.actions, mdp.start)


@given(fraction_worlds())
def test_every_outcome_is_stored_with_its_probability(world: FractionWorld) -> None:
    mdp = as_mdp(world)
    for (state, action), chances in world.outcomes.items():
        row = slice(*mdp.row_start[state * mdp.num_actions + action :][:2])
        assert dict(zip(mdp.next_state[row].tolist(), mdp.probability[row].tolist(), strict=True)) == pytest.approx(
            {after: float(chance) for after, chance in chances.items()}
        )


@pytest.mark.parametrize(
    ("outcomes", "message"),
    [
        ([*OUTCOMES[:-1], (1, 1, 0, 0.9)], r"the probabilities after 'back' in 't' must sum to 1, not 0.9"),
        (OUTCOMES[:-1], r"the probabilities after 'back' in 't' must sum to 1, not 0.0"),
        ([*OUTCOMES[:-1], (1, 1, 0, float("nan"))], r"a probability must be a number from 0 to 1, not nan"),
        ([*OUTCOMES, (1, 1, 0, -0.5), (1, 1, 0, 0.5)], r"a probability must be a number from 0 to 1, not -0.5"),
        ([*OUTCOMES, (3, 0, 0, 1.0)], r"an outcome's state must be an index from 0 to 2, not 3"),
        ([*OUTCOMES, (0, 2, 0, 1.0)], r"an outcome's action must be an index from 0 to 1, not 2"),
        ([*OUTCOMES, (0, 0, -1, 1.0)], r"an outcome's next state must be an index from 0 to 2, not -1"),
        ([*OUTCOMES, (0, 0, 0.5, 1.0)], r"an outcome's next state must be an index from 0 to 2, not 0.5"),
        ([*OUTCOMES, (2, 0, 0, 1.0), (2, 1, 2, 1.0)], r"every action of a terminal state must lead back to it.*'G'"),
    ],
)
def test_outcomes_that_make_no_world_are_refused(outcomes: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        build(outcomes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"states": ()}, r"an MDP needs states and actions, not 0 and 2"),
        ({"states": ("s", "s", "G")}, r"the state labels are not distinct"),
        ({"terminal": ENDS[:2]}, r"terminal must be \[3\] booleans, not \(2,\)"),
        ({"goal": ENDS.astype(float)}, r"goal must be \[3\] booleans, not \(3,\) of float64"),
        ({"goal": ~ENDS}, r"a goal state must be terminal, and 's' is not"),
        ({"start": 3}, r"start must be a state index from 0 to 2, not 3"),
        ({"row_start": np.arange(3)}, r"row_start must have shape \(7,\), not \(3,\)"),
        ({"row_start": np.arange(7)}, r"row_start must rise from 0 to the number of outcomes, 8"),
        ({"row_start": np.linspace(0, 8, 7)}, r"row_start must hold integers, not float64"),
        ({"probability": np.ones(2)}, r"\(8,\) next states need as many chances, not \(2,\)"),
        ({"next_state": np.full(8, 3)}, r"next_state must hold state indices from 0 to 2"),
        ({"probability": np.array([0.0, 1, 1, 0.75, 0.25, 1, 1, 1])}, r"a stored probability must be above 0"),
        ({"next_state": np.array([1, 0, 0, 0, 2, 0, 2, 2])}, r"must ascend, each named once"),
        ({"reward": np.zeros(3)}, r"reward must have shape \(3, 2\), not \(3,\)"),
        ({"reward": np.full((3, 2), np.nan)}, r"a reward must be a finite number"),
        ({"reward": np.ones((3, 2))}, r"there is nothing to earn in a terminal state"),
    ],
)
def test_parts_that_do_not_fit_together_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(build(), **changes)


def test_one_action_per_state_is_a_policy_of_certainties() -> None:
    chances = action_probabilities(build(), np.array([1, 0, 99], dtype=np.int32))
    assert chances.tolist() == [[0, 1], [1, 0], [0, 0]]


def test_what_a_policy_says_of_ended_episodes_does_not_matter() -> None:
    chances = action_probabilities(build(), np.array([[0.5, 0.5], [1, 0], [np.nan, -1]]))
    assert chances.tolist() == [[0.5, 0.5], [1, 0], [0, 0]]


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        (lambda: np.array([0, 2, 0]), r"a policy must hold action indices from 0 to 1"),
        (lambda: np.array([0.0, 1.0, 0.0]), r"a policy must hold action indices from 0 to 1"),
        (lambda: np.zeros(2, dtype=np.int32), r"a policy must have shape \(3,\) or \(3, 2\), not \(2,\)"),
        (lambda: np.array([[1, 0], [0.5, 0.4], [1, 0]]), r"probabilities in 't' must sum to 1, not 0.9"),
        (lambda: np.array([[1, 0], [np.nan, 1], [1, 0]]), r"a probability must be a number from 0 to 1, not nan"),
        (lambda: np.array([[1, 0], [2, -1], [1, 0]]), r"a probability must be a number from 0 to 1, not -1"),
    ],
)
def test_a_policy_that_does_not_fit_is_refused(policy: Callable[[], np.ndarray], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        action_probabilities(build(), policy())


def test_labels_that_are_distinct_by_construction_are_kept_as_they_are() -> None:
    for labels in (range(3), RowLabels(np.arange(6).reshape(3, 2), tuple)):
        mdp = from_outcomes(labels, ("go", "back"), OUTCOMES, terminal=ENDS, goal=ENDS, start=0)
        assert mdp.states is labels
        assert mdp.index[labels[2]] == 2
