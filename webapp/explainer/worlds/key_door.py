"""The rules of a key-door world as a function, and its finite MDP.

The rules are those of MiniGrid's DoorKey with five actions and a state of five numbers (Sakai et al. 2021, section
5). `worlds.environment` runs the same world as a Gymnasium environment; a test compares the two transition by
transition.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from webapp.explainer.mdp import DeterministicMDP, enumerate_mdp
from webapp.explainer.worlds.layout import Cell, Layout, LayoutError

ACTIONS = ("forward", "left", "right", "pickup", "toggle")
FORWARD, LEFT, RIGHT, PICKUP, TOGGLE = range(5)
STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""The cell ahead, as `(dx, dy)`, for each heading: 0 right, 1 down, 2 left, 3 up."""


class KeyDoorState(NamedTuple):
    """What the agent observes, and all there is to know: position, heading, key in hand, door open.

    Attributes:
        x: Column, 0 the left outer wall.
        y: Row, 0 the top outer wall.
        heading: 0 right, 1 down, 2 left, 3 up.
        has_key: 0 or 1.
        door_open: 0 or 1.
    """

    x: int
    y: int
    heading: int
    has_key: int
    door_open: int


def start_state(layout: Layout) -> KeyDoorState:
    """Return the state in which an episode begins."""
    return KeyDoorState(*layout.start, layout.heading, 0, 0)


def cell_ahead(state: KeyDoorState) -> Cell:
    """Return the cell that the agent faces."""
    dx, dy = STEPS[state.heading]
    return state.x + dx, state.y + dy


def step(layout: Layout, state: KeyDoorState, action: int) -> tuple[KeyDoorState, bool]:
    """Apply one action.

    An action that cannot act leaves the state as it is. The key blocks its cell until it is taken; the door opens
    and closes only for the agent with the key.

    Args:
        layout: The world.
        state: Where the agent is; not on the goal, where the episode has ended.
        action: An index into `ACTIONS`.

    Returns:
        The next state, and whether the goal is reached and the episode ends there.

    Raises:
        ValueError: There is no such action.
    """
    if not 0 <= action < len(ACTIONS):
        raise ValueError(f"there is no action {action}; there are {len(ACTIONS)}, from 0")
    ahead = cell_ahead(state)
    if action == LEFT:
        return state._replace(heading=(state.heading - 1) % 4), False
    if action == RIGHT:
        return state._replace(heading=(state.heading + 1) % 4), False
    if action == PICKUP and ahead == layout.key and not state.has_key:
        return state._replace(has_key=1), False
    if action == TOGGLE and ahead == layout.door and state.has_key:
        return state._replace(door_open=1 - state.door_open), False
    if action == FORWARD and _is_free(layout, state, ahead):
        return state._replace(x=ahead[0], y=ahead[1]), ahead == layout.goal
    return state, False


def tabulate(layout: Layout, source: str = "map") -> DeterministicMDP:
    """Enumerate the world's MDP from its start.

    Returns:
        An MDP whose labels are `KeyDoorState`s and whose only goal states are those on the goal's cell.

    Raises:
        LayoutError: The goal cannot be reached.
    """
    mdp = enumerate_from(layout, start_state(layout))
    if not np.any(mdp.goal):
        x, y = layout.goal
        problem = "the goal cannot be reached from the agent's start; open a way with key and door"
        raise LayoutError(problem, line=y + 1, column=x + 1, source=source)
    return mdp


def enumerate_from(layout: Layout, start: KeyDoorState) -> DeterministicMDP:
    """Enumerate the MDP of a world from any state of it, whether or not the goal can be reached from there."""
    rules: Callable[[KeyDoorState, int], tuple[KeyDoorState, bool]] = lambda state, action: step(layout, state, action)
    return enumerate_mdp(start, ACTIONS, rules)


def _is_free(layout: Layout, state: KeyDoorState, cell: Cell) -> bool:
    if cell == layout.key:
        return bool(state.has_key)
    if cell == layout.door:
        return bool(state.door_open)
    return cell not in layout.walls
