"""Importance against a brute-force oracle, on odd maps and on worlds that nobody chose."""

import re
from collections import deque

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.mdps import Oracle, State, mdps_with_policy, oracle_of
from tests.worlds import lay_out, layouts
from webapp.explainer.importance import (
    IMPORTANCE_KINDS,
    PROBABILITY_KINDS,
    Importance,
    ImportanceKind,
    ProbabilityKind,
    exact_importance,
)
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan
from webapp.explainer.stochastic import World, from_deterministic
from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState, start_state, step, tabulate
from webapp.explainer.worlds.layout import Layout, LayoutError

ODD_MAPS = {
    "corridor": lay_out("#######", "#>KD.G#", "#######"),
    "goal on both sides": lay_out("######", "#G.>K#", "#..D.#", "######"),
    "key behind a corner": lay_out("#####", "#K#G#", "#.#.#", "#.D.#", "#<#.#", "#####"),
    "door beside the start": lay_out("#####", "#^DG#", "#K###", "#####"),
    "two rooms, one column": lay_out("###", "#v#", "#K#", "#D#", "#G#", "###"),
    "wide": lay_out("#########", "#...#...#", "#K<.D..G#", "#...#...#", "#########"),
}


def key_door_oracle(layout: Layout) -> Oracle:
    """Walk the rules themselves; plan by searching backwards over a dictionary of who leads where."""
    known: dict[KeyDoorState, list[KeyDoorState]] = {}
    queue = deque([start_state(layout)])
    ended: set[State] = set()
    while queue:
        state = queue.popleft()
        if state in known or state in ended:
            continue
        outcomes = [step(layout, state, action) for action in range(len(ACTIONS))]
        known[state] = [after for after, _ in outcomes]
        ended |= {after for after, ends in outcomes if ends}
        queue.extend(known[state])
    lengths: dict[State, int] = dict.fromkeys(ended, 0)
    for length in range(1, len(known) + 1):
        ready = [state for state in known if state not in lengths and any(s in lengths for s in known[state])]
        lengths |= dict.fromkeys(ready, length)
    policy: dict[State, int] = {}
    for state, after in known.items():
        best = min(lengths.get(new, len(known) + 1) for new in after)
        policy[state] = next(a for a, new in enumerate(after) if lengths.get(new, len(known) + 1) == best)

    def rules(state: State, action: int) -> tuple[State, bool]:
        assert isinstance(state, KeyDoorState)
        return step(layout, state, action)

    return Oracle(rules, len(ACTIONS), policy, ended, ended)


def check_against_oracle(layout: Layout, kind: ProbabilityKind, random_steps: int) -> None:
    mdp = tabulate(layout)
    policy = plan(mdp)
    path = follow(mdp, policy)
    found = exact_importance(kind, mdp, policy, path, random_steps).values
    oracle = key_door_oracle(layout)
    labels = [mdp.states[state] for state in path.states]
    assert [oracle.policy[label] for label in labels[:-1]] == list(path.actions)
    expected = [float(getattr(oracle, kind)(label, random_steps)) for label in labels[:-1]]
    np.testing.assert_allclose(found, [*expected, 0.0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("random_steps", [0, 1, 2, 4])
@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("name", ODD_MAPS)
def test_exact_importance_is_that_of_all_random_sequences_on_odd_maps(
    name: str, kind: ProbabilityKind, random_steps: int
) -> None:
    check_against_oracle(ODD_MAPS[name], kind, random_steps)


@settings(max_examples=40)
@given(layouts(max_size=6), st.sampled_from(PROBABILITY_KINDS), st.integers(0, 3))
def test_exact_importance_is_that_of_all_random_sequences_on_any_map(
    layout: Layout, kind: ProbabilityKind, random_steps: int
) -> None:
    try:
        tabulate(layout)
    except LayoutError:
        assume(False)
    check_against_oracle(layout, kind, random_steps)


def arriving(world: tuple[DeterministicMDP, np.ndarray]) -> tuple[DeterministicMDP, np.ndarray, Trajectory]:
    mdp, policy = world
    try:
        return mdp, policy, follow(mdp, policy)
    except NeverArrives:
        assume(False)
        raise


@given(mdps_with_policy(), st.sampled_from(PROBABILITY_KINDS), st.integers(0, 4))
def test_exact_importance_is_right_where_the_policy_loops_elsewhere(
    world: tuple[DeterministicMDP, np.ndarray], kind: ProbabilityKind, random_steps: int
) -> None:
    mdp, policy, path = arriving(world)
    found = exact_importance(kind, mdp, policy, path, random_steps).values
    oracle = oracle_of(mdp, policy)
    expected = [float(getattr(oracle, kind)(state, random_steps)) for state in path.states[:-1]]
    np.testing.assert_allclose(found, [*expected, 0.0], rtol=0, atol=1e-12)


def fork() -> DeterministicMDP:
    """A start from which one may go on to the goal, dawdle in a loop, or take a way back."""
    table = np.array([[1, 2, 3], [4, 0, 2], [4, 2, 0], [0, 2, 3], [4, 4, 4]], dtype=np.int32)
    end = np.array([False, False, False, False, True])
    return DeterministicMDP(("start", "way", "dawdle", "back", "goal"), ("a", "b", "c"), table, end, end.copy(), 0)


def test_an_exact_importance_has_no_standard_error() -> None:
    mdp = fork()
    policy = np.zeros(5, dtype=np.int32)
    assert exact_importance("ace", mdp, policy, follow(mdp, policy), 3).standard_errors is None


def test_a_path_that_leaves_the_policy_or_ends_early_is_refused() -> None:
    mdp = fork()
    policy = np.zeros(5, dtype=np.int32)
    with pytest.raises(ValueError, match=r"leaves the policy in 'start'"):
        exact_importance("ace", mdp, policy, Trajectory((0, 2), (1,)), 3)
    with pytest.raises(ValueError, match=r"must end in a goal, not in 'way'"):
        exact_importance("ace", mdp, policy, Trajectory((0, 1), (0,)), 3)


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_numbers_that_make_no_sense_are_refused(kind: ProbabilityKind) -> None:
    mdp = fork()
    policy = np.zeros(5, dtype=np.int32)
    path = follow(mdp, policy)
    with pytest.raises(ValueError, match="random actions must be 0 or larger, not -1"):
        exact_importance(kind, mdp, policy, path, -1)


WORLDS: dict[str, World] = {"deterministic": fork(), "stochastic": from_deterministic(fork())}


@pytest.mark.parametrize("name", WORLDS)
def test_a_definition_that_does_not_exist_is_refused(name: str) -> None:
    policy = np.zeros(5, dtype=np.int32)
    message = "^'acee' is not an importance; use return_probability, ace, reward_importance$"
    with pytest.raises(ValueError, match=message):
        exact_importance("acee", WORLDS[name], policy, follow(fork(), policy))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", IMPORTANCE_KINDS)
@pytest.mark.parametrize("name", WORLDS)
@pytest.mark.parametrize("shape", [(0,), (1,), (4,), (6,), (5, 2), (4, 3), (5, 3, 1), ()])
def test_a_policy_of_the_wrong_shape_is_refused(name: str, kind: ImportanceKind, shape: tuple[int, ...]) -> None:
    path = follow(fork(), np.zeros(5, dtype=np.int32))
    message = rf"^a policy must have shape \(5,\) or \(5, 3\), not {re.escape(str(shape))}$"
    with pytest.raises(ValueError, match=message):
        exact_importance(kind, WORLDS[name], np.zeros(shape, dtype=np.int32), path)


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("name", WORLDS)
@pytest.mark.parametrize("random_steps", [2.5, 2.0, float("nan"), "2", None])
def test_a_number_of_random_actions_that_is_no_whole_number_is_refused(
    name: str, kind: ProbabilityKind, random_steps: object
) -> None:
    policy = np.zeros(5, dtype=np.int32)
    message = f"^the number of random actions must be a whole number, not {re.escape(repr(random_steps))}$"
    with pytest.raises(ValueError, match=message):
        exact_importance(kind, WORLDS[name], policy, follow(fork(), policy), random_steps)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("name", WORLDS)
def test_a_whole_number_of_numpy_counts_as_well(name: str, kind: ProbabilityKind) -> None:
    policy = np.zeros(5, dtype=np.int32)
    path = follow(fork(), policy)
    found = exact_importance(kind, WORLDS[name], policy, path, np.int64(3))  # type: ignore[arg-type]
    assert found.values.tolist() == exact_importance(kind, WORLDS[name], policy, path, 3).values.tolist()


@pytest.mark.parametrize(
    ("values", "errors", "message"),
    [
        ([0.5, 0.1], None, "target's importance is 0 by definition, not 0.1"),
        ([float("inf"), 0.0], None, "finite numbers"),
        ([float("nan"), 0.0], None, "finite numbers"),
        ([], None, "shape"),
        ([0.5, 0.0], [0.1], "need as many errors"),
        ([0.5, 0.0], [-0.1, 0.0], "0 or larger"),
    ],
)
def test_an_importance_is_valid_from_birth(values: list[float], errors: list[float] | None, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Importance(np.array(values), None if errors is None else np.array(errors))
