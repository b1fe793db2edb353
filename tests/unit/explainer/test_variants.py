from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.mdps import mdps, planned_path
from tests.unit.explainer.test_tie_breaking import open_floor
from tests.worlds import LAYOUTS
from webapp.explainer.importance import exact_importance
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan
from webapp.explainer.stochastic import StochasticMDP, from_deterministic, from_outcomes
from webapp.explainer.subgoals import possible_counts, subgoal_steps
from webapp.explainer.tie_breaking import random_tie_break, shortest_path_actions
from webapp.explainer.variants import OtherAgent, StabilitySettings, Variant, explain_variants
from webapp.explainer.worlds.key_door import tabulate

FEW = StabilitySettings(random_steps=2, random_step_counts=(1,), num_tie_breaks=2)


def slippery_corridor() -> tuple[StochasticMDP, Trajectory]:
    """Four cells in a row; a step fails half of the time, and two actions do the same."""
    outcomes = [
        (cell, action, after, 0.5) for cell in range(3) for action in range(2) for after in (cell, cell + 1)
    ] + [(cell, 2, max(0, cell - 1), 1.0) for cell in range(3)]
    ends = np.arange(4) == 3
    mdp = from_outcomes(range(4), ("walk", "stride", "back"), outcomes, terminal=ends, goal=ends, start=0)
    return mdp, Trajectory((0, 1, 2, 3), (0, 0, 0))


def reordered(mdp: DeterministicMDP, order: list[int]) -> DeterministicMDP:
    """The same world with its states numbered otherwise."""
    place = np.argsort(order)
    return DeterministicMDP(
        tuple(mdp.states[state] for state in order),
        mdp.actions,
        place[mdp.next_state[order]].astype(np.int32),
        mdp.terminal[order],
        mdp.goal[order],
        int(place[mdp.start]),
    )


def by_policy(variants: tuple[Variant, ...], origin: str, policy: str) -> list[Variant]:
    return [variant for variant in variants if (variant.origin, variant.policy) == (origin, policy)]


@settings(max_examples=30)
@given(mdps(), st.integers(0, 3))
def test_a_variant_holds_the_subgoals_that_its_own_choices_give(mdp: DeterministicMDP, seed: int) -> None:
    policy, path = planned_path(mdp)
    asked = StabilitySettings(
        random_steps=2, random_step_counts=(1,), num_tie_breaks=2, importances=("ace",), seed=seed
    )
    variants, k = explain_variants(mdp, policy, path, asked)
    assert len(variants) == 2 * 2 * 3 * (1 + 2 + 1)
    assert len({(v.importance, v.random_steps, v.rule, v.origin, v.policy) for v in variants}) == len(variants)
    optimal = shortest_path_actions(mdp)
    for variant in variants:
        if variant.rule == "top-k" or variant.origin == "tie average":
            continue
        taken = policy if variant.origin == "explained" else None
        if taken is None:
            taken = random_tie_break(optimal, policy, path, seed, int(variant.policy))
        values = exact_importance(variant.importance, mdp, taken, path, variant.random_steps or 0).values
        assert variant.subgoals == subgoal_steps(values, variant.rule)
    assert k == max(1, len(variants[0].subgoals))


def test_the_first_variant_is_the_explanation() -> None:
    mdp = open_floor()
    path = follow(mdp, plan(mdp))
    asked = StabilitySettings(importance="ace", random_steps=4, rule="top-k", k=2, num_tie_breaks=1)
    variants, k = explain_variants(mdp, plan(mdp), path, asked)
    first = variants[0]
    assert (first.importance, first.random_steps, first.rule, first.origin) == ("ace", 4, "top-k", "explained")
    assert k == 2
    assert {variant.random_steps for variant in variants} == {4, 5, 10, 20, 40}


def test_top_k_takes_the_next_smaller_number_where_k_cannot_be_met() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    path = follow(mdp, plan(mdp))
    most = max(possible_counts(exact_importance("return_probability", mdp, plan(mdp), path, 10).values))
    assert most > 1
    asked = StabilitySettings(k=most + 5, rules=("top-k",), random_step_counts=(), num_tie_breaks=0)
    variants, _ = explain_variants(mdp, plan(mdp), path, asked)
    (top,) = [variant for variant in variants if variant.rule == "top-k"]
    assert len(top.subgoals) == most


def test_an_importance_without_random_actions_is_computed_once() -> None:
    mdp = open_floor(3)
    asked = StabilitySettings(importances=("reward_importance",), rules=(), num_tie_breaks=0)
    variants, _ = explain_variants(mdp, plan(mdp), follow(mdp, plan(mdp)), asked)
    assert [v.random_steps for v in variants if v.importance == "reward_importance"] == [None]
    assert len(variants) == 5
    only = StabilitySettings(importance="reward_importance", num_tie_breaks=0)
    variants, _ = explain_variants(mdp, plan(mdp), follow(mdp, plan(mdp)), only)
    assert (variants[0].importance, variants[0].rule, len(variants)) == ("reward_importance", "mean", 3)


def test_an_agent_that_numbers_the_same_states_otherwise_has_the_same_subgoals() -> None:
    mdp = open_floor()
    path = follow(mdp, plan(mdp))
    twin = reordered(mdp, list(reversed(range(mdp.num_states))))
    agent = OtherAgent("twin", twin, plan(mdp)[::-1].astype(np.int32))
    variants, _ = explain_variants(mdp, plan(mdp), path, FEW, agents=[agent])
    mine = {(each.random_steps, each.rule): each.subgoals for each in by_policy(variants, "explained", "")}
    theirs = {(each.random_steps, each.rule): each for each in by_policy(variants, "training seed", "twin")}
    assert {choice: each.subgoals for choice, each in theirs.items()} == mine
    assert not any(each.elsewhere for each in theirs.values())
    assert all(mine.values())


def test_what_an_agent_finds_off_the_path_is_kept_apart_by_name() -> None:
    mdp = open_floor()
    path = follow(mdp, plan(mdp))
    last_first: Policy = np.where(
        shortest_path_actions(mdp).any(axis=1), 3 - shortest_path_actions(mdp)[:, ::-1].argmax(axis=1), 0
    ).astype(np.int32)
    theirs = follow(mdp, last_first)
    assert set(theirs.states) & set(path.states) == {path.states[0], path.states[-1]}
    variants, _ = explain_variants(mdp, plan(mdp), path, FEW, agents=[OtherAgent("other", mdp, last_first)])
    for variant in by_policy(variants, "training seed", "other"):
        if variant.rule == "top-k":
            continue
        values = exact_importance(variant.importance, mdp, last_first, theirs, variant.random_steps or 0).values
        pairs = [theirs.pairs[step - 1] for step in subgoal_steps(values, variant.rule)]
        assert pairs
        assert variant.subgoals == ()
        assert list(variant.elsewhere) == [(mdp.states[state], mdp.actions[action]) for state, action in pairs]


def test_an_agent_that_never_arrives_is_named() -> None:
    mdp = open_floor()
    lost = np.full(mdp.num_states, 3, dtype=np.int32)
    with pytest.raises(NeverArrives, match=r"agent 'seed 4': the policy never reaches the goal"):
        explain_variants(mdp, plan(mdp), follow(mdp, plan(mdp)), FEW, agents=[OtherAgent("seed 4", mdp, lost)])


@pytest.mark.parametrize("labels", [["", "b"], ["a", "a"]])
def test_agents_need_labels_of_their_own(labels: list[str]) -> None:
    mdp = open_floor()
    agents = [OtherAgent(label, mdp, plan(mdp)) for label in labels]
    with pytest.raises(ValueError, match="each agent needs a label of its own"):
        explain_variants(mdp, plan(mdp), follow(mdp, plan(mdp)), FEW, agents=agents)


def test_an_agent_whose_path_is_left_to_chance_must_name_it() -> None:
    mdp, path = slippery_corridor()
    policy = np.zeros(4, dtype=np.int32)
    with pytest.raises(ValueError, match=r"agent 'x' leaves its path to chance, so name the path"):
        explain_variants(mdp, policy, path, FEW, agents=[OtherAgent("x", mdp, policy)])
    variants, _ = explain_variants(mdp, policy, path, FEW, agents=[OtherAgent("x", mdp, policy, path)])
    assert len(by_policy(variants, "training seed", "x")) == 6


def test_in_a_stochastic_world_ties_are_broken_between_the_actions_that_are_named() -> None:
    mdp, path = slippery_corridor()
    policy = np.zeros(4, dtype=np.int32)
    without, _ = explain_variants(mdp, policy, path, FEW)
    assert {variant.origin for variant in without} == {"explained"}
    optimal = np.array([[True, True, False]] * 3 + [[False] * 3])
    variants, _ = explain_variants(mdp, policy, path, FEW, optimal)
    assert {variant.origin for variant in variants} == {"explained", "ties", "tie average"}


def test_certain_chances_give_what_a_deterministic_world_gives() -> None:
    mdp = open_floor()
    path = follow(mdp, plan(mdp))
    expected, _ = explain_variants(mdp, plan(mdp), path, FEW)
    found, _ = explain_variants(from_deterministic(mdp), plan(mdp), path, FEW, shortest_path_actions(mdp))
    assert found == expected


def test_a_step_on_a_state_that_the_path_visits_twice_is_not_taken_for_the_other() -> None:
    mdp, _ = slippery_corridor()
    policy = np.zeros(4, dtype=np.int32)
    path = Trajectory((0, 1, 2, 2, 3), (0, 0, 0, 0))
    variants, _ = explain_variants(mdp, policy, path, StabilitySettings(random_steps=1, random_step_counts=()))
    values = exact_importance("return_probability", mdp, policy, path, 1).values
    assert variants[0].subgoals == subgoal_steps(values) == (4,)


def test_a_path_that_is_not_the_shortest_asks_for_its_optimal_actions() -> None:
    mdp = open_floor()
    policy = plan(mdp).copy()
    policy[mdp.index[1, 0]] = mdp.actions.index("south")
    policy[mdp.index[1, 1]] = mdp.actions.index("west")
    policy[mdp.index[0, 1]] = mdp.actions.index("south")
    path = follow(mdp, policy)
    with pytest.raises(ValueError, match=r"'west', which the path takes in \(1, 1\), is none"):
        explain_variants(mdp, policy, path, FEW)
    variants, _ = explain_variants(mdp, policy, path, StabilitySettings(num_tie_breaks=0))
    assert {variant.origin for variant in variants} == {"explained"}


def test_a_path_without_steps_is_refused() -> None:
    mdp = open_floor()
    with pytest.raises(ValueError, match="the path has no steps that could be subgoals"):
        explain_variants(mdp, plan(mdp), Trajectory((mdp.index[3, 3],), ()), FEW)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"random_steps": -1}, "number of random actions must be 0 or larger, not -1"),
        ({"random_step_counts": (5, -2)}, "number of random actions must be 0 or larger, not -2"),
        ({"num_tie_breaks": -1}, "num_tie_breaks must be 0 or larger, not -1"),
        ({"seed": -3}, "seed must be 0 or larger, not -3"),
        ({"importance": "regret"}, "'regret' is not an importance; use return_probability, ace, reward_importance"),
        ({"importances": ("regret",)}, "'regret' is not an importance"),
        ({"rule": "median"}, "'median' is not a threshold; use mean, top-k, largest-gap"),
        ({"rules": ("median",)}, "'median' is not a threshold"),
        ({"rule": "top-k"}, "the threshold top-k needs k"),
        ({"k": 0}, "k must be 1 or larger, not 0"),
        ({"tolerance": 1.0}, "the tolerance must lie from 0 up to, not including, 1, not 1.0"),
        ({"tolerance": float("nan")}, "the tolerance must lie from 0"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        StabilitySettings(**cast("Any", wrong))


def test_settings_say_what_is_explained() -> None:
    assert str(StabilitySettings()) == "return probability after 10 random actions, threshold mean"
    assert str(StabilitySettings(importance="ace", random_steps=3, rule="top-k", k=2)) == (
        "average causal effect after 3 random actions, threshold top-2"
    )
    assert str(StabilitySettings(importance="reward_importance")) == "reward importance, threshold mean"
