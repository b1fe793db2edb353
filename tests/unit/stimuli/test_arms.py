"""The comparison arms: as many pictures as the subgoals, wherever the explanation begins."""

from collections.abc import Sequence
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.explanation import kind_strips
from webapp.explainer.importance import exact_importance
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.selectors import landmark_states, q_gaps
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.subgoals import subgoal_steps
from webapp.explainer.worlds.key_door import tabulate
from webapp.stimuli.agents import BuildError
from webapp.stimuli.arms import ArmKind, arm_steps

KINDS: list[ArmKind] = ["highlights", "landmarks", "evenly_spaced"]


@cache
def world_of(name: str) -> tuple[DeterministicMDP, Policy, Trajectory, tuple[int, ...]]:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    path = follow(mdp, policy)
    return mdp, policy, path, subgoal_steps(exact_importance("return_probability", mdp, policy, path, 10).values)


def num_pictures(path: Trajectory, steps: Sequence[int]) -> int:
    return sum(len(strip.states) for strip in kind_strips("subgoals", path, steps))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_an_arm_shows_as_many_pictures_as_the_subgoals_from_any_step(name: str, kind: ArmKind) -> None:
    mdp, policy, path, subgoals = world_of(name)
    for from_step in range(1, path.num_steps + 1):
        left = path.from_step(from_step)
        ahead = tuple(step - from_step + 1 for step in subgoals if step >= from_step)
        steps = arm_steps(kind, name, mdp, policy, left, ahead)
        assert list(steps) == sorted(set(steps))
        assert num_pictures(left, steps) == num_pictures(left, ahead)


@st.composite
def budgets(draw: st.DrawFn) -> tuple[str, int, tuple[int, ...]]:
    """Draw a layout, a step of its path and subgoals from there on, no two of them neighbours."""
    name = draw(st.sampled_from(sorted(LAYOUTS)))
    num_steps = world_of(name)[2].num_steps
    from_step = draw(st.integers(1, num_steps))
    candidates = draw(st.sets(st.integers(1, num_steps - from_step + 1)))
    subgoals: list[int] = []
    for step in sorted(candidates):
        if not subgoals or step > subgoals[-1] + 1:
            subgoals.append(step)
    return name, from_step, tuple(subgoals)


@given(budgets(), st.sampled_from(KINDS))
def test_whatever_the_subgoals_an_arm_shows_as_many_pictures_or_says_that_it_cannot(
    budget: tuple[str, int, tuple[int, ...]], kind: ArmKind
) -> None:
    name, from_step, subgoals = budget
    mdp, policy, path, _ = world_of(name)
    left = path.from_step(from_step)
    own = set(landmark_states(mdp, left)[1:]) - {left.num_steps}
    wanted = set(subgoals) - {left.num_steps}
    if kind == "landmarks" and len(own) < len(wanted):
        with pytest.raises(BuildError, match=f"layout '{name}': the kind 'landmarks' has {len(own)} steps"):
            arm_steps(kind, name, mdp, policy, left, subgoals)
        return
    steps = arm_steps(kind, name, mdp, policy, left, subgoals)
    assert list(steps) == sorted(set(steps))
    assert num_pictures(left, steps) == num_pictures(left, subgoals)
    assert (left.num_steps in steps) == (left.num_steps in subgoals)
    if kind == "landmarks":
        assert set(steps) <= own | {left.num_steps}


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_highlights_takes_the_largest_gap_that_is_no_neighbour_of_the_goals_step(name: str) -> None:
    mdp, policy, path, _ = world_of(name)
    gaps = q_gaps(mdp, policy)
    for from_step in range(1, path.num_steps - 1):
        left = path.from_step(from_step)
        step, last = arm_steps("highlights", name, mdp, policy, left, (1, left.num_steps))
        assert last == left.num_steps
        assert step < last - 1
        candidates = gaps[list(left.states[: last - 2])]
        assert gaps[left.states[step - 1]] == candidates.max()


def test_evenly_spaced_steps_keep_their_distance() -> None:
    mdp, policy, path, _ = world_of("simulation")
    assert arm_steps("evenly_spaced", "simulation", mdp, policy, path, (2, 5, 9)) == (4, 10, 16)


def test_a_world_with_too_few_landmarks_is_refused_by_name() -> None:
    """Between the key and the wall column there is room for many ways, so hardly a state lies on all of them."""
    layout = lay_out("#########", "#>......#", "#...K...#", "#.......#", "####D####", "#...G...#", "#########")
    mdp = tabulate(layout)
    policy = plan(mdp)
    path = follow(mdp, policy)
    own = [step for step in landmark_states(mdp, path)[1:] if step < path.num_steps]
    subgoals = tuple(range(1, path.num_steps, 2))
    assert len(own) < len(subgoals)
    wish = (
        rf"layout 'wide': the kind 'landmarks' has {len(own)} steps to show before the last, and needs {len(subgoals)}"
    )
    with pytest.raises(BuildError, match=wish):
        arm_steps("landmarks", "wide", mdp, policy, path, subgoals)
