"""Importance by rollouts on a table: right, repeatable, and stopped for the reason that is given."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.conftest import ROOT
from tests.mdps import mdps_with_policy
from tests.sampled import sampled_importance
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, some_path
from tests.worlds import LAYOUTS
from webapp.explainer.batched_rollouts import table
from webapp.explainer.importance import PROBABILITY_KINDS, Importance, ProbabilityKind, exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.sampling import Sampled, sample, spend
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan, tie_averaged_policy
from webapp.explainer.stochastic import AnyPolicy, StochasticMDP, World, from_deterministic, from_outcomes
from webapp.explainer.stop_rule import StopRule
from webapp.explainer.subgoals import importance_threshold
from webapp.explainer.trials import Question, Tally
from webapp.explainer.worlds.key_door import tabulate

DEVICES = ["cpu", *([torch.accelerator.current_accelerator().type] if torch.accelerator.is_available() else [])]  # type: ignore[union-attr]


def fork() -> tuple[DeterministicMDP, np.ndarray, Trajectory]:
    """A start from which one may go on to the goal, take a way back, or dawdle for ever: the policy does not leave."""
    moves = np.array([[1, 2, 3], [4, 0, 2], [4, 2, 0], [0, 2, 3], [4, 4, 4]], dtype=np.int32)
    end = np.array([False, False, False, False, True])
    mdp = DeterministicMDP(("start", "way", "dawdle", "back", "goal"), ("a", "b", "c"), moves, end, end.copy(), 0)
    policy = np.array([0, 0, 1, 0, 0], dtype=np.int32)
    return mdp, policy, follow(mdp, policy)


def slipping(mdp: DeterministicMDP, slip: float) -> StochasticMDP:
    """The same world, in which each action does nothing now and then."""
    outcomes: list[tuple[int, int, int, float]] = []
    for (state, action), new in np.ndenumerate(mdp.next_state):
        after = int(new)
        stays = after == state
        outcomes.append((state, action, after, 1.0 if stays else 1 - slip))
        outcomes += [] if stays else [(state, action, state, slip)]
    return from_outcomes(mdp.states, mdp.actions, outcomes, terminal=mdp.terminal, goal=mdp.goal, start=mdp.start)


def all_errors(importance: Importance) -> np.ndarray:
    assert importance.standard_errors is not None
    return importance.standard_errors


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("name", LAYOUTS)
def test_sampling_lies_within_four_standard_errors_on_every_path_state(name: str, kind: ProbabilityKind) -> None:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    path = follow(mdp, policy)
    exact = exact_importance(kind, mdp, policy, path, 10).values
    sampled = sampled_importance(kind, mdp, policy, path, 10, 10_000, 0)
    # Of the two chances whose difference `ace` is, one is 1 here: the planner arrives from wherever it can.
    assert np.all(np.abs(sampled.values - exact) <= 4 * np.sqrt(exact * (1 - exact) / 10_000) + 1e-12)


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize("slip", [0.0, 0.25, 0.137])
def test_chances_in_the_world_and_in_the_policy_are_sampled_as_they_are_solved(
    slip: float, ties: bool, kind: ProbabilityKind
) -> None:
    mdp = tabulate(LAYOUTS["experiment1-c"])
    path = follow(mdp, plan(mdp))
    policy: AnyPolicy = tie_averaged_policy(mdp) if ties else plan(mdp)
    world: World = slipping(mdp, slip) if slip else mdp
    exact = exact_importance(kind, world, policy, path, 6).values
    sampled = sampled_importance(kind, world, policy, path, 6, 4000, 3)
    assert np.all(np.abs(sampled.values - exact) <= 4 * np.maximum(all_errors(sampled), 0.5 / 4000) + 1e-12)


def test_a_world_without_chance_is_sampled_alike_however_it_is_written_down() -> None:
    mdp, policy, path = fork()
    one_hot = np.eye(3)[policy]
    for kind in PROBABILITY_KINDS:
        plain = sampled_importance(kind, mdp, policy, path, 3, 500, 9).values
        for world, rule in ((from_deterministic(mdp), policy), (mdp, one_hot), (from_deterministic(mdp), one_hot)):
            np.testing.assert_array_equal(sampled_importance(kind, world, rule, path, 3, 500, 9).values, plain)


@settings(max_examples=60)
@given(mdps_with_policy(), st.sampled_from(PROBABILITY_KINDS), st.integers(0, 4), st.integers(0, 2**32))
def test_sampling_finds_the_exact_value_where_the_policy_loops_elsewhere(
    world: tuple[DeterministicMDP, np.ndarray], kind: ProbabilityKind, random_steps: int, seed: int
) -> None:
    mdp, policy = world
    try:
        path = follow(mdp, policy)
    except NeverArrives:
        assume(False)
        raise
    exact = exact_importance(kind, mdp, policy, path, random_steps).values
    sampled = sampled_importance(kind, mdp, policy, path, random_steps, 2000, seed).values
    np.testing.assert_allclose(sampled, exact, rtol=0, atol=8 * np.sqrt(0.5 / 2000))


@settings(max_examples=60)
@given(fraction_worlds(), st.sampled_from(PROBABILITY_KINDS), st.integers(0, 3), st.integers(0, 2**32))
def test_sampling_finds_the_fractions_of_worlds_that_nobody_chose(
    world: FractionWorld, kind: ProbabilityKind, random_steps: int, seed: int
) -> None:
    path = some_path(world)
    assume(path is not None)
    assert path is not None
    mdp, policy = as_mdp(world), policy_of(world)
    expected = [float(getattr(world, kind)(state, random_steps)) for state in path.states[:-1]]
    sampled = sample(kind, mdp, policy, path, random_steps, StopRule(1000), seed)
    np.testing.assert_allclose(sampled.importance.values, [*expected, 0.0], rtol=0, atol=8 * np.sqrt(0.5 / 1000))
    assert sampled.num_truncated == 0


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_equal_seeds_give_equal_numbers_and_others_do_not(kind: ProbabilityKind, device: str) -> None:
    mdp, policy, path = fork()
    for world in (mdp, slipping(mdp, 0.3)):
        first = sampled_importance(kind, world, policy, path, 3, 700, 5, device).values
        np.testing.assert_array_equal(sampled_importance(kind, world, policy, path, 3, 700, 5, device).values, first)
        assert not np.array_equal(sampled_importance(kind, world, policy, path, 3, 700, 6, device).values, first)
        exact = exact_importance(kind, world, policy, path, 3).values
        np.testing.assert_allclose(first, exact, rtol=0, atol=6 * np.sqrt(0.5 / 700))


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_the_standard_error_is_the_spread_of_repeated_estimates(kind: ProbabilityKind) -> None:
    # Whoever ends up in `dawdle` stays there for ever, so that both chances of `ace` are uncertain.
    mdp, policy, path = fork()
    repeated = [sampled_importance(kind, mdp, policy, path, 3, 200, seed) for seed in range(400)]
    spread = np.std([estimate.values for estimate in repeated], axis=0, ddof=1)
    errors = np.mean([all_errors(estimate) for estimate in repeated], axis=0)
    np.testing.assert_allclose(errors, spread, rtol=0.15, atol=1e-3)
    assert spread[0] > 0.01
    assert errors.shape == (3,)
    assert errors[-1] == repeated[0].values[-1] == 0


def test_without_an_early_stop_the_budget_is_spent_to_the_last_trial() -> None:
    mdp, policy, path = fork()
    for budget in (1, 57, 1000):
        found = sample("ace", mdp, policy, path, 3, StopRule(budget), 0)
        assert (found.num_trials, found.stopped) == (budget, "budget")
        shares = found.importance.values * budget
        np.testing.assert_allclose(shares, np.round(shares), atol=1e-9)


def test_sampling_stops_early_when_every_side_is_settled_and_says_so() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    path = follow(mdp, policy)
    found = sample("return_probability", mdp, policy, path, 10, StopRule(1_000_000, early=True), 0)
    assert (found.stopped, found.unsettled) == ("settled", ())
    assert found.num_trials < 100_000
    exact = exact_importance("return_probability", mdp, policy, path, 10).values
    sampled = found.importance.values
    np.testing.assert_array_equal(sampled > importance_threshold(sampled), exact > importance_threshold(exact))


def test_a_state_on_the_threshold_is_never_settled_so_the_budget_ends_it_and_the_step_is_named() -> None:
    # Without random actions nobody returns: all importances are 0, and so is their mean.
    mdp, policy, path = fork()
    found = sample("return_probability", mdp, policy, path, 0, StopRule(5000, early=True), 0)
    assert (found.num_trials, found.stopped, found.unsettled) == (5000, "budget", (1, 2, 3))


def test_a_budget_too_small_names_the_steps_that_are_left_open() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    path = follow(mdp, policy)
    small = sample("ace", mdp, policy, path, 10, StopRule(100, early=True), 0)
    assert small.stopped == "budget"
    large = sample("ace", mdp, policy, path, 10, StopRule(100_000, early=True), 0)
    assert set(large.unsettled) < set(small.unsettled)


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_hardly_any_run_settles_a_side_of_a_real_path_wrongly(kind: ProbabilityKind) -> None:
    mdp, policy, path = fork()
    exact = exact_importance(kind, mdp, policy, path, 3).values
    truth = exact > importance_threshold(exact)
    rule, num_wrong, num_settled = StopRule(3000, early=True, first_look=30), 0, 0
    for seed in range(60):
        found = sample(kind, mdp, policy, path, 3, rule, seed)
        values = found.importance.values
        settled = [step for step in range(3) if step + 1 not in found.unsettled]
        num_settled += len(settled)
        num_wrong += any((values > importance_threshold(values))[step] != truth[step] for step in settled)
    assert num_settled > 60
    assert num_wrong <= 8


def test_rollouts_that_were_broken_off_are_reported_and_settle_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    end = np.array([False, True])
    outcomes = [(0, 0, 0, 0.999), (0, 0, 1, 0.001)]
    mdp = from_outcomes(["wait", "goal"], ["go"], outcomes, terminal=end, goal=end.copy(), start=0)
    policy, path = np.zeros(2, dtype=np.int32), Trajectory((0, 1), (0,))
    whole = sample("ace", mdp, policy, path, 0, StopRule(500), 0)
    assert (whole.num_truncated, whole.unsettled, whole.importance.values[0]) == (0, (), 1.0)
    monkeypatch.setattr(table, "MAX_POLICY_STEPS", 20)
    broken = sample("ace", mdp, policy, path, 0, StopRule(500, early=True), 0)
    assert broken.num_truncated > 450
    assert (broken.stopped, broken.num_trials) == ("budget", 500)
    assert 1 in broken.unsettled


def test_a_path_that_is_the_target_alone_needs_no_trial() -> None:
    mdp, policy, _ = fork()
    found = sample("ace", mdp, policy, Trajectory((4,), ()), 3, StopRule(1000), 0)
    assert (found.num_trials, found.stopped, found.unsettled) == (0, "settled", ())
    assert found.importance.values.tolist() == [0.0]


def test_numbers_that_make_no_sense_are_refused() -> None:
    mdp, policy, path = fork()
    for world in (mdp, slipping(mdp, 0.5)):
        for kind in PROBABILITY_KINDS:
            with pytest.raises(ValueError, match="random actions must be 0 or larger, not -1"):
                sampled_importance(kind, world, policy, path, -1, 10, 0)
        with pytest.raises(ValueError, match="trials must be a whole number from 1 to 1,000,000, not 0"):
            sampled_importance("ace", world, policy, path, 1, 0, 0)
        with pytest.raises(ValueError, match="trials must be a whole number from 1 to 1,000,000, not 1000001"):
            sampled_importance("ace", world, policy, path, 1, 1_000_001, 0)
        with pytest.raises(ValueError, match="seed must be 0 or larger, not -1"):
            sampled_importance("ace", world, policy, path, 1, 10, -1)
        with pytest.raises(ValueError, match="reward_importance is not a probability and cannot be sampled"):
            sampled_importance("reward_importance", world, policy, path, 1, 10, 0)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="no device 'abacus' here"):
            sampled_importance("ace", world, policy, path, 1, 10, 0, "abacus")
        with pytest.raises(ValueError, match="leaves the policy in 'start'"):
            sampled_importance("ace", world, policy, Trajectory((0, 3, 0, 1, 4), (2, 0, 0, 0)), 1, 10, 0)
        with pytest.raises(ValueError, match=r"a policy must have shape \(5,\) or \(5, 3\), not \(4,\)"):
            sampled_importance("ace", world, policy[:4], path, 1, 10, 0)
        with pytest.raises(ValueError, match="a probability must be a number from 0 to 1, not nan"):
            sampled_importance("ace", world, np.full((5, 3), np.nan), path, 1, 10, 0)


def test_what_is_settled_leaves_nothing_open() -> None:
    with pytest.raises(ValueError, match=r"leaves none open, and here are \(2,\)"):
        Sampled(Importance(np.zeros(3), np.zeros(3)), 10, "settled", (2,))


def test_whatever_runs_the_trials_gets_the_same_estimates_and_the_same_stop() -> None:
    asked: list[tuple[Question, int]] = []

    def count(question: Question, size: int) -> Tally:
        asked.append((question, size))
        successes = [size, size // 2] if question == "arrives" else [0, size // 2]
        return Tally(size, np.array(successes), np.zeros(2, dtype=np.int64))

    found = spend("ace", Trajectory((0, 1, 2), (0, 0)), StopRule(1000, early=True), count)
    assert found.stopped == "settled"
    assert found.importance.values.tolist() == [1.0, 0.0, 0.0]
    assert all_errors(found.importance) == pytest.approx([0, np.sqrt(2 * 0.25 / found.num_trials), 0])
    assert sum(size for question, size in asked if question == "arrives") == found.num_trials
    assert [question for question, _ in asked[:2]] == ["arrives", "arrives_denied"]


def test_torch_is_loaded_by_the_first_sample_and_not_before() -> None:
    code = "import sys, webapp.explainer.sampling; sys.exit('torch' in sys.modules or 'scipy' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@pytest.mark.slow
def test_the_largest_budget_takes_no_more_memory_than_a_small_one() -> None:
    code = """
import resource, sys
from tests.worlds import LAYOUTS
from tests.sampled import sampled_importance
from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds.key_door import tabulate
mdp = tabulate(LAYOUTS["simulation"])
policy = plan(mdp)
path = follow(mdp, policy)
peaks = []
for num_trials in (1, 1_000_000):
    sampled_importance("ace", mdp, policy, path, 10, num_trials, 0, "cpu")
    peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
sys.exit(peaks[1] - peaks[0] > 64 * 1024)
"""
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
