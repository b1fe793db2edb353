import json
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from tests.mdps import mdps, planned_path
from tests.unit.explainer.test_tie_breaking import open_floor
from tests.unit.explainer.test_variants import slippery_corridor
from tests.worlds import LAYOUTS
from webapp.explainer.mdp import DeterministicMDP, enumerate_mdp
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.stability import Count, Stability, as_json, stability
from webapp.explainer.tie_breaking import random_tie_break, shortest_path_actions
from webapp.explainer.variants import FACTORS, Factor, OtherAgent, StabilitySettings, Variant
from webapp.explainer.worlds.key_door import key_door_state, tabulate


@cache
def layout_stability(name: str) -> Stability:
    mdp = tabulate(LAYOUTS[name])
    asked = StabilitySettings(num_tie_breaks=60, random_step_counts=())
    return stability(mdp, plan(mdp), follow(mdp, plan(mdp)), asked)


def bottleneck_row(length: int = 3) -> DeterministicMDP:
    """A single row of cells: nothing is tied, and every cell must be passed."""

    def step(cell: int, action: int) -> tuple[int, bool]:
        after = max(0, cell + (1, -1)[action])
        return after, after == length

    return enumerate_mdp(0, ("east", "west"), step)


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_studys_layouts_keep_key_door_and_goal_in_nearly_every_random_tie_breaking(name: str) -> None:
    mdp = tabulate(LAYOUTS[name])
    found = layout_stability(name)
    path = follow(mdp, plan(mdp))
    states = [key_door_state(mdp, state) for state in path.states]
    after_each = states[1:]
    key = 1 + [state.has_key for state in after_each].index(True)
    passed = 1 + [(state.x, state.y) for state in states].index(LAYOUTS[name].door)
    assert found.subgoals == (key, passed, path.num_steps)
    for step in found.subgoals:
        (ties,) = [change for change in found.steps[step - 1].changes if change.factor == "ties"]
        assert ties.differing.total == 60
        assert ties.differing.count in (0, 1)


def test_what_no_choice_changes_holds() -> None:
    mdp = bottleneck_row()
    found = stability(mdp, plan(mdp), follow(mdp, plan(mdp)), StabilitySettings(num_tie_breaks=2, rules=("mean",)))
    assert found.subgoals
    assert found.flipping == ()
    for step in found.steps:
        assert step.overall.count == (len(found.variants) if step.is_subgoal else 0)
        assert all(change.differing.count == 0 and change.values == () for change in step.changes)


def differs_alone(variant: Variant, explained: Variant) -> Factor | None:
    """The only choice in which a variant departs from the explanation, if there is one."""
    policies = {"ties", "tie average", "training seed"}
    choices: dict[Factor, bool] = {
        "importance": variant.importance != explained.importance,
        "random actions": variant.random_steps != explained.random_steps,
        "threshold": variant.rule != explained.rule,
        **{factor: variant.origin == factor for factor in FACTORS if factor in policies},
    }
    others = [factor for factor, other in choices.items() if other]
    return others[0] if len(others) == 1 else None


@settings(max_examples=30)
@given(mdps(), st.sampled_from([0.0, 0.05, 0.3]))
def test_counts_and_flips_are_what_the_variants_say(mdp: DeterministicMDP, tolerance: float) -> None:
    policy, path = planned_path(mdp)
    agent = OtherAgent("twin", mdp, random_tie_break(shortest_path_actions(mdp), policy, path, 9, 9))
    asked = StabilitySettings(
        random_steps=2, random_step_counts=(1, 3), num_tie_breaks=3, importances=("ace",), tolerance=tolerance
    )
    found = stability(mdp, policy, path, asked, agents=[agent])
    explained, *others = found.variants
    assert len(found.steps) == path.num_steps
    for step in found.steps:
        member = {id(variant): step.step in variant.subgoals for variant in found.variants}
        assert step.is_subgoal == member[id(explained)]
        assert step.overall == Count(sum(member.values()), len(member))
        for level, count in zip(found.levels, step.by_level, strict=True):
            assert count == Count(sum(member[id(found.variants[row])] for row in level.variants), len(level.variants))
        flips_by: set[Factor] = set()
        for factor in FACTORS:
            alone = [each for each in others if differs_alone(each, explained) == factor]
            different = [each for each in alone if member[id(each)] != step.is_subgoal]
            (change,) = [change for change in step.changes if change.factor == factor]
            assert change.differing == Count(len(different), len(alone))
            assert set(change.values) == {each.value(factor) for each in different}
            if len(different) > tolerance * len(alone):
                flips_by.add(factor)
        different = [each for each in others if member[id(each)] != step.is_subgoal]
        assert step.changes[-1].factor is None
        assert step.changes[-1].differing == Count(len(different), len(others))
        together = {None} if len(different) > tolerance * len(others) else set()
        assert {flip.factor for flip in step.flips} == (flips_by or together)
        assert (step in found.flipping) == bool(step.flips)


def test_levels_are_the_values_of_what_varies_in_order() -> None:
    mdp = open_floor(3)
    asked = StabilitySettings(random_step_counts=(20, 3), num_tie_breaks=2)
    agents = [OtherAgent(label, mdp, plan(mdp)) for label in ("seed 1", "seed 0")]
    found = stability(mdp, plan(mdp), follow(mdp, plan(mdp)), asked, agents=agents)
    assert [(level.factor, level.name) for level in found.levels] == [
        ("random actions", "3"),
        ("random actions", "10"),
        ("random actions", "20"),
        ("threshold", "mean"),
        ("threshold", "top-k"),
        ("threshold", "largest-gap"),
        ("ties", "drawn"),
        ("tie average", "average"),
        ("training seed", "seed 1"),
        ("training seed", "seed 0"),
    ]
    for factor in ("random actions", "threshold"):
        rows = [row for level in found.levels if level.factor == factor for row in level.variants]
        assert sorted(rows) == list(range(len(found.variants)))


def test_where_nothing_varies_there_are_no_levels_and_nothing_flips() -> None:
    mdp = open_floor(3)
    asked = StabilitySettings(random_step_counts=(), rules=(), num_tie_breaks=0)
    found = stability(mdp, plan(mdp), follow(mdp, plan(mdp)), asked)
    assert (len(found.variants), found.levels, found.flipping) == (1, (), ())
    assert [change.differing for change in found.steps[0].changes] == [Count(0, 0)]


def test_an_importance_without_r_is_compared_with_any_r() -> None:
    mdp = open_floor(3)
    asked = StabilitySettings(importance="reward_importance", importances=("ace",), rules=(), num_tie_breaks=0)
    found = stability(mdp, plan(mdp), follow(mdp, plan(mdp)), asked)
    by_factor = {change.factor: change.differing.total for change in found.steps[0].changes}
    assert by_factor == {"importance": 4, None: 4}
    other_way = StabilitySettings(importance="ace", importances=("reward_importance",), rules=(), num_tie_breaks=0)
    found = stability(mdp, plan(mdp), follow(mdp, plan(mdp)), other_way)
    by_factor = {change.factor: change.differing.total for change in found.steps[0].changes}
    assert by_factor == {"importance": 1, "random actions": 3, None: 4}


def test_a_step_may_flip_only_where_several_choices_differ() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    asked = StabilitySettings(random_step_counts=(5, 20), num_tie_breaks=20)
    found = stability(mdp, plan(mdp), follow(mdp, plan(mdp)), asked)
    together = [step for step in found.flipping if step.flips[0].factor is None]
    assert together
    for step in together:
        *alone, overall = step.changes
        assert step.flips == (overall,)
        assert all(change.differing.share <= asked.tolerance < overall.differing.share for change in alone)


def test_subgoals_off_the_path_are_counted_the_most_frequent_first() -> None:
    mdp = open_floor(8)
    policy, optimal = plan(mdp), shortest_path_actions(mdp)
    free = Trajectory((mdp.start,), ())
    agents = [OtherAgent(str(number), mdp, random_tie_break(optimal, policy, free, 0, number)) for number in range(8)]
    found = stability(mdp, policy, follow(mdp, policy), StabilitySettings(num_tie_breaks=0), agents=agents)
    expected: dict[object, int] = {}
    for variant in found.variants:
        for pair in variant.elsewhere:
            expected[pair] = expected.get(pair, 0) + 1
    counts = [count.count for _, count in found.elsewhere]
    assert {pair: count.count for pair, count in found.elsewhere} == expected
    assert counts == sorted(counts, reverse=True) != list(expected.values())
    assert all(count.total == len(found.variants) for _, count in found.elsewhere)


@pytest.mark.parametrize(("count", "total"), [(0, 30), (1, 30), (59, 60), (60, 60), (7, 11)])
def test_the_interval_of_a_share_is_wilsons(count: int, total: int) -> None:
    known = binomtest(count, total).proportion_ci(0.95, method="wilson")
    assert Count(count, total).interval == pytest.approx((known.low, known.high), abs=1e-12)
    assert Count(count, total).share == count / total


def test_of_no_variants_nothing_is_known() -> None:
    assert Count(0, 0).share == 0
    assert Count(0, 0).interval == (0, 1)


def test_the_same_question_has_the_same_answer_and_another_seed_draws_otherwise() -> None:
    mdp = tabulate(LAYOUTS["experiment2-b"])
    path = follow(mdp, plan(mdp))
    asked = [StabilitySettings(seed=seed, random_step_counts=(), num_tie_breaks=20) for seed in (0, 0, 1)]
    answers = [stability(mdp, plan(mdp), path, each) for each in asked]
    assert answers[0] == answers[1]
    assert answers[0].variants != answers[2].variants


def plain(found: Stability) -> Any:  # noqa: ANN401 - JSON.
    written = as_json(found)
    return json.loads(json.dumps(written, allow_nan=False))


def test_other_programs_read_what_was_found() -> None:
    found = layout_stability("simulation")
    answer = plain(found)
    assert answer["subgoals"] == [7, 16, 20]
    assert answer["num_variants"] == len(answer["variants"]) == len(found.variants) == 3 * 62
    assert answer["settings"]["k"] == 3
    key = answer["steps"][6]
    assert (key["step"], key["action"], key["is_subgoal"]) == (7, "pickup", True)
    assert key["state"] == [int(part) for part in found.steps[6].state]  # type: ignore[attr-defined]
    assert key["count"] == sum(7 in variant["subgoals"] for variant in answer["variants"])
    assert key["share"] == key["count"] / answer["num_variants"]
    assert [level["factor"] for level in answer["levels"]] == ["threshold"] * 3 + ["ties", "tie average"]
    assert len(key["count_by_level"]) == len(answer["levels"])
    assert [change["factor"] for change in key["changes"]] == ["threshold", "ties", "tie average", "several"]
    low, high = key["changes"][1]["interval"]
    assert 0 <= low < high <= 1
    assert key["flips_by"] == [flip.factor or "several" for flip in found.steps[6].flips]


def test_labels_of_any_kind_can_be_written() -> None:
    mdp, path = slippery_corridor()
    labels = (np.int64(3), ("cell", 1.5, None), frozenset({2}), "end")
    renamed = type(mdp)(
        labels, mdp.actions, mdp.row_start, mdp.next_state, mdp.probability, mdp.terminal, mdp.goal, mdp.start
    )
    answer = plain(stability(renamed, np.zeros(4, dtype=np.int32), path, StabilitySettings()))
    assert [step["state"] for step in answer["steps"]] == [3, ["cell", 1.5, None], "frozenset({2})"]
