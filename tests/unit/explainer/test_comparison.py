import json
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.mdps import mdps, planned_path
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds, policy_of, some_path
from tests.worlds import LAYOUTS, layouts
from webapp.explainer.comparison import SELECTORS, SOURCES, Comparison, ComparisonSettings, as_json, compare
from webapp.explainer.fidelity import drops, fidelities, policy_fidelity
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan, tie_averaged_policy
from webapp.explainer.stochastic import AnyPolicy, World, from_outcomes
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import Layout, LayoutError


def without_times(comparison: Comparison) -> Any:  # noqa: ANN401 - JSON.
    answer = json.loads(json.dumps(as_json(comparison)))
    for each in answer["selectors"]:
        assert each.pop("seconds") >= 0
    return answer


def compared(mdp: DeterministicMDP, settings: ComparisonSettings) -> Comparison:
    """Compare on the planner's path."""
    policy = plan(mdp)
    return compare(mdp, policy, follow(mdp, policy), settings)


def check(world: World, policy: AnyPolicy, comparison: Comparison) -> None:
    """Hold a comparison against what its steps say."""
    path, budget = comparison.path, comparison.budget
    assert tuple(rating.selector for rating in comparison.ratings) == SELECTORS
    assert comparison.policy_fidelity == pytest.approx(policy_fidelity(world, policy, path))
    everything = fidelities(world, policy, path, [range(1, path.num_steps + 1)])[0]
    for rating in comparison.ratings:
        assert len(rating.curve) == path.num_steps + 1
        assert rating.curve[-1].value == pytest.approx(everything)
        assert rating.fidelity == rating.curve[budget]
        exceeding = [k for k, measure in enumerate(rating.curve) if measure.value > comparison.alpha]
        assert rating.smallest == (exceeding[0] if exceeding else None)
        if rating.steps is None:
            assert rating.selector == "random"
            assert rating.fidelity.standard_error is not None
            continue
        assert len(set(rating.steps)) == budget
        assert rating.fidelity.standard_error is None
        assert rating.fidelity.value == pytest.approx(fidelities(world, policy, path, [rating.steps])[0])
        assert rating.drop.value == pytest.approx(drops(world, policy, path, [rating.steps])[0])
        assert rating.overlap.value == len(set(rating.steps) & set(comparison.subgoals))
        assert len(rating.reasons) == (0 if rating.selector == "evenly spaced" else budget)
        if rating.selector in {"highlights", "evenly spaced"}:
            assert (dict(rating.own), rating.fillers) == ({}, ())
            continue
        assert len(set(rating.own) & set(rating.steps)) == min(budget, len(rating.own))
        assert set(rating.fillers) == set(rating.steps) - set(rating.own)


@settings(max_examples=30)
@given(mdps(), st.data())
def test_every_selector_meets_the_budget_in_any_world(mdp: DeterministicMDP, data: st.DataObject) -> None:
    policy, path = planned_path(mdp)
    budget = data.draw(st.integers(1, path.num_steps))
    found = compare(mdp, policy, path, ComparisonSettings(random_steps=3, budget=budget, num_draws=3))
    assert found.ratings[0].curve[-1].value == found.policy_fidelity == 1
    check(mdp, policy, found)


@settings(max_examples=30)
@given(mdps(), st.sampled_from(["return_probability", "ace", "reward_importance"]))
def test_a_tie_averaged_policy_can_be_compared(mdp: DeterministicMDP, importance: Any) -> None:  # noqa: ANN401
    _, path = planned_path(mdp)
    policy = tie_averaged_policy(mdp)
    check(mdp, policy, compare(mdp, policy, path, ComparisonSettings(importance, random_steps=2, num_draws=2)))


@settings(max_examples=30)
@given(fraction_worlds(), st.data())
def test_every_selector_meets_the_budget_in_any_stochastic_world(world: FractionWorld, data: st.DataObject) -> None:
    path = some_path(world)
    assume(path is not None)
    assert path is not None
    mdp, policy = as_mdp(world), policy_of(world)
    budget = data.draw(st.integers(1, path.num_steps))
    alpha = data.draw(st.sampled_from([0.0, 0.5, 0.9]))
    settings = ComparisonSettings(random_steps=2, budget=budget, num_draws=2, alpha=alpha)
    check(mdp, policy, compare(mdp, policy, path, settings))


@settings(max_examples=15)
@given(layouts(6), st.sampled_from([0.0, 0.3, 0.99]))
def test_every_selector_meets_the_budget_on_maps_that_nobody_chose(layout: Layout, alpha: float) -> None:
    try:
        mdp = tabulate(layout)
    except LayoutError:
        assume(condition=False)
        raise
    found = compared(mdp, ComparisonSettings(alpha=alpha, num_draws=2))
    assert found.budget == max(1, len(found.subgoals))
    check(mdp, plan(mdp), found)


def test_at_their_own_number_the_papers_subgoals_are_chosen_as_they_are() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    found = compared(mdp, ComparisonSettings(num_draws=2))
    assert found.ratings[0].steps == found.subgoals == (7, 16, 20)
    assert found.ratings[0].overlap.value == 3


def test_a_random_choice_of_everything_is_certain_and_of_some_is_a_mean() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    rating = compared(mdp, ComparisonSettings(budget=5, num_draws=100)).ratings[-1]
    assert rating.overlap.value == pytest.approx(5 * 3 / 20, abs=4 * (rating.overlap.standard_error or 0))
    assert (rating.curve[-1].value, rating.curve[-1].standard_error) == (1, 0)


def test_the_seed_decides_the_draws_and_nothing_else() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    first, again, other = (
        without_times(compared(mdp, ComparisonSettings(seed=seed, num_draws=5))) for seed in (0, 0, 1)
    )
    assert first == again
    assert first["settings"] == {**other["settings"], "seed": 0}
    assert first["selectors"][:-1] == other["selectors"][:-1]
    assert first["selectors"][-1] != other["selectors"][-1]


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"budget": 0}, "k must be 1 or larger, not 0"),
        ({"alpha": 1.0}, "alpha must be 0 or larger and below 1, not 1.0"),
        ({"alpha": float("nan")}, "alpha must be 0 or larger and below 1, not nan"),
        ({"seed": -1}, "seed must be 0 or larger, not -1"),
        ({"random_steps": -1}, "random_steps must be 0 or larger, not -1"),
        ({"num_draws": 1}, "num_draws must be 2 or larger, not 1"),
        ({"min_gap": 0}, "min_gap must be 1 or larger, not 0"),
        ({"context": -1}, "context must be 0 or larger, not -1"),
        ({"discount": 0.0}, "the discount must lie above 0 and be at most 1, not 0.0"),
        ({"discount": float("nan")}, "the discount must lie above 0 and be at most 1, not nan"),
        ({"importance": "luck"}, "importance must be one of return_probability, ace, reward_importance, not 'luck'"),
    ],
)
def test_bad_settings_are_refused(choices: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ComparisonSettings(**choices)


def test_a_budget_beyond_the_path_is_refused() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    with pytest.raises(ValueError, match="k must be at most 20, the number of the path's steps, not 21"):
        compared(mdp, ComparisonSettings(budget=21))


def test_a_start_in_the_goal_leaves_nothing_to_choose() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    there = DeterministicMDP(
        mdp.states, mdp.actions, mdp.next_state, mdp.terminal, mdp.goal, start=int(mdp.goal.argmax())
    )
    with pytest.raises(ValueError, match="the path has no steps to choose from: the start is the goal"):
        compared(there, ComparisonSettings())


def test_every_selector_names_its_source_and_says_why() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    found = compared(mdp, ComparisonSettings(budget=4, num_draws=2))
    answer = without_times(found)
    by_name = {each["selector"]: each for each in answer["selectors"]}
    assert all(each["source"] == SOURCES[name] for name, each in by_name.items())
    facts = {each["reason"]: each["step"] for each in by_name["landmark facts"]["own"]}
    path = found.path
    assert mdp.actions[path.actions[facts["has_key = 1"] - 1]] == "pickup"
    assert mdp.actions[path.actions[facts["door_open = 1"] - 1]] == "toggle"
    assert {"has_key = 1", "door_open = 1"} <= set(by_name["landmark facts"]["reasons"])
    assert by_name["subgoals"]["reasons"][0].startswith("importance 0.")
    steps, frames = by_name["highlights"]["steps"], by_name["highlights"]["frames"]
    assert frames == [[max(1, step - 1), min(21, step + 1)] for step in steps]
    assert (answer["horizon"], answer["policy_fidelity"]) == (40, 1.0)


def test_the_interval_and_the_context_of_highlights_are_settings() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    found = compared(mdp, ComparisonSettings(budget=3, num_draws=2, min_gap=6, context=2)).ratings[1]
    assert found.steps is not None
    assert min(later - step for step, later in pairwise(found.steps)) >= 6
    assert found.frames == tuple((max(1, step - 2), min(21, step + 2)) for step in found.steps)


def test_an_interval_at_which_the_budget_does_not_fit_is_told_with_the_one_in_use() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    asked = without_times(compared(mdp, ComparisonSettings(budget=3, num_draws=2, min_gap=30)))
    found = asked["selectors"][1]
    assert asked["settings"]["min_gap"] == 30 > found["min_gap"] == 8
    assert min(later - step for step, later in pairwise(found["steps"])) >= 8
    assert found["note"] == "3 steps, the most important first, do not fit 30 apart; they are kept 8 apart"
    kept = without_times(compared(mdp, ComparisonSettings(budget=3, num_draws=2, min_gap=6)))["selectors"]
    assert (kept[1]["min_gap"], kept[1]["note"]) == (6, "")
    assert all(each["min_gap"] is None for each in kept if each["selector"] != "highlights")


def test_without_any_subgoal_what_is_shown_is_a_filler() -> None:
    """With no random action before it every state on the path is as good as its neighbours."""
    mdp = tabulate(LAYOUTS["simulation"])
    found = without_times(compared(mdp, ComparisonSettings(random_steps=0, num_draws=2)))
    assert found["subgoals"] == found["selectors"][0]["own"] == []
    assert found["selectors"][0]["steps"] == found["selectors"][0]["fillers"] == [1]


@pytest.mark.parametrize(("chance", "num_draws"), [(0.7, 3), (0.7, 7), (0.19, 10), (0.1, 30)])
def test_equal_numbers_have_themselves_as_their_mean_and_no_error(chance: float, num_draws: int) -> None:
    """One action leaves nothing to the draws, though so many times 1 - (1 - p)**2 adds up to a little more or less."""
    goal = np.array([False, True])
    outcomes = [(0, 0, 1, chance), (0, 0, 0, 1 - chance)]
    world = from_outcomes("ab", ["go"], outcomes, terminal=goal, goal=goal, start=0)
    settings = ComparisonSettings(budget=1, num_draws=num_draws)
    found = compare(world, np.zeros(2, dtype=np.int32), Trajectory((0, 1), (0,)), settings)
    random = found.ratings[-1]
    assert {measure.value for measure in random.curve} == {random.fidelity.value} == {found.policy_fidelity}
    assert random.fidelity.standard_error == random.drop.standard_error == 0


def test_a_discount_for_the_values_changes_what_highlights_says() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    reasons = [
        compared(mdp, ComparisonSettings(num_draws=2, discount=discount)).ratings[1].reasons for discount in (0.5, 0.99)
    ]
    assert reasons[0] != reasons[1]


def corridor() -> tuple[DeterministicMDP, Policy, Trajectory]:
    """Three states in a row, and a second action that stays."""
    goal = np.array([False, False, True])
    mdp = DeterministicMDP(
        ("a", "b", "c"), ("go", "stay"), np.array([[1, 0], [2, 1], [2, 2]], dtype=np.int32), goal, goal, 0
    )
    policy = plan(mdp)
    return mdp, policy, follow(mdp, policy)


@pytest.mark.parametrize(
    ("states", "actions", "message"),
    [
        ((0, 0, 1, 2), (1, 0, 0), "the path leaves the policy in 'a'"),
        ((0, 2), (0,), "the path leaves the world in 'a': its action cannot lead there"),
        ((0, 1), (0,), "the path must end in a goal, not in 'b'"),
        ((0, 1, 2), (0, 7), "the path leaves the policy in 'b'"),
        ((0, 1, 3), (0, 0), "a path must hold state indices from 0 to 2, not 3"),
        ((2,), (), "the path has no steps to choose from: the start is the goal"),
    ],
)
def test_a_path_that_is_not_the_policys_way_to_a_goal_is_refused(
    states: tuple[int, ...], actions: tuple[int, ...], message: str
) -> None:
    mdp, policy, _ = corridor()
    with pytest.raises(ValueError, match=message):
        compare(mdp, policy, Trajectory(states, actions), ComparisonSettings())


def test_a_policy_that_does_not_fit_the_world_is_refused() -> None:
    mdp, policy, path = corridor()
    with pytest.raises(ValueError, match="a policy must have shape"):
        compare(mdp, policy[1:], path, ComparisonSettings())
    with pytest.raises(ValueError, match="a probability must be a number from 0 to 1, not nan"):
        compare(mdp, np.full((3, 2), np.nan), path, ComparisonSettings())


def test_a_goal_out_of_reach_has_no_path_to_compare_on() -> None:
    goal = np.array([False, True])
    mdp = DeterministicMDP(("a", "b"), ("stay",), np.array([[0], [1]], dtype=np.int32), goal, goal, 0)
    with pytest.raises(NeverArrives, match="the policy never reaches the goal: it loops through 'a'"):
        compared(mdp, ComparisonSettings())


@pytest.mark.parametrize("importance", ["return_probability", "ace", "reward_importance"])
def test_the_settings_say_in_one_line_what_is_compared(importance: Any) -> None:  # noqa: ANN401
    line = str(ComparisonSettings(importance, discount=0.9, min_gap=3))
    assert "highlights: discount 0.9, 3 apart; random: mean of 30 draws, seed 0" in line
    assert ("random actions" in line) == (importance != "reward_importance")
    assert ("after 1 random action;" in str(ComparisonSettings(importance, 1))) == (importance != "reward_importance")
