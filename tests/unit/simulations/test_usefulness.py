"""Which groups the usefulness experiment compares, and what is claimed of them."""

from collections import Counter
from dataclasses import replace

import pytest

from webapp.explainer.solvers import distances_to_goal
from webapp.simulations.conditions import planned_runs, units
from webapp.simulations.tasks import Task, read_task
from webapp.simulations.usefulness import (
    SETTINGS,
    UsefulnessSettings,
    claims,
    conditions,
    pairs_behind_the_start,
    random_steps_sharing,
    rival_steps,
)

PAPER = SETTINGS["paper"]


@pytest.fixture(scope="module")
def task() -> Task:
    return read_task(PAPER.layout, PAPER.layout_name)


def test_every_group_is_told_as_many_pairs_as_there_are_derived_subgoals() -> None:
    groups = conditions(PAPER)
    assert groups[0].pairs == ()
    assert {len(group.pairs) for group in groups[1:]} == {2}


def test_the_groups_are_the_paper_s_and_ours_in_both_variants() -> None:
    kinds = Counter((group.variant, group.kind) for group in conditions(PAPER))
    for variant in ("repeatable", "once"):
        assert kinds[variant, "derived"] == kinds[variant, "derived again"] == kinds[variant, "useless"] == 1
        assert kinds[variant, "random, some shared"] == kinds[variant, "random, none shared"] == 4
        assert kinds[variant, "rival"] == 5
    assert kinds["none", "none"] == 1
    assert conditions(PAPER)[1].steps == (7, 16)


def test_random_steps_share_as_many_with_the_derived_ones_as_they_say(task: Task) -> None:
    for num_shared in (0, 1):
        drawn = random_steps_sharing(task, num_shared, PAPER)
        assert len(set(drawn)) == PAPER.num_draws
        for steps in drawn:
            assert len(set(steps) & {7, 16}) == num_shared
            assert steps == tuple(sorted(set(steps)))
            assert set(steps) <= set(task.inner_steps)
    with_7 = sum(7 in steps for steps in random_steps_sharing(task, 1, PAPER))
    assert with_7 == PAPER.num_draws / 2


def test_another_seed_draws_other_steps_and_the_same_seed_the_same(task: Task) -> None:
    other = replace(PAPER, seed=PAPER.seed + 1)
    assert random_steps_sharing(task, 0, PAPER) == random_steps_sharing(task, 0, PAPER)
    assert random_steps_sharing(task, 0, PAPER) != random_steps_sharing(task, 0, other)


def test_a_path_that_is_too_short_for_all_draws_yields_those_there_are() -> None:
    corridor = read_task("########\n#K<..DG#\n########\n", "corridor")
    settings = replace(PAPER, num_draws=1000)
    drawn = random_steps_sharing(corridor, 0, settings)
    others = [step for step in corridor.inner_steps if step not in corridor.subgoals]
    assert len(drawn) <= len(others) ** len(corridor.subgoals)
    assert len(set(drawn)) == len(drawn)


def test_rivals_never_name_the_step_that_reaches_the_goal(task: Task) -> None:
    found = dict(rival_steps(task, PAPER))
    assert set(found) == {"highlights", "landmarks", "landmark facts", "bottlenecks", "evenly spaced"}
    for steps in found.values():
        assert len(steps) == 2
        assert task.path.num_steps not in steps


def test_pairs_behind_the_start_lead_away_from_the_goal(task: Task) -> None:
    distances = distances_to_goal(task.mdp)
    for state, action in pairs_behind_the_start(task, 2):
        after = task.mdp.next_state[state, action]
        assert distances[after] > distances[state]
        assert distances[after] > distances[task.mdp.start]
        assert (state, action) not in task.path.pairs


def test_a_map_with_nothing_behind_the_start_is_refused() -> None:
    corridor = read_task("########\n#>K..DG#\n########\n", "corridor")
    with pytest.raises(ValueError, match="pairs that lead away from the goal are needed, and the map has"):
        pairs_behind_the_start(corridor, 10_000)


def test_a_map_without_a_subgoal_beside_the_goal_is_refused_by_name() -> None:
    settings = replace(PAPER, layout="######\n#>KDG#\n######\n", layout_name="corridor")
    with pytest.raises(ValueError, match="corridor has no subgoal beside the goal"):
        conditions(settings)


def test_what_the_paper_claims_is_claimed_of_every_random_choice() -> None:
    groups = conditions(PAPER)
    made = list(claims(groups))
    for variant in ("repeatable", "once"):
        own = [claim for claim in made if claim.variant == variant]
        paper = Counter(claim.expects for claim in own if claim.source == "5.2")
        assert paper == {"no difference": 4, "fewer": 4}
        assert all(claim.first.kind == "derived" for claim in own if claim.source == "5.2")
        assert Counter(claim.expects for claim in own if claim.source == "ours") == {
            "no difference": 1,
            "not more": 5,
            "not fewer": 1,
            "fewer": 1,
        }


def test_every_run_has_an_id_of_its_own_that_no_other_setting_changes() -> None:
    few = [run.run_id for run in planned_runs(conditions(PAPER), PAPER.num_runs)]
    many = {run.run_id for run in planned_runs(conditions(SETTINGS["ours"]), SETTINGS["ours"].num_runs)}
    assert len(set(few)) == len(few) == 33 * 10
    assert set(few) <= many  # The first ten of thirty runs are the ten runs.


def test_units_hold_every_run_once_and_in_order() -> None:
    runs = planned_runs(conditions(PAPER), PAPER.num_runs)
    stacks = list(units(runs, 32))
    assert [run for stack in stacks for run in stack] == list(runs)
    assert {len(stack) for stack in stacks[:-1]} == {32}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": -1}, "seed must be 0 or larger, not -1"),
        ({"num_runs": 1}, "num_runs must be 2 or larger, not 1"),
        ({"runs_per_stack": 0}, "runs_per_stack must be 1 or larger, not 0"),
        ({"num_resamples": 99}, "num_resamples must be 100 or larger, not 99"),
        ({"margin": 0.0}, r"margin must lie between 0 and 1, not 0\.0"),
        ({"variants": ()}, "variants must be some of repeatable, once, not none"),
        ({"variants": ("twice",)}, "variants must be some of repeatable, once, not twice"),
        ({"num_draws": 0}, "num_draws must be 1 or larger, not 0"),
    ],
)
def test_settings_that_make_no_sense_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        UsefulnessSettings(**change)  # type: ignore[arg-type]
