"""Walkers on a table go where the rules let them, as often as they should, and stop where Algorithm 1 stops."""

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.mdps import mdps, mdps_with_policy, oracle_of, planned_path
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, some_path
from tests.worlds import LAYOUTS
from webapp.explainer import reachability
from webapp.explainer.batched_rollouts import TableRollouts, chosen_device, seeded, table
from webapp.explainer.batched_rollouts.draws import Drawer, whole_numbers
from webapp.explainer.batched_rollouts.jumps import PolicyJumps
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.reachability import markov_chain, steps_towards
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan, random_phase
from webapp.explainer.stochastic import StochasticMDP, from_deterministic, from_outcomes
from webapp.explainer.trials import Question
from webapp.explainer.urns import fill_urns, uniform
from webapp.explainer.worlds.key_door import tabulate

CPU = torch.device("cpu")


@pytest.fixture(params=["copies of the world", "one world for all"])
def copies(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Small worlds are copied for each state of the path; large ones are not."""
    if request.param == "one world for all":
        monkeypatch.setattr(table, "_LARGEST_TABLE", 0)


@given(mdps(), st.integers(0, 5), st.integers(0, 2**32), st.booleans())
def test_random_walkers_only_go_where_random_actions_can_lead(
    mdp: DeterministicMDP, num_steps: int, seed: int, denied: bool
) -> None:
    policy, path = planned_path(mdp)
    rollouts = TableRollouts(mdp, policy, path, CPU)
    ends = rollouts.random_phase(num_steps, 3, seeded(seed), denied=denied).view(-1, 3).tolist()
    for pair, places in zip(path.pairs, ends, strict=True):
        possible = random_phase(mdp, pair[0], num_steps, forbidden=pair if denied else None)
        assert all(possible[place] > 0 for place in places)


def turning_world() -> tuple[DeterministicMDP, np.ndarray, Trajectory]:
    """Five states with three actions each, of which one, two or three may be chosen at random."""
    moves = np.array([[1, 2, 0], [0, 3, 1], [0, 1, 3], [0, 1, 2], [4, 4, 4]], dtype=np.int32)
    moves[3, 2] = 4
    end = np.array([False, False, False, False, True])
    mdp = DeterministicMDP(tuple("abcdg"), ("x", "y", "z"), moves, end, end.copy(), 0)
    policy = plan(mdp)
    return mdp, policy, follow(mdp, policy)


@pytest.mark.usefixtures("copies")
@pytest.mark.parametrize("denied", [False, True])
@pytest.mark.parametrize("num_steps", [1, 2, 3, 9])
def test_random_walkers_spread_as_the_exact_random_phase_does(num_steps: int, denied: bool) -> None:
    mdp, policy, path = turning_world()
    walkers = TableRollouts(mdp, policy, path, CPU).random_phase(num_steps, 20_000, seeded(5), denied=denied)
    for pair, ends in zip(path.pairs, walkers.view(-1, 20_000), strict=True):
        expected = random_phase(mdp, pair[0], num_steps, forbidden=pair if denied else None)
        shares = np.bincount(ends.numpy(), minlength=5) / 20_000
        assert np.all(np.abs(shares - expected) <= 4 * np.sqrt(expected * (1 - expected) / 20_000) + 1e-12)


def slippery_ring(slip: float) -> tuple[StochasticMDP, np.ndarray, Trajectory]:
    """Four states in a ring with the goal behind the last; each action slips to the other side now and then."""
    outcomes = []
    for state in range(4):
        for action, step in ((0, 1), (1, -1)):
            ahead, behind = (state + step) % 5, (state - step) % 4
            ahead = 3 if ahead == 4 and action == 1 else ahead
            outcomes += [(state, action, ahead, 1 - slip), (state, action, behind, slip)]
    end = np.arange(5) == 4
    mdp = from_outcomes(list(range(5)), ["on", "back"], outcomes, terminal=end, goal=end.copy(), start=0)
    return mdp, np.zeros(5, dtype=np.int32), Trajectory((0, 1, 2, 3, 4), (0, 0, 0, 0))


@pytest.mark.usefixtures("copies")
@pytest.mark.parametrize("denied", [False, True])
@pytest.mark.parametrize("slip", [0.25, 0.1234])
def test_random_walkers_spread_as_they_should_where_actions_slip(slip: float, denied: bool) -> None:
    mdp, policy, path = slippery_ring(slip)
    walkers = TableRollouts(mdp, policy, path, CPU).random_phase(4, 20_000, seeded(6), denied=denied)
    for pair, ends in zip(path.pairs, walkers.view(-1, 20_000), strict=True):
        expected = reachability.random_phase(mdp, pair[0], 4, forbidden=(pair,) if denied else ())
        shares = np.bincount(ends.numpy(), minlength=5) / 20_000
        assert np.all(np.abs(shares - expected) <= 4 * np.sqrt(expected * (1 - expected) / 20_000) + 1e-12)


@pytest.mark.parametrize("num_steps", [1, 2, 3])
def test_looking_several_steps_up_at_once_gives_each_end_its_exact_chance(num_steps: int) -> None:
    mdp = tabulate(LAYOUTS["experiment1-c"])
    drawer = Drawer(fill_urns(from_deterministic(mdp), np.arange(mdp.num_states), uniform(mdp.selectable)), CPU)
    outcomes = drawer._table(num_steps).numpy()
    for state in range(0, mdp.num_states, 7):
        shares = np.bincount(outcomes[state], minlength=mdp.num_states) / outcomes.shape[1]
        np.testing.assert_allclose(shares, random_phase(mdp, state, num_steps), rtol=0, atol=1e-12)


@pytest.mark.parametrize("below", [1, 2, 3, 12, 144, 255, 256, 257, 5000])
def test_whole_numbers_are_uniform_and_independent_of_each_other(below: int) -> None:
    like = torch.zeros(200_000, dtype=torch.int32)
    draws = [drawn.clone().numpy() for drawn in whole_numbers(below, 3, like, seeded(1))]
    assert len(draws) == 3
    for drawn in draws:
        assert drawn.min() >= 0
        assert drawn.max() < below
        counts = np.bincount(drawn, minlength=below)
        squares = ((counts - 200_000 / below) ** 2 / (200_000 / below)).sum()
        assert squares <= below - 1 + 5 * np.sqrt(2 * below)
    if below > 1:
        for i, j in ((0, 1), (1, 2), (0, 2)):
            assert abs(np.corrcoef(draws[i], draws[j])[0, 1]) < 5 / np.sqrt(200_000)


@given(mdps_with_policy())
def test_walkers_return_and_arrive_exactly_where_a_single_walk_would(
    world: tuple[DeterministicMDP, np.ndarray],
) -> None:
    mdp, policy = world
    try:
        path = follow(mdp, policy)
    except NeverArrives:
        assume(False)
        raise
    oracle = oracle_of(mdp, policy)
    chain = from_deterministic(mdp)
    successor = np.where(mdp.terminal, np.arange(mdp.num_states), mdp.next_state[np.arange(mdp.num_states), policy])
    distance = steps_towards(markov_chain(chain, policy), mdp.goal)
    jumps = PolicyJumps(torch.from_numpy(successor.astype(np.int32)), distance)
    everywhere = torch.arange(mdp.num_states, dtype=torch.int32)
    for featured in path.states[:-1]:
        met = jumps.meet(everywhere, torch.full_like(everywhere, featured)).tolist()
        assert met == [oracle.comes_to(state, featured) for state in range(mdp.num_states)]
    assert jumps.arrive(everywhere).tolist() == [oracle.reaches_goal(state, None) for state in range(mdp.num_states)]


@settings(max_examples=60)
@given(fraction_worlds(), st.integers(0, 2**32))
def test_without_random_actions_walkers_return_and_arrive_as_often_as_the_chain_does(
    world: FractionWorld, seed: int
) -> None:
    path = some_path(world)
    assume(path is not None)
    assert path is not None
    rollouts, n = TableRollouts(as_mdp(world), policy_of(world), path, CPU), 400
    returned = rollouts.count("returns", 0, n, seeded(seed))
    arrived = [rollouts.count(question, 0, n, seeded(seed)) for question in ("arrives", "arrives_denied")]
    assert not returned.truncated.any()
    for place, state in enumerate(path.states[:-1]):
        expected = float(world.return_probability(state, 0))
        assert abs(returned.successes[place] / n - expected) <= 6 * np.sqrt(0.25 / n)
        difference = (arrived[0].successes[place] - arrived[1].successes[place]) / n
        assert abs(difference - float(world.ace(state, 0))) <= 6 * np.sqrt(0.25 / n)
        assert arrived[1].successes[place] == 0


def slow_world(leave: float) -> tuple[StochasticMDP, np.ndarray, Trajectory]:
    """A start that is hardly ever left."""
    end = np.array([False, True])
    outcomes = [(0, 0, 0, 1 - leave), (0, 0, 1, leave)]
    mdp = from_outcomes(["wait", "goal"], ["go"], outcomes, terminal=end, goal=end.copy(), start=0)
    return mdp, np.zeros(2, dtype=np.int32), Trajectory((0, 1), (0,))


def test_walkers_that_take_too_long_are_broken_off_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "MAX_POLICY_STEPS", 3)
    mdp, policy, path = slow_world(0.5)
    found = TableRollouts(mdp, policy, path, CPU).count("arrives", 0, 8000, seeded(0))
    # After three actions one in eight still waits.
    assert found.successes[0] + found.truncated[0] == 8000
    assert abs(found.truncated[0] - 1000) < 5 * np.sqrt(8000 * 7 / 64)


def test_walkers_that_loop_for_ever_are_stopped_at_once_and_not_broken_off() -> None:
    # The random action leads into a loop of two states; the policy of chances never leaves it.
    end = np.array([False, False, False, True])
    outcomes = [(0, 0, 3, 0.5), (0, 0, 0, 0.5), (0, 1, 1, 1.0)]
    outcomes += [(1, 0, 2, 1.0), (1, 1, 2, 1.0), (2, 0, 1, 0.5), (2, 0, 2, 0.5), (2, 1, 1, 1.0)]
    mdp = from_outcomes(list("abcd"), ["x", "y"], outcomes, terminal=end, goal=end.copy(), start=0)
    rollouts = TableRollouts(mdp, np.zeros(4, dtype=np.int32), Trajectory((0, 3), (0,)), CPU)
    questions: tuple[Question, ...] = ("returns", "arrives", "arrives_denied")
    for question in questions:
        found = rollouts.count(question, 1, 100, seeded(0))
        assert (found.successes[0], found.truncated[0]) == (0, 0)


@pytest.mark.parametrize("question", ["returns", "arrives_denied"])
def test_a_bank_holds_no_more_walkers_than_it_may_and_all_are_counted(
    question: Question, monkeypatch: pytest.MonkeyPatch
) -> None:
    mdp, policy, path = turning_world()
    rollouts = TableRollouts(mdp, policy, path, CPU)
    at_once = rollouts.count(question, 3, 20_000, seeded(0))
    monkeypatch.setattr(table, "_WALKERS", {"cpu": 999})
    in_turns = rollouts.count(question, 3, 20_000, seeded(0))
    assert in_turns.num_trials == at_once.num_trials == 20_000
    assert np.all(np.abs(in_turns.successes - at_once.successes) < 6 * np.sqrt(20_000 / 2))


def test_what_a_policy_does_is_the_same_with_and_without_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    path = follow(mdp, policy)
    small = TableRollouts(mdp, policy, path, CPU).count("returns", 6, 500, seeded(4))
    monkeypatch.setattr(table, "_LARGEST_TABLE", 0)
    large = TableRollouts(mdp, policy, path, CPU).count("returns", 6, 500, seeded(4))
    assert small.successes.tolist() == large.successes.tolist()


def test_a_negative_number_of_random_actions_is_refused() -> None:
    mdp, policy, path = turning_world()
    with pytest.raises(ValueError, match="random actions must be 0 or larger, not -3"):
        TableRollouts(mdp, policy, path, CPU).count("returns", -3, 10, seeded(0))


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (Trajectory((0, 1), (0,)), r"must end in a goal, not in 1"),
        (Trajectory((0, 1, 2, 3, 4), (0, 1, 0, 0)), r"leaves the policy in 1"),
        (Trajectory((0, 2, 3, 4), (0, 0, 0)), r"leaves the policy in 0"),
        (Trajectory((0, 1), (7,)), r"leaves the policy in 0"),
        (Trajectory((0, 9), (0,)), r"indices from 0 to 4, not \(0, 9\)"),
    ],
)
def test_a_path_that_the_policy_may_not_take_to_a_goal_is_refused(path: Trajectory, message: str) -> None:
    mdp, policy, _ = slippery_ring(0.25)
    with pytest.raises(ValueError, match=message):
        TableRollouts(mdp, policy, path, CPU)


@pytest.mark.parametrize("name", ["cpu:zero", "no such thing", "meta-physics"])
def test_a_device_that_is_not_there_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"no device '{name}' here; use cpu"):
        chosen_device(name)


def test_the_accelerator_is_chosen_if_there_is_one() -> None:
    assert chosen_device("cpu") == CPU
    there = torch.accelerator.current_accelerator(check_available=True)
    assert chosen_device() == (there or CPU)
