"""The rules of a key-door world as a function, and its finite MDP.

The rules are those of MiniGrid's DoorKey with five actions and a state of five numbers (Sakai et al. 2021, section
5). `worlds.environment` runs the same world as a Gymnasium environment; a test compares the two transition by
transition.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.labels import RowLabels
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.worlds.layout import Cell, Layout, LayoutError

ACTIONS = ("forward", "left", "right", "pickup", "toggle")
FORWARD, LEFT, RIGHT, PICKUP, TOGGLE = range(5)
STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""The cell ahead, as `(dx, dy)`, for each heading: 0 right, 1 down, 2 left, 3 up."""
MAX_STATES = 4_000_000
"""Worlds with more states than this are refused: their tables take most of a GiB."""


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
    r"""Enumerate the world's MDP from its start.

    Returns:
        An MDP whose labels are `KeyDoorState`s and whose only goal states are those on the goal's cell.

    Raises:
        LayoutError: The goal cannot be reached.

    Example:
        >>> from webapp.explainer import parse_layout, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> world.num_states, world.states[world.start]
        (37, KeyDoorState(x=2, y=1, heading=2, has_key=0, door_open=0))
    """
    mdp = enumerate_from(layout, start_state(layout))
    if not np.any(mdp.goal):
        x, y = layout.goal
        problem = "the goal cannot be reached from the agent's start; open a way with key and door"
        raise LayoutError(problem, line=y + 1, column=x + 1, source=source)
    return mdp


def enumerate_from(layout: Layout, start: KeyDoorState, *, max_states: int = MAX_STATES) -> DeterministicMDP:
    """Enumerate the MDP of a world from any state of it, whether or not the goal can be reached from there.

    The states come in the order of `mdp.enumerate_mdp`, breadth first and actions in order; but all that are equally
    far are found at once, by the rules on arrays. Their labels are made when they are asked for.

    Args:
        layout: The world.
        start: The state with the index 0; not on the goal.
        max_states: Refuse to enumerate more states than this.

    Raises:
        ValueError: There are more than `max_states` states.
    """
    codes = _Codes(layout)
    index = np.full(codes.num_codes, -1, dtype=np.int32)
    frontier = codes.of(start)
    found, num_states = [], 0
    while len(frontier):
        if num_states + len(frontier) > max_states:
            raise ValueError(f"more than {max_states} states can be reached; raise the limit or abstract them")
        index[frontier] = np.arange(num_states, num_states + len(frontier))
        num_states += len(frontier)
        found.append(frontier)
        after = codes.after(frontier[~codes.on_goal(frontier)]).ravel()
        new = after[index[after] < 0]
        frontier = new[np.sort(np.unique(new, return_index=True)[1])]
    order = np.concatenate(found)
    ends = codes.on_goal(order)
    own = np.arange(num_states, dtype=np.int32)[:, None]
    return DeterministicMDP(
        states=RowLabels(codes.states(order), KeyDoorState._make),
        actions=ACTIONS,
        next_state=np.where(ends[:, None], own, index[codes.after(order)]),
        terminal=ends,
        goal=ends.copy(),
        start=0,
    )


def key_door_state(mdp: DeterministicMDP, state: int) -> KeyDoorState:
    """Return the label of a state.

    Raises:
        TypeError: It is none of a key-door world.
    """
    label = mdp.states[state]
    if not isinstance(label, KeyDoorState):
        raise TypeError(f"this is for key-door worlds only, and {label!r} is no state of one")
    return label


def _is_free(layout: Layout, state: KeyDoorState, cell: Cell) -> bool:
    if cell == layout.key:
        return bool(state.has_key)
    if cell == layout.door:
        return bool(state.door_open)
    return cell not in layout.walls


class _Codes:
    """The rules of `step` on arrays of states, each written as one number.

    A code counts cells row by row, then headings, then whether the key is in hand, then whether the door is open.
    """

    def __init__(self, layout: Layout) -> None:
        self._width = layout.width
        self._key, self._door, self._goal = map(self._cell, (layout.key, layout.door, layout.goal))
        self._ahead = np.array([dy * layout.width + dx for dx, dy in STEPS])
        self._free = np.ones((layout.width * layout.height, 2, 2), dtype=np.bool_)
        self._free[[self._cell(wall) for wall in layout.walls]] = False
        self._free[self._door] = [False, True]
        self._free[self._key] = [[False], [True]]
        self.num_codes = len(self._free) * 16

    def _cell(self, cell: Cell) -> int:
        return cell[1] * self._width + cell[0]

    def of(self, state: KeyDoorState) -> NDArray[np.int64]:
        """Return `[1]`: the code of a state."""
        cell = self._cell((state.x, state.y))
        return np.array([((cell * 4 + state.heading) * 2 + state.has_key) * 2 + state.door_open])

    def states(self, codes: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return `[N, 5]`: the components of states `[N]`."""
        cell, *others = self._parts(codes)
        y, x = np.divmod(cell, self._width)
        return np.stack((x, y, *others), axis=1).astype(np.int32)

    def _parts(self, codes: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
        """Return the cells, the headings, whether the key is in hand and whether the door is open, each `[N]`."""
        return codes // 16, codes // 4 % 4, codes // 2 % 2, codes % 2

    def on_goal(self, codes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return `[N]`: whether the episode has ended."""
        ended: NDArray[np.bool_] = codes // 16 == self._goal
        return ended

    def after(self, codes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return `[N, A]`: where each action leads from states `[N]` in which the episode goes on."""
        cell, heading, has_key, door_open = self._parts(codes)
        ahead = cell + self._ahead[heading]
        after = np.repeat(codes[:, None], len(ACTIONS), axis=1)
        after[:, FORWARD] += np.where(self._free[ahead, has_key, door_open], (ahead - cell) * 16, 0)
        after[:, LEFT] += ((heading - 1) % 4 - heading) * 4
        after[:, RIGHT] += ((heading + 1) % 4 - heading) * 4
        after[:, PICKUP] |= (ahead == self._key) * 2
        after[:, TOGGLE] ^= (ahead == self._door) & has_key
        return after
