"""What the shipped abstractions tell apart, drawn on maps and counted in another way."""

from collections.abc import Callable

import pytest
from hypothesis import assume, given, settings

from tests.worlds import LAYOUTS, lay_out, layouts, reachable_states
from webapp.explainer.abstraction import Part, UnsoundAbstraction, coarsen
from webapp.explainer.granularity import coarse_world
from webapp.explainer.worlds.key_door import KeyDoorState, tabulate
from webapp.explainer.worlds.key_door_abstractions import (
    COARSE_GRANULARITIES,
    Situation,
    Whereabouts,
    events,
    places_of,
    rooms,
)
from webapp.explainer.worlds.layout import Layout, LayoutError


def drawn(layout: Layout) -> list[str]:
    """Draw the places: a room's number, a passage's letter, D and G, and # for what cannot be walked to."""
    symbols = {"the doorway": "D", "the goal": "G"}
    symbols |= {f"room {number}": str(number) for number in range(1, 10)}
    symbols |= {f"passage {number}": chr(ord("a") + number - 1) for number in range(1, 10)}
    places = places_of(layout)
    return [
        "".join(symbols[places[x, y]] if (x, y) in places else "#" for x in range(layout.width))
        for y in range(layout.height)
    ]


def test_gaps_in_walls_part_rooms_and_are_passages() -> None:
    layout = lay_out(
        "###########",
        "#....#....#",
        "#.>.......#",
        "##.#####D##",
        "#....#....#",
        "#.K..#..G.#",
        "###########",
    )
    assert drawn(layout) == [
        "###########",
        "#1111#3333#",
        "#1111b3333#",
        "##a#####D##",
        "#2222#4444#",
        "#2222#44G4#",
        "###########",
    ]


def test_a_corridor_is_one_passage_and_its_end_is_no_room() -> None:
    layout = lay_out(
        "########",
        "#>.#####",
        "#......#",
        "####.#D#",
        "#K...#G#",
        "########",
    )
    assert drawn(layout) == [
        "########",
        "#11#####",
        "#11aaaa#",
        "####a#D#",
        "#aaaa#G#",
        "########",
    ]


def test_floor_that_nobody_can_walk_to_has_no_place() -> None:
    layout = lay_out("########", "#>KDG#.#", "########")
    assert drawn(layout) == ["########", "#aaDG###", "########"]


def beside(layout: Layout, state: KeyDoorState) -> str:
    """Say what is within reach, from distances instead of neighbours."""
    near = {
        name: abs(state.x - x) + abs(state.y - y) == 1
        for name, (x, y) in (("key", layout.key), ("door", layout.door), ("goal", layout.goal))
    }
    if near["key"] and not state.has_key:
        return "key"
    if near["door"] and state.has_key:
        return "door"
    return "goal" if near["goal"] else ""


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_six_layouts_have_as_many_coarse_states_as_counted_in_another_way(name: str) -> None:
    layout = LAYOUTS[name]
    mdp = tabulate(layout)
    # On these maps one wall column holds the door, so the place is a matter of x alone.
    place: Callable[[KeyDoorState], str | int] = lambda s: (
        "goal" if (s.x, s.y) == layout.goal else (s.x > layout.door[0]) - (s.x < layout.door[0])
    )
    situations = {
        place(s) if place(s) == "goal" else (place(s), s.has_key, s.door_open, beside(layout, s))
        for s in reachable_states(layout)
    }
    whereabouts = {place(s) if place(s) == "goal" else (place(s), s.has_key) for s in reachable_states(layout)}
    coarse = coarse_world(mdp, layout, "rooms")
    assert coarse.mdp.num_states == len(whereabouts) == 5
    found = coarse_world(mdp, layout, "events").mdp.states
    assert sum(not isinstance(label, Part) for label in found) == len(situations) == 14
    known = {"experiment1-a": 2, "experiment1-c": 3, "experiment2-a": 2, "experiment2-b": 2}
    assert sum(isinstance(label, Part) for label in found) == known.get(name, 0)


@settings(max_examples=60)
@given(layouts(max_size=9))
def test_rooms_are_split_only_where_a_key_that_still_lies_there_is_in_the_way(layout: Layout) -> None:
    try:
        mdp = tabulate(layout)
    except LayoutError:
        assume(False)
    coarse = coarse_world(mdp, layout, "rooms")
    places = places_of(layout)
    for state, label in enumerate(mdp.states):
        assert isinstance(label, KeyDoorState)
        found = coarse.mdp.states[coarse.block_of[state]]
        whole = found.whole if isinstance(found, Part) else found
        at_goal = (label.x, label.y) == layout.goal
        assert whole == ("the goal" if at_goal else Whereabouts(places[label.x, label.y], label.has_key))
        assert not isinstance(found, Part) or not label.has_key


def test_a_key_that_blocks_a_room_splits_it_until_it_is_taken() -> None:
    layout = lay_out(
        "#########",
        "#DG>...##",
        "#.K..#..#",
        "#..#....#",
        "##.#.##.#",
        "#.......#",
        "#########",
    )
    with pytest.raises(UnsoundAbstraction, match="rooms is not sound: in room 1, no key some states can surely"):
        coarsen(tabulate(layout), rooms(layout))
    split = {str(label) for label in coarse_world(tabulate(layout), layout, "rooms").mdp.states}
    assert {"room 1, no key", "room 1, no key (part 2)", "room 1, key in hand"} <= split


@pytest.mark.parametrize("granularity", COARSE_GRANULARITIES)
@settings(max_examples=40)
@given(layout=layouts(max_size=8))
def test_a_coarse_step_changes_what_its_name_says(granularity: str, layout: Layout) -> None:
    try:
        mdp = tabulate(layout)
    except LayoutError:
        assume(False)
    abstraction = {"events": events, "rooms": rooms}[granularity](layout)
    for state, label in enumerate(mdp.states):
        for after in {mdp.states[other] for other in mdp.next_state[state].tolist()}:
            before, then = abstraction.coarse(label), abstraction.coarse(after)
            assert isinstance(label, KeyDoorState)
            assert isinstance(after, KeyDoorState)
            if before != then:
                _check(abstraction.edge_name(before, then), label, after, layout)


def _check(name: str, before: KeyDoorState, after: KeyDoorState, layout: Layout) -> None:
    places = places_of(layout)
    facts = {
        "take the key": before.has_key < after.has_key,
        "open the door": before.door_open < after.door_open,
        "shut the door": before.door_open > after.door_open,
        "reach the goal": (after.x, after.y) == layout.goal,
        "step into the doorway": (after.x, after.y) == layout.door,
    }
    facts |= {f"enter {place}": places[after.x, after.y] == place for place in places.values()}
    facts |= {f"go to the {thing}": beside(layout, after) == thing for thing in ("key", "door", "goal")}
    facts |= {f"leave the {thing}": not beside(layout, after) for thing in ("key", "door", "goal")}
    assert facts[name]


def test_labels_read_as_a_person_would_say_them() -> None:
    assert str(Situation("room 1", 0, 0, "key")) == "room 1, no key, door shut, beside the key"
    assert str(Situation("the doorway", 1, 1, "")) == "the doorway, key in hand, door open"
    assert str(Whereabouts("room 2", 1)) == "room 2, key in hand"
