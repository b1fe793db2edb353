"""Key-door worlds seen more coarsely: as rooms, and as the events that lead from room to room.

Sakai et al. 2021, section 7.2: taking the key from the left and taking it from the right is one thing, "take the key",
to somebody who does not ask for details. Which promises these abstractions can keep depends on the map: a corner may
lie where only somebody who passes by the door can come to it. `abstraction.sound_refinement` splits such a room.
"""

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Literal, NamedTuple, get_args

from webapp.explainer.abstraction import Abstraction
from webapp.explainer.worlds.key_door import STEPS, KeyDoorState
from webapp.explainer.worlds.layout import Cell, Layout

Thing = Literal["", "key", "door", "goal"]
CoarseGranularity = Literal["events", "rooms"]
COARSE_GRANULARITIES: tuple[CoarseGranularity, ...] = get_args(CoarseGranularity)

DOORWAY, GOAL = "the doorway", "the goal"
"""The places that are one cell."""


class Whereabouts(NamedTuple):
    """What the rooms of a key-door world are about.

    The place alone would not do: who lacks a key that lies two rooms away cannot step into the doorway next. The door
    need not be kept, because whoever holds the key can open it.

    Attributes:
        place: As `places_of` names it.
        has_key: 0 or 1.
    """

    place: str
    has_key: int

    def __str__(self) -> str:
        return f"{self.place}, {'key in hand' if self.has_key else 'no key'}"


class Situation(NamedTuple):
    """What the events of a key-door world change.

    Attributes:
        place: As `places_of` names it.
        has_key: 0 or 1.
        door_open: 0 or 1.
        beside: The thing next to the agent, whichever way it faces, with which it could do something now: the key
            while it lies there, the door while the key is in hand, the goal; the first of these, or nothing.
    """

    place: str
    has_key: int
    door_open: int
    beside: Thing

    def __str__(self) -> str:
        facts = [
            self.place,
            "key in hand" if self.has_key else "no key",
            "door open" if self.door_open else "door shut",
        ]
        return ", ".join([*facts, *([f"beside the {self.beside}"] if self.beside else [])])


def places_of(layout: Layout) -> dict[Cell, str]:
    """Name the place of every cell that can be walked to.

    A room is floor that a square of 2 x 2 cells can sweep; what is left is passages, such as a gap in a wall or a
    corridor one cell wide. The doorway is a place of its own, so that passing it is seen; so is the goal, where the
    episode ends. Rooms and passages are numbered in the order in which somebody who can open the door comes to them.
    """
    floor = {(x, y) for x in range(layout.width) for y in range(layout.height)} - layout.walls
    wide = {cell for corner in floor if (square := _square(corner)) <= floor for cell in square}
    places = {layout.door: DOORWAY, layout.goal: GOAL}
    counts = {"room": 0, "passage": 0}
    for cell in _spread([layout.start], floor):
        if cell in places:
            continue
        kind, alike = ("room", wide) if cell in wide else ("passage", floor - wide)
        counts[kind] += 1
        for other in _spread([cell], alike - {layout.door, layout.goal}):
            places[other] = f"{kind} {counts[kind]}"
    return places


def rooms(layout: Layout) -> Abstraction:
    """Return the abstraction that keeps where the agent is and whether it holds the key; see `Whereabouts`."""
    return _abstraction("rooms", layout, lambda place, state: Whereabouts(place, state.has_key))


def events(layout: Layout) -> Abstraction:
    """Return the abstraction that keeps what the events of a key-door world change; see `Situation`."""
    situation = lambda place, state: Situation(place, state.has_key, state.door_open, _beside(layout, state))
    return _abstraction("events", layout, situation)


SHIPPED: Mapping[CoarseGranularity, Callable[[Layout], Abstraction]] = {"events": events, "rooms": rooms}
"""The abstractions by name."""


def _abstraction(name: str, layout: Layout, keep: Callable[[str, KeyDoorState], Hashable]) -> Abstraction:
    places = places_of(layout)

    def coarse(label: Hashable) -> Hashable:
        if not isinstance(label, KeyDoorState):
            raise TypeError(f"this is for key-door worlds only, and {label!r} is no state of one")
        place = places.get((label.x, label.y))
        if place is None:
            raise ValueError(
                f"no way on the map leads to ({label.x}, {label.y}), so {label!r} is in none of its places"
            )
        return GOAL if place == GOAL else keep(place, label)

    return Abstraction(name, coarse, _event)


def _event(before: Hashable, after: Hashable) -> str:
    """Name what happens between two coarse labels of the same kind; the goal's is its name."""
    if not isinstance(before, Whereabouts | Situation) or not isinstance(after, Whereabouts | Situation):
        return _entering(str(after))
    if before.has_key != after.has_key:
        return "take the key"
    if before.place != after.place:
        return _entering(after.place)
    if not isinstance(before, Situation) or not isinstance(after, Situation):
        return ""
    if before.door_open != after.door_open:
        return "open the door" if after.door_open else "shut the door"
    return f"go to the {after.beside}" if after.beside else f"leave the {before.beside}"


def _entering(place: str) -> str:
    return {DOORWAY: "step into the doorway", GOAL: "reach the goal"}.get(place, f"enter {place}")


def _beside(layout: Layout, state: KeyDoorState) -> Thing:
    around = {(state.x + dx, state.y + dy) for dx, dy in STEPS}
    if layout.key in around and not state.has_key:
        return "key"
    if layout.door in around and state.has_key:
        return "door"
    return "goal" if layout.goal in around else ""


def _square(corner: Cell) -> set[Cell]:
    """Return the 2 x 2 cells whose top-left one is given."""
    x, y = corner
    return {(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)}


def _spread(cells: Iterable[Cell], ground: set[Cell]) -> list[Cell]:
    """Return the cells that can be walked to, nearest first."""
    found = dict.fromkeys(cells)
    queue = deque(found)
    while queue:
        x, y = queue.popleft()
        for dx, dy in STEPS:
            cell = (x + dx, y + dy)
            if cell in ground and cell not in found:
                found[cell] = None
                queue.append(cell)
    return list(found)
