"""One path explained at three granularities, by hand and by properties."""

from collections.abc import Callable, Hashable
from fractions import Fraction
from functools import cache
from random import Random

import numpy as np
import pytest
from hypothesis import assume, given, settings

from tests.worlds import LAYOUTS, lay_out, layouts
from webapp.explainer.abstraction import Abstraction, CoarseWorld, by_components, coarsen
from webapp.explainer.explanation import Explanation, explain
from webapp.explainer.granularity import (
    CoarsePath,
    coarse_path,
    coarse_policy,
    coarse_route,
    coarse_world,
    explain_coarsely,
)
from webapp.explainer.importance import exact_importance
from webapp.explainer.key_points import roll_out
from webapp.explainer.mdp import DeterministicMDP, enumerate_mdp
from webapp.explainer.questioner import believed_door_at, believed_route
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan
from webapp.explainer.stochastic import from_outcomes
from webapp.explainer.subgoals import subgoal_steps
from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState, start_state, tabulate
from webapp.explainer.worlds.key_door_abstractions import COARSE_GRANULARITIES, CoarseGranularity, places_of
from webapp.explainer.worlds.layout import HEADINGS, Layout, LayoutError

PAST_THE_KEY = lay_out(
    "#####",
    "#G..#",
    "#.D.#",
    "#..K#",
    "#...#",
    "#.^.#",
    "#####",
)
"""A map on which the shortest path passes by a key that it does not need."""


@cache
def planned(name: str) -> tuple[DeterministicMDP, Trajectory]:
    mdp = tabulate(LAYOUTS[name])
    return mdp, follow(mdp, plan(mdp))


def explained(name: str, granularity: CoarseGranularity) -> tuple[list[str], CoarsePath, Explanation]:
    mdp, path = planned(name)
    coarse = coarse_world(mdp, LAYOUTS[name], granularity)
    found, explanation = explain_coarsely(coarse, path)
    return [coarse.mdp.actions[action] for action in found.path.actions], found, explanation


def test_the_steps_of_the_simulation_have_the_papers_subgoals() -> None:
    mdp, _ = planned("simulation")
    policy = plan(mdp)
    found = explain(mdp, policy, lambda path: exact_importance("return_probability", mdp, policy, path, 10))
    assert found.subgoals == (7, 16, 20)


def test_the_events_of_the_simulation_are_explained_as_by_hand() -> None:
    # For each event on the way: how many of the things that one could do now, short of reaching the goal, lead back.
    by_hand = {
        "go to the key": Fraction(0, 1),  # There is nothing else to do than to go there.
        "take the key": Fraction(1, 2),  # leave the key | take it
        "go to the door": Fraction(0, 1),  # Whoever stands at the door does not come back.
        "open the door": Fraction(1, 2),  # leave the door | open it
        "step into the doorway": Fraction(2, 3),  # leave the door, shut it | step into the doorway
        "enter room 2": Fraction(1, 2),  # enter room 1 | enter room 2
        "leave the door": Fraction(1, 3),  # step into the doorway | shut the door and go, leave the door
        "go to the goal": Fraction(1, 2),  # go to the door | go to the goal
        "reach the goal": Fraction(1, 1),  # leave the goal
    }
    names, found, explanation = explained("simulation", "events")
    assert names == list(by_hand)
    np.testing.assert_allclose(explanation.importance.values, [*map(float, by_hand.values()), 0], atol=1e-12)
    assert explanation.threshold == pytest.approx(4 / 10)
    assert [names[step - 1] for step in explanation.subgoals] == ["take the key", "enter room 2", "reach the goal"]
    ends = ((1, 5), (6, 7), (8, 13), (14, 14), (15, 15), (16, 16), (17, 17), (18, 19), (20, 20))
    assert found.spans == ends


def test_the_rooms_of_the_simulation_are_explained_as_by_hand() -> None:
    # From the first room with the key one can only step into the doorway, from there go back or on, and from the
    # second room, short of reaching the goal, only go back.
    names, found, explanation = explained("simulation", "rooms")
    assert names == ["take the key", "step into the doorway", "enter room 2", "reach the goal"]
    np.testing.assert_allclose(explanation.importance.values, [0, 0, 1 / 2, 1, 0], atol=1e-12)
    assert explanation.subgoals == (4,)
    assert found.spans == ((1, 7), (8, 15), (16, 16), (17, 20))


def test_the_events_that_are_subgoals_end_where_the_subgoals_among_the_steps_do() -> None:
    _, found, explanation = explained("simulation", "events")
    assert [found.spans[step - 1][1] for step in explanation.subgoals] == [7, 16, 20]


@pytest.mark.parametrize("granularity", COARSE_GRANULARITIES)
def test_the_misunderstood_door_is_explained_at_any_granularity_by_what_lies_behind_the_real_one(
    granularity: CoarseGranularity,
) -> None:
    layout = LAYOUTS["simulation"]
    mdp, path = planned("simulation")
    coarse = coarse_world(mdp, layout, granularity)
    route = roll_out(mdp, mdp.start, believed_route(believed_door_at(layout, (4, 2), start_state(layout))))
    found, explanation = explain_coarsely(coarse, path, route=route)
    names = [coarse.mdp.actions[found.path.actions[step - 1]] for step in explanation.key_points]
    expected = {"events": ["enter room 2", "reach the goal"], "rooms": ["reach the goal"]}
    assert names == expected[granularity]
    assert [coarse.mdp.actions[action] for action in explanation.route or ()] == {
        "events": ["go to the key", "take the key", "go to the door", "leave the door"],
        "rooms": ["take the key"],
    }[granularity]


def key_door_and_goal(mdp: DeterministicMDP, path: Trajectory) -> set[int]:
    """Return the steps that take the key, leave the doorway and reach the goal."""
    actions = [mdp.actions[action] for action in path.actions]
    return {actions.index("pickup") + 1, actions.index("toggle") + 3, path.num_steps}


def ends_of_subgoals(coarse: CoarseWorld, path: Trajectory, random_steps: int) -> set[int]:
    """Return the steps with which the coarse subgoals end."""
    found, explanation = explain_coarsely(coarse, path, random_steps=random_steps)
    return {found.spans[step - 1][1] for step in explanation.subgoals}


def test_one_random_event_names_key_door_and_goal_on_four_layouts_and_more_of_them_on_none() -> None:
    counts = dict.fromkeys((1, 2, 3, 4, 5, 10), 0)
    for name, layout in LAYOUTS.items():
        mdp, path = planned(name)
        coarse = coarse_world(mdp, layout, "events")
        for random_steps in counts:
            counts[random_steps] += ends_of_subgoals(coarse, path, random_steps) == key_door_and_goal(mdp, path)
    assert counts == {1: 4, 2: 0, 3: 0, 4: 0, 5: 0, 10: 0}


def two_rooms(random: Random) -> Layout:
    """Draw a map of the size and kind of the six layouts that nobody chose."""
    wall, door = random.randint(3, 5), random.randint(1, 6)
    rows = [["#" if {x, y} & {0, 7} or x == wall else "." for x in range(8)] for y in range(8)]
    left = [(x, y) for x in range(1, wall) for y in range(1, 7) if (x, y) != (wall - 1, door)]
    places = [*random.sample(left, 2), (wall, door), (random.randint(wall + 1, 6), random.randint(1, 6))]
    for symbol, (x, y) in zip(["K", random.choice(HEADINGS), "D", "G"], places, strict=True):
        rows[y][x] = symbol
    return lay_out(*map("".join, rows))


@pytest.mark.slow
def test_on_maps_that_nobody_chose_one_random_event_names_key_door_and_goal_more_often_than_ten_steps() -> None:
    counts = {"events, r = 1": 0, "events, r = 2": 0, "events, r = 3": 0, "steps, r = 10": 0}
    random = Random(0)
    for _ in range(60):
        layout = two_rooms(random)
        mdp = tabulate(layout)
        policy = plan(mdp)
        path = follow(mdp, policy)
        wanted = key_door_and_goal(mdp, path)
        coarse = coarse_world(mdp, layout, "events")
        for random_steps in (1, 2, 3):
            counts[f"events, r = {random_steps}"] += ends_of_subgoals(coarse, path, random_steps) == wanted
        fine = exact_importance("return_probability", mdp, policy, path, 10)
        counts["steps, r = 10"] += set(subgoal_steps(fine.values)) == wanted
    assert counts == {"events, r = 1": 30, "events, r = 2": 0, "events, r = 3": 0, "steps, r = 10": 11}


def place_key_and_door(layout: Layout) -> Abstraction:
    """Return the events without what stands beside the agent."""
    places = places_of(layout)

    def coarse(label: Hashable) -> Hashable:
        assert isinstance(label, KeyDoorState)
        place = places[label.x, label.y]
        return place if place == "the goal" else (place, label.has_key, label.door_open)

    return Abstraction("facts", coarse, lambda _, after: f"to {after}")


@pytest.mark.parametrize("name", LAYOUTS)
def test_with_place_key_and_door_alone_only_the_goal_would_be_a_subgoal(name: str) -> None:
    mdp, path = planned(name)
    found, explanation = explain_coarsely(coarsen(mdp, place_key_and_door(LAYOUTS[name])), path)
    assert explanation.importance.values[0] == 0
    assert explanation.subgoals == (found.path.num_steps,)


def test_a_larger_map_has_no_more_coarse_states_and_the_same_subgoals() -> None:
    size, wall = 24, 12
    rows = [["#" if {x, y} & {0, size - 1} or x == wall else "." for x in range(size)] for y in range(size)]
    for symbol, x, y in (("K", 2, 2), ("D", wall, size // 2), ("G", size - 2, size - 2), ("^", 2, size - 2)):
        rows[y][x] = symbol
    layout = lay_out(*map("".join, rows))
    mdp = tabulate(layout)
    coarse = coarse_world(mdp, layout, "events")
    _, explanation = explain_coarsely(coarse, follow(mdp, plan(mdp)))
    assert mdp.num_states > 4000
    assert coarse.mdp.num_states == 14
    names = [coarse.mdp.actions[explanation.path.actions[step - 1]] for step in explanation.subgoals]
    assert names == ["take the key", "enter room 2", "reach the goal"]


def test_a_question_is_asked_at_the_coarse_step_during_which_it_comes_up() -> None:
    mdp, path = planned("simulation")
    coarse = coarse_world(mdp, LAYOUTS["simulation"], "events")
    waiting = roll_out(mdp, path.states[9], [ACTIONS.index("left")] * 4)
    _, explanation = explain_coarsely(coarse, path, route=waiting, from_step=10)
    assert (explanation.from_step, explanation.route, explanation.key_points) == (3, (), (6, 9))
    astray = roll_out(mdp, path.states[0], [ACTIONS.index("left")])
    with pytest.raises(ValueError, match="the route must begin in the state of step 10, not in state 0"):
        explain_coarsely(coarse, path, route=astray, from_step=10)
    with pytest.raises(ValueError, match="there is no step 21; the path has steps 1 to 20"):
        explain_coarsely(coarse, path, from_step=21)


def test_a_detour_that_comes_to_nothing_belongs_to_the_step_after_it() -> None:
    mdp = tabulate(PAST_THE_KEY)
    path = follow(mdp, plan(mdp))
    coarse = coarse_world(mdp, PAST_THE_KEY, "events")
    places = [str(coarse.mdp.states[block]) for block in coarse.coarse_states(path.states)]
    elsewhere, key, goal = (
        f"room 1, no key, door shut{what}" for what in ("", ", beside the key", ", beside the goal")
    )
    assert places == [elsewhere] * 2 + [key] * 2 + [elsewhere] * 2 + [goal, "the goal"]
    found, _ = explain_coarsely(coarse, path)
    assert [coarse.mdp.actions[action] for action in found.path.actions] == ["go to the goal", "reach the goal"]
    assert found.spans == ((1, 6), (7, 7))
    names = [coarse.mdp.actions[action] for action in coarse_route(coarse, path)]
    assert names == ["go to the key", "leave the key", "go to the goal", "reach the goal"]
    with pytest.raises(ValueError, match="step 3 lies on a detour that events leave out; ask at step 1 instead"):
        explain_coarsely(coarse, path, route=Trajectory(path.states[2:4], path.actions[2:3]), from_step=3)


def test_the_path_that_is_explained_need_not_be_the_coarse_planners() -> None:
    def step(here: int, action: int) -> tuple[int, bool]:
        after = here + 1 if action == 0 else 4
        return after, after == 4

    ring = enumerate_mdp(0, ("on", "jump"), step)
    path = Trajectory(tuple(ring.index[label] for label in (0, 1, 2, 3, 4)), (0, 0, 0, 0))
    coarse = coarsen(ring, Abstraction("halves", lambda label: label, lambda _, after: f"to {after}"))
    assert follow(coarse.mdp, plan(coarse.mdp)).num_steps == 1
    found = coarse_path(coarse, path)
    assert follow(coarse.mdp, coarse_policy(coarse, found.path)) == found.path
    assert found.path.num_steps == 4


@settings(max_examples=60)
@given(layouts(max_size=8))
def test_any_path_on_any_map_is_explained_at_any_granularity(layout: Layout) -> None:
    try:
        mdp = tabulate(layout)
    except LayoutError:
        assume(False)
    path = follow(mdp, plan(mdp))
    for granularity in COARSE_GRANULARITIES:
        coarse = coarse_world(mdp, layout, granularity)
        found, explanation = explain_coarsely(coarse, path)
        assert follow(coarse.mdp, coarse_policy(coarse, found.path)) == found.path == explanation.path
        assert [step for first, last in found.spans for step in range(first, last + 1)] == list(
            range(1, path.num_steps + 1)
        )
        for (_, last), block in zip(found.spans, found.path.states[1:], strict=True):
            assert coarse.block_of[path.states[last]] == block
        for step in range(1, path.num_steps + 1):
            first, last = found.spans[found.step_covering(step) - 1]
            assert first <= step <= last


def test_a_path_that_does_not_end_in_a_goal_cannot_be_explained() -> None:
    mdp, path = planned("simulation")
    coarse = coarse_world(mdp, LAYOUTS["simulation"], "rooms")
    with pytest.raises(NeverArrives, match="the path must end in a goal, not in the doorway, key in hand"):
        explain_coarsely(coarse, Trajectory(path.states[:16], path.actions[:15]))


def test_a_path_that_begins_later_cannot_be_explained_from_the_start() -> None:
    mdp, path = planned("simulation")
    coarse = coarse_world(mdp, LAYOUTS["simulation"], "rooms")
    with pytest.raises(ValueError, match="must begin where the episode does, in room 1, no key, not in room 1, key in"):
        explain_coarsely(coarse, path.from_step(8))


def test_a_lucky_path_that_no_coarse_action_takes_is_refused() -> None:
    ends = np.array([False, True, True])
    outcomes = [(0, 0, 2, 1.0), (0, 1, 1, 0.5), (0, 1, 2, 0.5)]
    gamble = from_outcomes("abc", ["give up", "dare"], outcomes, terminal=ends, goal=np.arange(3) == 1, start=0)
    coarse = coarsen(gamble, Abstraction("letters", lambda label: label, lambda _, after: f"to {after}"))
    with pytest.raises(ValueError, match="no coarse action leads from a to b, as the path does"):
        coarse_path(coarse, Trajectory((0, 1), (1,)))


@pytest.mark.parametrize("spans", [((1, 2), (4, 5)), ((2, 3), (4, 5)), ((1, 2), (3, 2)), ((1, 5),)])
def test_spans_that_do_not_join_are_refused(spans: tuple[tuple[int, int], ...]) -> None:
    with pytest.raises(ValueError, match="span"):
        CoarsePath(Trajectory((0, 1, 2), (0, 0)), spans)


def test_a_step_after_the_path_is_covered_by_nothing() -> None:
    with pytest.raises(ValueError, match="there is no step 6; the path has steps 1 to 5"):
        CoarsePath(Trajectory((0, 1), (0,)), ((1, 5),)).step_covering(6)


def test_worlds_of_another_kind_have_no_rooms() -> None:
    walk: Callable[[int, int], tuple[int, bool]] = lambda here, _: (here + 1, here == 1)
    with pytest.raises(TypeError, match="this is for key-door worlds only, and 0 is no state of one"):
        coarse_world(enumerate_mdp(0, ("on",), walk), LAYOUTS["simulation"], "rooms")


def test_a_state_off_the_map_is_in_no_room() -> None:
    with pytest.raises(ValueError, match=r"no way on the map leads to \(\d, \d\), so KeyDoorState"):
        coarse_world(planned("simulation")[0], LAYOUTS["experiment1-c"], "rooms")


def test_dropping_the_heading_leaves_cells_and_the_same_three_subgoals() -> None:
    mdp, path = planned("simulation")
    coarse = coarsen(mdp, by_components(["x", "y", "has_key", "door_open"], "cells"))
    found, explanation = explain_coarsely(coarse, path, random_steps=3)
    assert coarse.mdp.num_states == 78
    assert [found.spans[step - 1][1] for step in explanation.subgoals] == [7, 16, 20]
