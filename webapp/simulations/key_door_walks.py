"""A way through a key-door map, and what happens on it: key taken, door opened and passed, goal reached."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState, start_state, step
from webapp.explainer.worlds.layout import Layout

GET_KEY, OPEN_DOOR, PASS_DOOR, REACH_GOAL = "get key", "open door", "pass through door", "reach goal"
"""What can happen on the way, in the paper's words where it has some."""


@dataclass(frozen=True, slots=True)
class Phase:
    """A part of a way, named for what ends it.

    Attributes:
        name: What happens at its last step.
        first: Its first step, from 1.
        last: Its last step.
    """

    name: str
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class Walk:
    """The states that a sequence of actions leads through from a map's start.

    Attributes:
        layout: The map.
        states: `[T + 1]`.
        actions: `[T]` indices into `ACTIONS`.
    """

    layout: Layout
    states: tuple[KeyDoorState, ...]
    actions: tuple[int, ...]

    def event_step(self, event: str) -> int | None:
        """Return the first step that brings something about, found in how the state changes; None if none does."""
        happens = _HAPPENS[event]
        changes = enumerate(pairwise(self.states), start=1)
        return next((number for number, (before, after) in changes if happens(self.layout, before, after)), None)

    @property
    def door_steps(self) -> tuple[int, ...]:
        """The steps from the opening of the door until the doorway is left; none if the door is not passed."""
        first, last = self.event_step(OPEN_DOOR), self.event_step(PASS_DOOR)
        return () if first is None or last is None else tuple(range(first, last + 1))

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The parts that end with the key taken, the door passed and the goal reached, as far as that happens."""
        ends = {self.event_step(name): name for name in (GET_KEY, PASS_DOOR, REACH_GOAL)}
        lasts = sorted(number for number in ends if number is not None)
        return tuple(Phase(ends[last], first + 1, last) for first, last in pairwise([0, *lasts]))

    def name(self, number: int) -> str:
        """Say what a step brings about, or else what is done."""
        named = (event for event in _HAPPENS if self.event_step(event) == number)
        return next(named, ACTIONS[self.actions[number - 1]])


def walk(layout: Layout, actions: Sequence[int]) -> Walk:
    """Take some actions from a map's start; those after the goal is reached are left out.

    Raises:
        ValueError: There is no such action.
    """
    states, taken = [start_state(layout)], []
    for action in actions:
        if (states[-1].x, states[-1].y) == layout.goal:
            break
        taken.append(action)
        states.append(step(layout, states[-1], action)[0])
    return Walk(layout, tuple(states), tuple(taken))


def walk_by_name(layout: Layout, names: Sequence[str]) -> Walk:
    """Take some actions, given by name, from a map's start.

    Raises:
        ValueError: There is no such action.
    """
    return walk(layout, [ACTIONS.index(name) for name in names])


def _leaves_doorway(layout: Layout, before: KeyDoorState, after: KeyDoorState) -> bool:
    return (before.x, before.y) == layout.door != (after.x, after.y)


_HAPPENS: dict[str, Callable[[Layout, KeyDoorState, KeyDoorState], bool]] = {
    GET_KEY: lambda _, before, after: after.has_key > before.has_key,
    OPEN_DOOR: lambda _, before, after: after.door_open > before.door_open,
    PASS_DOOR: _leaves_doorway,
    REACH_GOAL: lambda layout, _, after: (after.x, after.y) == layout.goal,
}
"""Whether the change from one state to the next is what is meant."""
