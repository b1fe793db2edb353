from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.mdps import mdps, planned_path
from tests.stochastic_mdps import as_mdp, fraction_worlds, some_path
from tests.worlds import LAYOUTS, lay_out, layouts
from webapp.explainer.mdp import DeterministicMDP, enumerate_mdp
from webapp.explainer.selectors import (
    evenly_spaced_steps,
    landmark_facts,
    landmark_states,
    landmarks,
    landmarks_by_fact,
)
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.stochastic import StochasticMDP, World, from_outcomes
from webapp.explainer.worlds.key_door import KeyDoorState, tabulate
from webapp.explainer.worlds.layout import Layout, LayoutError

Journey = tuple[World, Trajectory]


def tabulated(layout: Layout) -> DeterministicMDP:
    try:
        return tabulate(layout)
    except LayoutError:
        assume(condition=False)
        raise


def planned(mdp: DeterministicMDP) -> Journey:
    return mdp, planned_path(mdp)[1]


@st.composite
def chancy_journeys(draw: st.DrawFn) -> Journey:
    """Draw a stochastic world and a way through it; its labels are pairs, so that facts may return."""
    world = draw(fraction_worlds(max_states=7))
    path = some_path(world)
    assume(path is not None)
    assert path is not None
    mdp = as_mdp(world)
    labels = tuple((state // 3, state % 3) for state in world.states)
    parts = (mdp.actions, mdp.row_start, mdp.next_state, mdp.probability, mdp.terminal, mdp.goal, mdp.start)
    return StochasticMDP(labels, *parts), path


JOURNEYS = st.one_of(mdps().map(planned), layouts(6).map(tabulated).map(planned), chancy_journeys())


def successors(world: World, state: int) -> set[int]:
    if isinstance(world, DeterministicMDP):
        return set(world.next_state[state].tolist())
    first, last = world.row_start[state * world.num_actions], world.row_start[(state + 1) * world.num_actions]
    return set(world.next_state[first:last].tolist())


def can_arrive(world: World, start: int, removed: set[int]) -> bool:
    """Search the world for a goal, without some of its states."""
    known = {start} - removed
    waiting = list(known)
    while waiting:
        for after in successors(world, waiting.pop()):
            if after not in known | removed:
                known.add(after)
                waiting.append(after)
    return any(world.goal[state] for state in known)


def facts(world: World, state: int) -> set[tuple[int, object]]:
    label = world.states[state]
    return set(enumerate(label)) if isinstance(label, tuple) else {(0, label)}


@given(JOURNEYS)
def test_a_state_is_a_landmark_if_the_goal_is_out_of_reach_without_it(journey: Journey) -> None:
    world, path = journey
    expected = [
        step
        for step, state in enumerate(path.states[:-1], start=1)
        if not can_arrive(world, path.states[0], removed={state})
    ]
    assert list(landmark_states(world, path)) == expected
    assert expected[0] == 1


@given(JOURNEYS)
def test_a_fact_is_a_landmark_if_the_goal_is_out_of_reach_without_it(journey: Journey) -> None:
    world, path = journey
    everything = set().union(*(facts(world, state) for state in range(world.num_states)))
    expected = {
        fact
        for fact in everything - facts(world, path.states[0])
        if not can_arrive(
            world, path.states[0], {state for state in range(world.num_states) if fact in facts(world, state)}
        )
    }
    found = landmark_facts(world, path)
    assert set(found) == expected
    for fact, step in found.items():
        assert fact in facts(world, path.states[step])
        assert all(fact not in facts(world, state) for state in path.states[:step])


@given(JOURNEYS, st.data())
def test_the_budget_is_filled_with_landmarks_first(journey: Journey, data: st.DataObject) -> None:
    world, path = journey
    count = data.draw(st.integers(0, path.num_steps))
    own_states = set(landmark_states(world, path)) - {1}
    own_facts = set(landmark_facts(world, path).values())
    for own, ready in ((own_states, landmarks(world, path)), (own_facts, landmarks_by_fact(world, path))):
        chosen = ready.choose(count)
        assert list(chosen) == sorted(set(chosen))
        assert len(chosen) == count
        assert set(chosen) <= set(range(1, path.num_steps + 1))
        assert len(own & set(chosen)) == min(count, len(own))
        assert set(ready.own) == own
        assert ready.reason is not None
        for step in range(1, path.num_steps + 1):
            assert (ready.reason(step) == "no landmark") == (step not in own)


def test_a_path_that_comes_back_has_the_landmarks_of_the_way_without_the_loop() -> None:
    """From 0 one gets to 1, which slips back to 0 or on to the goal 2."""
    world = from_outcomes(
        ["a", "b", "end"],
        ["go"],
        [(0, 0, 1, 1.0), (1, 0, 0, 0.5), (1, 0, 2, 0.5)],
        terminal=np.array([False, False, True]),
        goal=np.array([False, False, True]),
        start=0,
    )
    path = Trajectory((0, 1, 0, 1, 2), (0, 0, 0, 0))
    assert landmark_states(world, path) == (1, 2)
    assert landmark_facts(world, path) == {(0, "b"): 1, (0, "end"): 4}
    ready = landmarks_by_fact(world, path)
    assert ready.reason is not None
    assert [ready.reason(step) for step in (1, 2, 4)] == ["state = b", "no landmark", "state = end"]


class TaxiState(NamedTuple):
    row: int
    column: int
    passenger: int
    destination: int


RIDING = 3
STANDS = {(0, 0): 0, (0, 2): 1, (2, 0): 2}


def drive(state: TaxiState, action: int) -> tuple[TaxiState, bool]:
    """Move on 3 x 3 cells; take the passenger along; let them out at any of three stands."""
    here = STANDS.get((state.row, state.column))
    if action < 4:
        row, column = state.row + (1, -1, 0, 0)[action], state.column + (0, 0, 1, -1)[action]
        inside = 0 <= row < 3 and 0 <= column < 3
        return (state._replace(row=row, column=column) if inside else state), False
    if action == 4 and here is not None and here == state.passenger:
        return state._replace(passenger=RIDING), False
    if action == 5 and here is not None and state.passenger == RIDING:
        return state._replace(passenger=here), here == state.destination
    return state, False


def test_pickup_and_drop_off_are_the_landmarks_of_a_taxi_by_name() -> None:
    actions = ("south", "north", "east", "west", "pickup", "dropoff")
    mdp = enumerate_mdp(TaxiState(1, 1, 0, 1), actions, drive)
    path = follow(mdp, plan(mdp))
    ready = landmarks_by_fact(mdp, path)
    chosen = ready.choose(2)
    assert [mdp.actions[path.actions[step - 1]] for step in chosen] == ["pickup", "dropoff"]
    assert ready.reason is not None
    assert [ready.reason(step) for step in chosen] == ["passenger = 3", "passenger = 1"]
    assert {"row = 0", "column = 0", "column = 2"} <= {ready.reason(step) for step in ready.own}
    assert not any("destination" in ready.reason(step) for step in ready.own)


@pytest.mark.parametrize("name", LAYOUTS)
def test_key_and_door_are_landmark_facts_of_every_layout_of_the_study(name: str) -> None:
    mdp = tabulate(LAYOUTS[name])
    path = follow(mdp, plan(mdp))
    found = landmark_facts(mdp, path)
    has_key, door_open = (KeyDoorState._fields.index(field) for field in ("has_key", "door_open"))
    assert mdp.actions[path.actions[found[has_key, 1] - 1]] == "pickup"
    assert mdp.actions[path.actions[found[door_open, 1] - 1]] == "toggle"
    assert found[has_key, 1] < found[door_open, 1]


def test_the_rarest_fact_comes_first() -> None:
    """The door opens from two sides, the key can be taken from four; of its facts its opening is the earliest."""
    mdp = tabulate(lay_out("########", "#>..#..#", "#.K.D..#", "#...#.G#", "########"))
    path = follow(mdp, plan(mdp))
    (chosen,) = landmarks_by_fact(mdp, path).choose(1)
    assert mdp.actions[path.actions[chosen - 1]] == "toggle"
    assert chosen == landmark_facts(mdp, path)[4, 1] > landmark_facts(mdp, path)[3, 1]


def test_in_a_corridor_every_state_is_a_landmark_and_too_many_are_thinned_evenly() -> None:
    mdp = tabulate(lay_out("#######", "#>KD.G#", "#######"))
    path = follow(mdp, plan(mdp))
    assert landmark_states(mdp, path) == tuple(range(1, path.num_steps + 1))
    evenly = tuple(step + 1 for step in evenly_spaced_steps(path.num_steps - 1, 2))
    assert landmarks(mdp, path).choose(2) == evenly


def test_landmarks_of_a_path_without_a_goal_are_refused() -> None:
    mdp = tabulate(lay_out("#######", "#>KD.G#", "#######"))
    for find in (landmark_states, landmark_facts, landmarks, landmarks_by_fact):
        with pytest.raises(ValueError, match="the path must end in a goal, not in KeyDoorState"):
            find(mdp, Trajectory((mdp.start,), ()))


def test_a_label_without_names_is_told_by_the_number_of_its_component() -> None:
    goal = np.array([False, True])
    mdp = DeterministicMDP((("a", 1), ("a", 2)), ("x",), np.array([[1], [1]], dtype=np.int32), goal, goal, 0)
    ready = landmarks_by_fact(mdp, follow(mdp, plan(mdp)))
    assert ready.reason is not None
    assert ready.reason(1) == "component 2 = 2"


@pytest.mark.parametrize("count", [-1, 2])
def test_a_budget_that_the_path_cannot_fill_is_refused(count: int) -> None:
    goal = np.array([False, True])
    mdp = DeterministicMDP(("a", "b"), ("x",), np.array([[1], [1]], dtype=np.int32), goal, goal, 0)
    path = follow(mdp, plan(mdp))
    for ready in (landmarks(mdp, path), landmarks_by_fact(mdp, path)):
        with pytest.raises(ValueError, match=f"{count} different steps cannot be chosen from a path of 1"):
            ready.choose(count)
