from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.mdps import mdps, planned_path
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, some_path
from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.fidelity import drops, fidelities, policy_fidelity, smallest_sufficient
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.seeding import stream
from webapp.explainer.selectors import random_pair_steps
from webapp.explainer.solvers import Trajectory, follow, plan, tie_averaged_policy
from webapp.explainer.stochastic import from_deterministic, from_outcomes
from webapp.explainer.worlds.key_door import tabulate

DETOUR = lay_out("######", "#>KDG#", "#....#", "######")


def walks(
    mdp: DeterministicMDP, policy: np.ndarray, followed: set[int], state: int, remaining: int
) -> Iterator[tuple[Fraction, int]]:
    """Yield the probability and the end of every sequence of actions, one after the other."""
    if remaining == 0 or mdp.terminal[state]:
        yield Fraction(1), state
        return
    after = [int(new) for new in mdp.next_state[state]]
    choices = [after[policy[state]]] if state in followed else [new for new in after if new != state] or [state]
    for new in choices:
        for share, end in walks(mdp, policy, followed, new, remaining - 1):
            yield share / len(choices), end


def enumerated(mdp: DeterministicMDP, policy: np.ndarray, followed: set[int], start: int, horizon: int) -> float:
    ends = walks(mdp, policy, followed, start, horizon)
    return float(sum((share for share, end in ends if mdp.goal[end]), Fraction(0)))


@given(mdps(max_states=6, max_actions=2), st.data())
def test_both_measures_are_those_of_every_sequence_of_actions(mdp: DeterministicMDP, data: st.DataObject) -> None:
    policy, path = planned_path(mdp)
    steps = data.draw(st.sets(st.integers(1, path.num_steps)))
    chosen = {path.states[step - 1] for step in steps}
    horizon = 2 * path.num_steps
    only = enumerated(mdp, policy, chosen, path.states[0], horizon)
    but = enumerated(mdp, policy, set(range(mdp.num_states)) - chosen, path.states[0], horizon)
    assert fidelities(mdp, policy, path, [sorted(steps)]) == pytest.approx([only], abs=1e-12)
    assert drops(mdp, policy, path, [sorted(steps)]) == pytest.approx([1 - but], abs=1e-12)


def chances(world: FractionWorld, followed: set[int], state: int, remaining: int) -> Fraction:
    """Add up every sequence of actions and outcomes that ends in a goal."""
    if remaining == 0 or state in world.ended:
        return Fraction(state in world.goals)
    actions = world.policy[state]
    if state not in followed:
        moving = [a for a in range(world.num_actions) if set(world.outcomes[state, a]) != {state}]
        if not moving:
            return Fraction(0)
        actions = dict.fromkeys(moving, Fraction(1, len(moving)))
    return sum(
        (
            chance * share * chances(world, followed, after, remaining - 1)
            for action, chance in actions.items()
            for after, share in world.outcomes[state, action].items()
        ),
        Fraction(0),
    )


@settings(max_examples=80)
@given(fraction_worlds(max_states=4, max_actions=2), st.data())
def test_in_a_stochastic_world_every_outcome_counts(world: FractionWorld, data: st.DataObject) -> None:
    path = some_path(world)
    assume(path is not None)
    assert path is not None
    steps = sorted(data.draw(st.sets(st.integers(1, path.num_steps))))
    chosen, start, horizon = {path.states[step - 1] for step in steps}, path.states[0], 2 * path.num_steps
    mdp, policy = as_mdp(world), policy_of(world)
    only = chances(world, chosen, start, horizon)
    everywhere = chances(world, set(world.states), start, horizon)
    but = chances(world, set(world.states) - chosen, start, horizon)
    assert fidelities(mdp, policy, path, [steps]) == pytest.approx([float(only)], abs=1e-12)
    assert drops(mdp, policy, path, [steps]) == pytest.approx([float(everywhere - but)], abs=1e-12)
    assert policy_fidelity(mdp, policy, path) == pytest.approx(float(everywhere), abs=1e-12)


@given(mdps(), st.data())
def test_a_world_with_certain_outcomes_gives_the_same_either_way(mdp: DeterministicMDP, data: st.DataObject) -> None:
    policy, path = planned_path(mdp)
    steps = sorted(data.draw(st.sets(st.integers(1, path.num_steps))))
    for measure in (fidelities, drops):
        plain, wrapped = measure(mdp, policy, path, [steps]), measure(from_deterministic(mdp), policy, path, [steps])
        assert plain == pytest.approx(wrapped, abs=1e-12)
    assert policy_fidelity(mdp, policy, path) == policy_fidelity(mdp, tie_averaged_policy(mdp), path) == 1


@given(mdps(max_states=6, max_actions=2), st.data())
def test_any_policy_can_be_followed_on_any_walk(mdp: DeterministicMDP, data: st.DataObject) -> None:
    policies = st.lists(st.integers(0, mdp.num_actions - 1), min_size=mdp.num_states, max_size=mdp.num_states)
    policy = np.array(data.draw(policies), dtype=np.int32)
    states = [mdp.start]
    for _ in range(data.draw(st.integers(1, 4))):
        states.append(int(mdp.next_state[states[-1], policy[states[-1]]]))
    walk = Trajectory(tuple(states), tuple(int(policy[state]) for state in states[:-1]))
    steps = sorted(data.draw(st.sets(st.integers(1, walk.num_steps))))
    chosen = {states[step - 1] for step in steps}
    expected = enumerated(mdp, policy, chosen, mdp.start, 2 * walk.num_steps)
    assert fidelities(mdp, policy, walk, [steps]) == pytest.approx([expected], abs=1e-12)


@given(mdps())
def test_the_whole_path_leads_to_the_goal_and_no_step_at_random_loses_nothing(mdp: DeterministicMDP) -> None:
    policy, path = planned_path(mdp)
    everything = tuple(range(1, path.num_steps + 1))
    assert fidelities(mdp, policy, path, [everything]).tolist() == [1.0]
    assert drops(mdp, policy, path, [()]).tolist() == [0.0]


@pytest.mark.parametrize("name", ["simulation", "experiment1-a"])
def test_a_sample_of_walks_agrees_within_four_standard_errors(name: str) -> None:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    path = follow(mdp, policy)
    steps = tuple(range(2, path.num_steps + 1))
    chosen = np.isin(np.arange(mdp.num_states), [path.states[step - 1] for step in steps])
    num_walks, horizon = 20_000, 2 * path.num_steps
    for followed, exact in (
        (chosen, fidelities(mdp, policy, path, [steps])[0]),
        (~chosen, 1 - drops(mdp, policy, path, [steps])[0]),
    ):
        rng = stream(1, "walks", name)
        states = np.full(num_walks, mdp.start)
        for _ in range(horizon):
            changes = mdp.next_state[states] != states[:, None]
            drawn = np.argmax(np.where(changes, rng.random(changes.shape), -1.0), axis=1)
            states = mdp.next_state[states, np.where(followed[states], policy[states], drawn)]
        share = float(mdp.goal[states].mean())
        error = (exact * (1 - exact) / num_walks) ** 0.5
        assert share == pytest.approx(exact, abs=4 * error + 1e-9)


def test_many_explanations_at_once_are_those_one_by_one() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    path = follow(mdp, policy)
    rng = stream(3)
    many = [random_pair_steps(path.num_steps, 1 + turn % path.num_steps, rng) for turn in range(700)]
    at_once, losses = fidelities(mdp, policy, path, many), drops(mdp, policy, path, many)
    assert at_once.shape == losses.shape == (700,)
    for turn in range(0, 700, 41):
        assert fidelities(mdp, policy, path, [many[turn]])[0] == pytest.approx(at_once[turn], abs=1e-12)
        assert drops(mdp, policy, path, [many[turn]])[0] == pytest.approx(losses[turn], abs=1e-12)
    assert fidelities(mdp, policy, path, []).shape == (0,)


@pytest.mark.parametrize("chance", [0.1, 0.41, 0.9])
def test_a_step_that_changes_nothing_loses_exactly_nothing(chance: float) -> None:
    """All six actions do the same, though the mean over them differs from each by a rounding."""
    goal = np.arange(4) == 3
    outcomes = [(s, a, after, p) for s in range(3) for a in range(6) for after, p in ((0, 1 - chance), (s + 1, chance))]
    world = from_outcomes(range(4), list("uvwxyz"), outcomes, terminal=goal, goal=goal, start=0)
    path = Trajectory((0, 1, 2, 3), (0, 0, 0))
    found = drops(world, np.zeros(4, dtype=np.int32), path, [(), (1,), (2, 3), (1, 2, 3)])
    assert found.tolist() == [0.0] * 4


def test_bad_numbers_are_refused() -> None:
    mdp = tabulate(DETOUR)
    policy = plan(mdp)
    path = follow(mdp, policy)
    with pytest.raises(ValueError, match="there is no step 0"):
        fidelities(mdp, policy, path, [(1,), (0,)])
    with pytest.raises(ValueError, match=f"there is no step {path.num_steps + 1}"):
        drops(mdp, policy, path, [(path.num_steps + 1,)])
    with pytest.raises(ValueError, match="a policy must have shape"):
        fidelities(mdp, policy[1:], path, [(1,)])


def test_the_smallest_sufficient_explanation_exceeds_alpha_strictly() -> None:
    curve = [0.0, 0.5, 0.4, 0.9, 1.0]
    assert [smallest_sufficient(curve, alpha) for alpha in (0.0, 0.4, 0.5, 0.9, 0.99)] == [1, 1, 3, 4, 4]
    assert smallest_sufficient(curve[:3], 0.5) is None


@pytest.mark.parametrize("alpha", [-0.1, 1.0, 2.0, float("nan")])
def test_alpha_lies_between_0_and_1(alpha: float) -> None:
    with pytest.raises(ValueError, match="alpha must be 0 or larger and below 1"):
        smallest_sufficient([1.0], alpha)
