"""The world as the web worker knows it, against the explainer's own functions on the same worlds."""

import dataclasses
import json
from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.worlds import LAYOUTS
from webapp.explainer.importance import exact_importance
from webapp.explainer.key_points import key_point_steps, roll_out
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import Trajectory, distances_to_goal, follow, plan
from webapp.explainer.subgoals import subgoal_steps
from webapp.explainer.worlds.key_door import tabulate
from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.world_table import WorldTable

ROUTES = st.lists(st.sampled_from(range(5)), max_size=60)


@dataclasses.dataclass(frozen=True)
class Both:
    """A layout's world, once with NumPy and once without."""

    mdp: DeterministicMDP
    path: Trajectory
    subgoals: tuple[int, ...]
    table: WorldTable


@cache
def both(name: str) -> Both:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    path = follow(mdp, policy)
    subgoals = subgoal_steps(exact_importance("return_probability", mdp, policy, path, 10).values)
    content = {
        "actions": mdp.actions,
        "start": mdp.start,
        "next_state": mdp.next_state.tolist(),
        "terminal": mdp.terminal.tolist(),
        "goal": mdp.goal.tolist(),
        "policy": policy.tolist(),
        "path": {"states": path.states, "actions": path.actions},
        "subgoals": subgoals,
    }
    return Both(mdp, path, subgoals, WorldTable.from_content(name, json.loads(json.dumps(content))))


WORLDS = st.sampled_from(sorted(LAYOUTS)).map(both)


def named(world: Both, route: Sequence[int]) -> list[str]:
    return [world.mdp.actions[action] for action in route]


@given(WORLDS, ROUTES, st.data())
def test_a_route_leads_through_the_states_of_the_explainers_roll_out(
    world: Both, route: list[int], data: st.DataObject
) -> None:
    state = data.draw(st.integers(0, world.mdp.num_states - 1))
    assert world.table.roll_out(state, named(world, route)) == roll_out(world.mdp, state, route).states


@given(WORLDS, ROUTES, st.data())
def test_the_key_points_of_any_route_from_any_step_are_the_explainers(
    world: Both, route: list[int], data: st.DataObject
) -> None:
    step = data.draw(st.integers(1, world.path.num_steps))
    wanted = key_point_steps(world.mdp, world.path, world.subgoals, route, step)
    assert world.table.key_points(step, named(world, route)) == wanted


@given(WORLDS, ROUTES, st.data())
def test_a_route_that_begins_like_the_path_misses_what_the_explainer_says(
    world: Both, rest: list[int], data: st.DataObject
) -> None:
    """Random routes pass few subgoals; these pass some."""
    step = data.draw(st.integers(1, world.path.num_steps))
    end = data.draw(st.integers(step, world.path.num_steps))
    route = [*world.path.actions[step - 1 : end], *rest]
    wanted = key_point_steps(world.mdp, world.path, world.subgoals, route, step)
    found = world.table.key_points(step, named(world, route))
    passed = world.table.subgoals_passed(step, named(world, route))
    assert found == wanted
    assert set(passed) >= {subgoal for subgoal in world.subgoals if step <= subgoal <= end}
    if not world.table.is_goal(world.table.roll_out(world.path.states[step - 1], named(world, route))[-1]):
        ahead = {subgoal for subgoal in world.subgoals if subgoal >= step}
        assert (set(passed) | set(found), set(passed) & set(found)) == (ahead, set())


@given(WORLDS, st.data())
def test_the_path_itself_reaches_the_goal_and_passes_every_subgoal(world: Both, data: st.DataObject) -> None:
    step = data.draw(st.integers(1, world.path.num_steps))
    rest = world.table.path_actions[step - 1 :]
    assert world.table.is_goal(world.table.roll_out(world.table.state_of_step(step), rest)[-1])
    assert world.table.key_points(step, rest) == ()
    assert world.table.subgoals_passed(step, rest) == tuple(each for each in world.subgoals if each >= step)


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_every_state_is_told_as_the_explainer_knows_it(name: str) -> None:
    world = both(name)
    mdp, table, policy = world.mdp, world.table, plan(world.mdp)
    distances = distances_to_goal(mdp)
    for state in range(mdp.num_states):
        after = [table.next_state(state, action) for action in table.actions]
        assert after == mdp.next_state[state].tolist()
        assert [table.changes_nothing(state, action) for action in table.actions] == [each == state for each in after]
        assert (table.is_terminal(state), table.is_goal(state)) == (mdp.terminal[state], mdp.goal[state])
        assert table.optimum(state) == (distances[state] if np.isfinite(distances[state]) else None)
        if not mdp.terminal[state]:
            assert table.policy_action(state) == mdp.actions[policy[state]]


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_the_path_is_told_as_the_explainer_knows_it(name: str) -> None:
    world = both(name)
    table = world.table
    assert (table.layout, table.start, table.num_states) == (name, world.mdp.start, world.mdp.num_states)
    assert (table.path_states, table.num_steps) == (world.path.states, world.path.num_steps)
    assert (list(table.path_actions), table.subgoals) == (named(world, world.path.actions), world.subgoals)
    assert table.optimum(table.start) == world.path.num_steps


def test_a_state_from_which_no_goal_is_reached_has_no_optimum() -> None:
    """A hole beside the goal: who falls into it is there for good."""
    world = WorldTable(
        layout="hole",
        actions=("left", "right"),
        start=0,
        next_states=((1, 2), (1, 1), (2, 2)),
        terminal=frozenset({1, 2}),
        goals=frozenset({2}),
        policy=(1, 0, 0),
        path_states=(0, 2),
        path_actions=("right",),
        subgoals=(1,),
    )
    assert [world.optimum(state) for state in range(3)] == [1, None, 0]
    assert world.key_points(1, ["left"]) == (1,)
    assert world.roll_out(0, ["left", "right", "right"]) == (0, 1)


def test_what_does_not_exist_is_refused_by_name() -> None:
    table = both("simulation").table
    with pytest.raises(ValueError, match="there is no state -1; there are 308, from 0"):
        table.next_state(-1, "left")
    for ask in (table.is_goal, table.is_terminal, table.optimum, table.policy_action):
        with pytest.raises(ValueError, match="there is no state 308"):
            ask(308)
    with pytest.raises(
        ValueError, match="there is no action 'jump'; the actions are forward, left, right, pickup, toggle"
    ):
        table.roll_out(table.start, ["left", "jump"])
    with pytest.raises(ValueError, match="there is no action 'jump'"):
        table.roll_out(table.path_states[-1], ["jump"])
    for step in (0, 21):
        with pytest.raises(ValueError, match=f"there is no step {step}; the path has steps 1 to 20"):
            table.key_points(step, [])
    with pytest.raises(ValueError, match="the episode has ended in state"):
        table.policy_action(table.path_states[-1])


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"policy": (0,)}, "a policy for 1 states does not fit 308"),
        ({"path_actions": ("left",) * 20}, "the actions of the path do not lead through its states"),
        ({"goals": frozenset[int]()}, "the path must end in a goal"),
        ({"subgoals": (7, 7)}, "subgoals ascend from 1 to 20"),
        ({"subgoals": (21,)}, "subgoals ascend from 1 to 20"),
        ({"subgoals": (0,)}, "subgoals ascend from 1 to 20"),
    ],
)
def test_parts_that_do_not_fit_are_refused(changes: dict[str, object], problem: str) -> None:
    table = both("simulation").table
    parts = {field.name: getattr(table, field.name) for field in dataclasses.fields(table)}
    with pytest.raises(ValueError, match=problem):
        WorldTable(**{**parts, **changes})


def test_the_tables_of_a_bundle_are_read_as_they_were_written(bundle: Catalogue) -> None:
    for name in bundle.study.layouts:
        table, wanted = bundle.world(name), both(name).table
        assert all(getattr(table, field.name) == getattr(wanted, field.name) for field in dataclasses.fields(table))
