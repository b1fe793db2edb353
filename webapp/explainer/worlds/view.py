"""What the agent sees: the 3 x 3 cells before it, turned so that it faces up (Sakai et al. 2021, section 6).

This is MiniGrid's partial view of size 3, walls and shut doors hiding what lies behind them, with one difference: the
cell under the agent is kept, since otherwise passing the door and reaching the goal could not be seen.
"""

from dataclasses import dataclass
from enum import Enum

from webapp.explainer.worlds.key_door import STEPS, KeyDoorState
from webapp.explainer.worlds.layout import Cell, Layout

SIZE = 3
"""Cells along each edge of a view."""

AGENT = (2, 1)
"""The row and column of the agent's own cell: the middle of the nearest row."""


class Tile(Enum):
    """What can be seen in one cell of a view."""

    UNSEEN = "unseen"
    WALL = "wall"
    FLOOR = "floor"
    KEY = "key"
    CLOSED_DOOR = "closed_door"
    OPEN_DOOR = "open_door"
    GOAL = "goal"


_OPAQUE = frozenset({Tile.WALL, Tile.CLOSED_DOOR})
_UNDERFOOT = frozenset({Tile.FLOOR, Tile.OPEN_DOOR, Tile.GOAL})


@dataclass(frozen=True, slots=True)
class View:
    """One view. Two states look the same exactly if their views are equal.

    Attributes:
        cells: Three rows of three, the farthest row first, left to right as the agent sees them. The agent stands in
            `cells[2][1]`, which is floor, an open door or the goal. A cell is unseen exactly if the others hide it.
        has_key: Whether the agent holds the key.

    Raises:
        ValueError: No agent could see such cells; the message names the first that cannot be.
    """

    cells: tuple[tuple[Tile, ...], ...]
    has_key: bool

    def __post_init__(self) -> None:
        if len(self.cells) != SIZE or any(len(row) != SIZE for row in self.cells):
            raise ValueError(f"a view has {SIZE} rows of {SIZE} cells, not {[len(row) for row in self.cells]}")
        own = self.cells[AGENT[0]][AGENT[1]]
        if own not in _UNDERFOOT:
            raise ValueError(f"the agent cannot stand on {own.value}")
        seen = _visible(self.cells)
        for row, tiles in enumerate(self.cells):
            for column, tile in enumerate(tiles):
                if ((row, column) in seen) == (tile is Tile.UNSEEN):
                    wish = "is in sight, so it cannot be unseen" if tile is Tile.UNSEEN else "is hidden by the others"
                    raise ValueError(f"row {row}, column {column} of the view {wish}")


def egocentric_view(layout: Layout, state: KeyDoorState) -> View:
    """Return what the agent sees in a state."""
    tiles = [[_tile(layout, state, cell) for cell in row] for row in _cells_before(state)]
    seen = _visible(tiles)
    cells = tuple(
        tuple(tile if (row, column) in seen else Tile.UNSEEN for column, tile in enumerate(line))
        for row, line in enumerate(tiles)
    )
    return View(cells, has_key=bool(state.has_key))


def key_in_view(layout: Layout, state: KeyDoorState) -> bool:
    """Say whether the agent sees the key lying in the world; a key in its hand does not count."""
    return any(Tile.KEY in row for row in egocentric_view(layout, state).cells)


def _cells_before(state: KeyDoorState) -> list[list[Cell]]:
    """Return the coordinates of the cells of the view, farthest row first."""
    forward_x, forward_y = STEPS[state.heading]
    right_x, right_y = -forward_y, forward_x
    return [
        [
            (state.x + ahead * forward_x + aside * right_x, state.y + ahead * forward_y + aside * right_y)
            for aside in (-1, 0, 1)
        ]
        for ahead in (2, 1, 0)
    ]


def _tile(layout: Layout, state: KeyDoorState, cell: Cell) -> Tile:
    if cell == layout.door:
        return Tile.OPEN_DOOR if state.door_open else Tile.CLOSED_DOOR
    if cell == layout.key and not state.has_key:
        return Tile.KEY
    if cell == layout.goal:
        return Tile.GOAL
    inside = 0 <= cell[0] < layout.width and 0 <= cell[1] < layout.height
    return Tile.FLOOR if inside and cell not in layout.walls else Tile.WALL


def _visible(cells: list[list[Tile]] | tuple[tuple[Tile, ...], ...]) -> set[tuple[int, int]]:
    """Return the rows and columns in sight, by MiniGrid's rule (`Grid.process_vis`).

    Row by row from the agent outwards, once to the right and once to the left: a cell in sight that can be seen
    through shows the next cell of the sweep and the two cells ahead of both.
    """
    seen = {AGENT}
    for row in reversed(range(SIZE)):
        for columns, step in (((0, 1), 1), ((2, 1), -1)):
            for column in columns:
                if (row, column) in seen and cells[row][column] not in _OPAQUE:
                    seen |= {(row, column + step), (row - 1, column), (row - 1, column + step)}
    return {(row, column) for row, column in seen if row >= 0}
