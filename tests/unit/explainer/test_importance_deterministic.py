"""Importance without a linear system: against the solver that has one, in small worlds, in balls, and without SciPy."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from tests.benchmarks.scale import draw
from tests.mdps import mdps, mdps_with_policy, planned_path
from tests.worlds import LAYOUTS
from webapp.explainer import importance_deterministic, importance_stochastic, random_phases
from webapp.explainer.importance import IMPORTANCE_KINDS, PROBABILITY_KINDS, ProbabilityKind, exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.shortest_paths import takes_shortest_paths
from webapp.explainer.solvers import NeverArrives, Trajectory, distances_to_goal, follow, plan, tie_averaged_policy
from webapp.explainer.stochastic import AnyPolicy
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import parse_layout

SOLVERS = {
    "return_probability": importance_stochastic.return_probability,
    "ace": importance_stochastic.ace,
}


@st.composite
def shortest_path_policies(draw: st.DrawFn) -> tuple[DeterministicMDP, np.ndarray, Trajectory]:
    """Draw a world, a policy that takes shortest paths with any chances, and one that it may take.

    Where no goal can be reached it does anything.
    """
    mdp = draw(mdps())
    distances = distances_to_goal(mdp)
    nearer = distances[mdp.next_state] == distances[:, None] - 1
    weights = np.array(
        [draw(st.lists(st.sampled_from([0, 1, 2, 5]), min_size=row.size, max_size=row.size)) for row in nearer],
        dtype=float,
    )
    weights = np.where(np.isfinite(distances)[:, None] & ~mdp.terminal[:, None], weights * nearer, weights)
    weights = np.where(weights.sum(axis=1, keepdims=True) > 0, weights, nearer)
    weights[weights.sum(axis=1) == 0, 0] = 1
    policy = weights / weights.sum(axis=1, keepdims=True)
    try:
        path = follow(mdp, policy.argmax(axis=1).astype(np.int32))
    except NeverArrives:
        assume(False)
        raise
    return mdp, policy, path


@given(shortest_path_policies(), st.sampled_from(PROBABILITY_KINDS), st.integers(0, 4))
def test_pushing_down_by_distance_gives_what_the_linear_system_gives(
    drawn: tuple[DeterministicMDP, np.ndarray, Trajectory], kind: ProbabilityKind, random_steps: int
) -> None:
    mdp, policy, path = drawn
    assert takes_shortest_paths(mdp, policy)
    found = exact_importance(kind, mdp, policy, path, random_steps)
    assert found.error_bound == 0
    expected, _ = SOLVERS[kind](mdp, policy, path, random_steps)
    np.testing.assert_allclose(found.values[:-1], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("name", LAYOUTS)
def test_the_averaged_policy_needs_no_linear_system_on_the_six_layouts(name: str, kind: ProbabilityKind) -> None:
    mdp = tabulate(LAYOUTS[name])
    path, averaged = follow(mdp, plan(mdp)), tie_averaged_policy(mdp)
    found = exact_importance(kind, mdp, averaged, path)
    expected, bound = SOLVERS[kind](mdp, averaged, path, 10)
    np.testing.assert_allclose(found.values[:-1], expected, rtol=0, atol=bound + 1e-12)
    assert found.error_bound == 0
    assert np.abs(found.values - exact_importance(kind, mdp, plan(mdp), path).values).max() > 0.01


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_certainty_written_as_chances_gives_the_numbers_of_the_planner(kind: ProbabilityKind) -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    path, certain = follow(mdp, policy), np.eye(mdp.num_actions)[policy]
    expected = exact_importance(kind, mdp, policy, path).values
    np.testing.assert_allclose(exact_importance(kind, mdp, certain, path).values, expected, rtol=0, atol=1e-12)


@given(mdps(), st.sampled_from(IMPORTANCE_KINDS), st.integers(0, 4))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_cutting_balls_out_of_the_world_changes_nothing(
    monkeypatch: pytest.MonkeyPatch, mdp: DeterministicMDP, kind: str, random_steps: int
) -> None:
    policy, path = planned_path(mdp)
    policies: tuple[AnyPolicy, ...] = (policy, tie_averaged_policy(mdp))
    for any_policy in policies:
        whole = exact_importance(kind, mdp, any_policy, path, random_steps)  # type: ignore[arg-type]
        with monkeypatch.context() as patched:
            patched.setattr(random_phases, "_SMALL_WORLD", 0)
            patched.setattr(random_phases, "_BLOCK", 2)
            cut = exact_importance(kind, mdp, any_policy, path, random_steps)  # type: ignore[arg-type]
        np.testing.assert_allclose(cut.values, whole.values, rtol=0, atol=1e-13)


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("name", LAYOUTS)
def test_cutting_balls_out_of_the_six_layouts_changes_nothing(
    monkeypatch: pytest.MonkeyPatch, name: str, kind: ProbabilityKind
) -> None:
    mdp = tabulate(LAYOUTS[name])
    policies: tuple[AnyPolicy, ...] = (plan(mdp), tie_averaged_policy(mdp))
    path = follow(mdp, plan(mdp))
    whole = [exact_importance(kind, mdp, policy, path).values for policy in policies]
    monkeypatch.setattr(random_phases, "_SMALL_WORLD", 0)
    monkeypatch.setattr(random_phases, "_BLOCK", 7)
    for policy, expected in zip(policies, whole, strict=True):
        cut = exact_importance(kind, mdp, policy, path).values
        np.testing.assert_allclose(cut, expected, rtol=0, atol=1e-13)


def test_no_way_back_is_exactly_zero_and_a_state_that_all_must_pass_exactly_loses_all() -> None:
    # One corridor: whoever is ahead never comes back, and nobody arrives without the last step.
    after = np.array([[1, 1], [2, 0], [3, 1], [3, 3]], dtype=np.int32)
    end = np.arange(4) == 3
    mdp = DeterministicMDP(tuple(range(4)), ("on", "back"), after, end, end.copy(), 0)
    policy = np.zeros(4, dtype=np.int32)
    path = follow(mdp, policy)
    assert exact_importance("return_probability", mdp, policy, path, 0).values.tolist() == [0, 0, 0, 0]
    assert exact_importance("return_probability", mdp, policy, path, 1).values.tolist() == [0, 0.5, 1, 0]
    assert exact_importance("ace", mdp, policy, path, 1).values[2] == 1


@given(mdps_with_policy())
def test_a_policy_is_known_by_whether_it_wastes_an_action(world: tuple[DeterministicMDP, np.ndarray]) -> None:
    mdp, policy = world
    distances = distances_to_goal(mdp)
    chances = np.eye(mdp.num_actions)[policy]
    wasted = [
        state
        for state in np.flatnonzero(np.isfinite(distances) & ~mdp.terminal)
        if distances[mdp.next_state[state, policy[state]]] >= distances[state]
    ]
    assert takes_shortest_paths(mdp, chances) == (not wasted)
    if wasted:
        target = Trajectory((int(np.argmax(mdp.goal)),), ())
        with pytest.raises(ValueError, match=rf"in '{mdp.states[int(wasted[0])]}' is on no shortest path to the goal"):
            importance_deterministic.return_probability(mdp, chances, target, 1)


def test_a_policy_that_dawdles_at_random_is_left_to_the_linear_system() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    dawdling = np.full((mdp.num_states, mdp.num_actions), 1 / mdp.num_actions)
    found = exact_importance("return_probability", mdp, dawdling, follow(mdp, plan(mdp)))
    assert found.error_bound > 0


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_a_path_that_the_averaged_policy_cannot_take_is_refused(kind: ProbabilityKind) -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    averaged = tie_averaged_policy(mdp)
    path = follow(mdp, plan(mdp))
    wasting = Trajectory((path.states[0], path.states[0], *path.states[1:]), (4, *path.actions))
    with pytest.raises(ValueError, match=r"the path leaves the policy in KeyDoorState\(x=2, y=6"):
        exact_importance(kind, mdp, averaged, wasting)
    with pytest.raises(ValueError, match="the path must end in a goal"):
        exact_importance(kind, mdp, averaged, Trajectory(path.states[:2], path.actions[:1]))
    with pytest.raises(ValueError, match="random actions must be 0 or larger, not -1"):
        exact_importance(kind, mdp, averaged, path, -1)
    with pytest.raises(ValueError, match=r"the policy's probabilities in .* must sum to 1, not 2\.0"):
        exact_importance(kind, mdp, 2 * averaged, path)
    with pytest.raises(ValueError, match=r"a policy must have shape \(308,\) or \(308, 5\), not \(308, 4\)"):
        exact_importance(kind, mdp, averaged[:, :4], path)


def test_a_path_of_the_target_alone_has_the_importance_zero() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    target = Trajectory((int(np.argmax(mdp.goal)),), ())
    for kind in IMPORTANCE_KINDS:
        assert exact_importance(kind, mdp, plan(mdp), target).values.tolist() == [0]
    for probability in PROBABILITY_KINDS:
        assert exact_importance(probability, mdp, tie_averaged_policy(mdp), target).values.tolist() == [0]


def test_a_deterministic_world_is_explained_without_scipy() -> None:
    program = """
import sys
from tests.worlds import LAYOUTS
from webapp.explainer.importance import IMPORTANCE_KINDS, PROBABILITY_KINDS, exact_importance
from webapp.explainer.solvers import follow, plan, tie_averaged_policy
from webapp.explainer.worlds.key_door import tabulate
mdp = tabulate(LAYOUTS["simulation"])
path = follow(mdp, plan(mdp))
for kind in IMPORTANCE_KINDS:
    exact_importance(kind, mdp, plan(mdp), path)
for kind in PROBABILITY_KINDS:
    exact_importance(kind, mdp, tie_averaged_policy(mdp), path)
assert "numpy" in sys.modules
print([name for name in ("scipy", "torch", "matplotlib") if name in sys.modules])
"""
    finished = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert finished.stdout.strip() == "[]"


def test_in_a_world_of_ten_thousand_states_the_linear_system_says_the_same() -> None:
    mdp = tabulate(parse_layout(draw(34)))
    assert mdp.num_states == 9980
    path = follow(mdp, plan(mdp))
    tail = path.from_step(path.num_steps - 39)
    policies: tuple[AnyPolicy, ...] = (plan(mdp), tie_averaged_policy(mdp))
    for policy in policies:
        for kind in PROBABILITY_KINDS:
            found = exact_importance(kind, mdp, policy, tail).values[:-1]
            expected, bound = SOLVERS[kind](mdp, policy, tail, 10)
            np.testing.assert_allclose(found, expected, rtol=0, atol=bound + 1e-10)
            assert found.max() > 0.1
