"""Importance against a brute-force oracle, on odd maps and on worlds that nobody chose."""

from collections import deque

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.mdps import Oracle, State, mdps_with_policy, oracle_of
from tests.worlds import LAYOUTS, lay_out, layouts
from webapp.explainer.importance import (
    IMPORTANCE_KINDS,
    Importance,
    ImportanceKind,
    exact_importance,
    sampled_importance,
    share,
)
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.seeding import stream
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan
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


def check_against_oracle(layout: Layout, kind: ImportanceKind, random_steps: int) -> None:
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
@pytest.mark.parametrize("kind", IMPORTANCE_KINDS)
@pytest.mark.parametrize("name", ODD_MAPS)
def test_exact_importance_is_that_of_all_random_sequences_on_odd_maps(
    name: str, kind: ImportanceKind, random_steps: int
) -> None:
    check_against_oracle(ODD_MAPS[name], kind, random_steps)


@settings(max_examples=40, deadline=None)
@given(layouts(max_size=6), st.sampled_from(IMPORTANCE_KINDS), st.integers(0, 3))
def test_exact_importance_is_that_of_all_random_sequences_on_any_map(
    layout: Layout, kind: ImportanceKind, random_steps: int
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


@given(mdps_with_policy(), st.sampled_from(IMPORTANCE_KINDS), st.integers(0, 4))
def test_exact_importance_is_right_where_the_policy_loops_elsewhere(
    world: tuple[DeterministicMDP, np.ndarray], kind: ImportanceKind, random_steps: int
) -> None:
    mdp, policy, path = arriving(world)
    found = exact_importance(kind, mdp, policy, path, random_steps).values
    oracle = oracle_of(mdp, policy)
    expected = [float(getattr(oracle, kind)(state, random_steps)) for state in path.states[:-1]]
    np.testing.assert_allclose(found, [*expected, 0.0], rtol=0, atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(mdps_with_policy(), st.sampled_from(IMPORTANCE_KINDS), st.integers(0, 4), st.integers(0, 2**32))
def test_sampling_finds_the_exact_value_where_the_policy_loops_elsewhere(
    world: tuple[DeterministicMDP, np.ndarray], kind: ImportanceKind, random_steps: int, seed: int
) -> None:
    mdp, policy, path = arriving(world)
    exact = exact_importance(kind, mdp, policy, path, random_steps).values
    sampled = sampled_importance(kind, mdp, policy, path, random_steps, 2000, stream(seed)).values
    np.testing.assert_allclose(sampled, exact, rtol=0, atol=8 * np.sqrt(0.5 / 2000))


@pytest.mark.parametrize("kind", IMPORTANCE_KINDS)
@pytest.mark.parametrize("name", LAYOUTS)
def test_sampling_lies_within_four_standard_errors_on_every_path_state(name: str, kind: ImportanceKind) -> None:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    path = follow(mdp, policy)
    exact = exact_importance(kind, mdp, policy, path, 10).values
    sampled = sampled_importance(kind, mdp, policy, path, 10, 1000, stream(0, name))
    # Of the two chances whose difference `ace` is, one is 1 here: the planner arrives from wherever it can.
    assert np.all(np.abs(sampled.values - exact) <= 4 * np.sqrt(exact * (1 - exact) / 1000) + 1e-12)
    other = sampled_importance(kind, mdp, policy, path, 10, 1000, stream(1, name))
    assert not np.array_equal(sampled.values, other.values)
    again = sampled_importance(kind, mdp, policy, path, 10, 1000, stream(0, name))
    np.testing.assert_array_equal(sampled.values, again.values)


@pytest.mark.parametrize("kind", IMPORTANCE_KINDS)
def test_the_standard_error_is_the_spread_of_repeated_estimates(kind: ImportanceKind) -> None:
    # Whoever ends up in `dawdle` stays there for ever, so that both chances of `ace` are uncertain.
    mdp = fork()
    policy = np.array([0, 0, 1, 0, 0], dtype=np.int32)
    path = follow(mdp, policy)
    repeated = [sampled_importance(kind, mdp, policy, path, 3, 200, stream(seed)) for seed in range(400)]
    spread = np.std([estimate.values for estimate in repeated], axis=0, ddof=1)
    errors = [estimate.standard_errors for estimate in repeated]
    assert all(error is not None for error in errors)
    np.testing.assert_allclose(np.mean(np.array(errors), axis=0), spread, rtol=0.15, atol=1e-3)
    assert spread[0] > 0.01


def fork() -> DeterministicMDP:
    """A start from which one may go on to the goal, dawdle in a loop, or take a way back."""
    table = np.array([[1, 2, 3], [4, 0, 2], [4, 2, 0], [0, 2, 3], [4, 4, 4]], dtype=np.int32)
    end = np.array([False, False, False, False, True])
    return DeterministicMDP(("start", "way", "dawdle", "back", "goal"), ("a", "b", "c"), table, end, end.copy(), 0)


def test_the_error_of_a_difference_joins_both_errors() -> None:
    difference = share(64, 100).minus(share(50, 100))
    assert difference.value == pytest.approx(0.14)
    assert difference.standard_error == pytest.approx(np.hypot(0.048, 0.05))


def test_an_exact_importance_has_no_standard_error_and_a_sampled_one_has_as_many_as_states() -> None:
    mdp = fork()
    policy = np.zeros(5, dtype=np.int32)
    path = follow(mdp, policy)
    assert exact_importance("ace", mdp, policy, path, 3).standard_errors is None
    sampled = sampled_importance("ace", mdp, policy, path, 3, 50, stream(0))
    assert sampled.standard_errors is not None
    assert sampled.standard_errors.shape == sampled.values.shape == (3,)
    assert sampled.values[-1] == sampled.standard_errors[-1] == 0


def test_more_trials_than_run_at_once_are_all_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("webapp.explainer.importance._MAX_WALKERS", 7)
    mdp = fork()
    policy = np.zeros(5, dtype=np.int32)
    path = follow(mdp, policy)
    exact = exact_importance("return_probability", mdp, policy, path, 3).values
    sampled = sampled_importance("return_probability", mdp, policy, path, 3, 2000, stream(0)).values
    np.testing.assert_allclose(sampled, exact, rtol=0, atol=0.05)


def test_a_path_that_leaves_the_policy_or_ends_early_is_refused() -> None:
    mdp = fork()
    policy = np.zeros(5, dtype=np.int32)
    with pytest.raises(ValueError, match=r"leaves the policy in 'start'"):
        exact_importance("ace", mdp, policy, Trajectory((0, 2), (1,)), 3)
    with pytest.raises(ValueError, match=r"must end in a goal, not in 'way'"):
        exact_importance("ace", mdp, policy, Trajectory((0, 1), (0,)), 3)


@pytest.mark.parametrize("kind", IMPORTANCE_KINDS)
def test_numbers_that_make_no_sense_are_refused(kind: ImportanceKind) -> None:
    mdp = fork()
    policy = np.zeros(5, dtype=np.int32)
    path = follow(mdp, policy)
    with pytest.raises(ValueError, match="random actions must be 0 or larger, not -1"):
        exact_importance(kind, mdp, policy, path, -1)
    with pytest.raises(ValueError, match="random actions must be 0 or larger, not -1"):
        sampled_importance(kind, mdp, policy, path, -1, 10, stream(0))
    with pytest.raises(ValueError, match="trials must be 1 or larger, not 0"):
        sampled_importance(kind, mdp, policy, path, 1, 0, stream(0))


@pytest.mark.parametrize(
    ("values", "errors", "message"),
    [
        ([0.5, 0.1], None, "target's importance is 0 by definition, not 0.1"),
        ([1.5, 0.0], None, "between -1 and 1"),
        ([float("nan"), 0.0], None, "between -1 and 1"),
        ([], None, "shape"),
        ([0.5, 0.0], [0.1], "need as many errors"),
        ([0.5, 0.0], [-0.1, 0.0], "0 or larger"),
    ],
)
def test_an_importance_is_valid_from_birth(values: list[float], errors: list[float] | None, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Importance(np.array(values), None if errors is None else np.array(errors))
