"""Key-door worlds drawn as ASCII maps.

`#` wall, `.` floor, `K` key, `D` locked door, `G` goal, and the agent as `>`, `v`, `<` or `^`, whichever way it
faces. Coordinates are `(x, y)` with `(0, 0)` the top-left cell, x to the right and y down, as in MiniGrid.
"""

from dataclasses import dataclass

Cell = tuple[int, int]

HEADINGS = ">v<^"
"""The agent's symbols; the position is MiniGrid's heading: 0 right, 1 down, 2 left, 3 up."""

_NAMES = {"K": "key (K)", "D": "door (D)", "G": "goal (G)"}
_KNOWN = "#." + "KDG" + HEADINGS


class LayoutError(ValueError):
    """A map that cannot be used, with the place where it goes wrong.

    Attributes:
        line: The line of the map, from 1.
        column: The column of the map, from 1.
    """

    def __init__(self, problem: str, *, line: int, column: int, source: str) -> None:
        super().__init__(f"{source}, line {line}, column {column}: {problem}")
        self.line = line
        self.column = column


@dataclass(frozen=True, slots=True)
class Layout:
    r"""One map, checked by `parse_layout`.

    Attributes:
        width: Number of columns, the outer walls included.
        height: Number of rows, the outer walls included.
        walls: The cells that are wall.
        key: Where the key lies at first.
        door: Where the door is.
        goal: Where the goal is.
        start: Where the agent starts.
        heading: The heading with which the agent starts: 0 right, 1 down, 2 left, 3 up.

    Example:
        >>> from webapp.explainer import parse_layout
        >>> layout = parse_layout("#######\n#K<.DG#\n#######")
        >>> layout.start, layout.key, layout.door, layout.goal
        ((2, 1), (1, 1), (4, 1), (5, 1))
    """

    width: int
    height: int
    walls: frozenset[Cell]
    key: Cell
    door: Cell
    goal: Cell
    start: Cell
    heading: int

    def with_door_at(self, door: Cell) -> "Layout":
        """Return the world of somebody who believes that the door is elsewhere: the old doorway becomes wall.

        Raises:
            ValueError: The cell is not an inner wall of this map.
        """
        inner = 0 < door[0] < self.width - 1 and 0 < door[1] < self.height - 1
        if door not in self.walls or not inner:
            raise ValueError(f"a door can only be imagined in an inner wall, and {door} is none")
        return Layout(
            width=self.width,
            height=self.height,
            walls=(self.walls - {door}) | {self.door},
            key=self.key,
            door=door,
            goal=self.goal,
            start=self.start,
            heading=self.heading,
        )

    def __str__(self) -> str:
        """Draw the map; `parse_layout` reads it back."""
        special = {self.key: "K", self.door: "D", self.goal: "G", self.start: HEADINGS[self.heading]}
        rows = (
            "".join(special.get((x, y), "#" if (x, y) in self.walls else ".") for x in range(self.width))
            for y in range(self.height)
        )
        return "\n".join(rows) + "\n"


def parse_layout(text: str, source: str = "map") -> Layout:
    r"""Read and check an ASCII map.

    Whether the goal can be reached is not a question of the drawing alone; `worlds.key_door.tabulate` answers it.

    Args:
        text: The map, one line per row. Blank lines after the last row are ignored.
        source: What to call the map in messages, such as its file name.

    Raises:
        LayoutError: The map cannot be used; the message names the line and the column.

    Example:
        >>> from webapp.explainer import parse_layout
        >>> parse_layout("#######\n#K<.DG#\n#######").door
        (4, 1)
    """
    rows = text.rstrip().splitlines()
    if not rows:
        raise LayoutError("the map is empty; draw at least a walled room", line=1, column=1, source=source)
    found = _find_symbols(rows, source)
    _check_outer_walls(rows, source)
    end = {"line": len(rows), "column": len(rows[-1])}
    places = {symbol: _only(found, symbol, name, end, source) for symbol, name in _NAMES.items()}
    agents = [(cell, HEADINGS.index(symbol)) for symbol in HEADINGS for cell in found.get(symbol, [])]
    if not agents:
        raise LayoutError("there is no agent; put one of > v < ^ on the map", **end, source=source)
    if len(agents) > 1:
        (x, y), _ = sorted(agents, key=lambda agent: (agent[0][1], agent[0][0]))[1]
        raise LayoutError("there is a second agent; keep one of > v < ^", line=y + 1, column=x + 1, source=source)
    start, heading = agents[0]
    return Layout(
        width=len(rows[0]),
        height=len(rows),
        walls=frozenset(found["#"]),
        key=places["K"],
        door=places["D"],
        goal=places["G"],
        start=start,
        heading=heading,
    )


def _find_symbols(rows: list[str], source: str) -> dict[str, list[Cell]]:
    found: dict[str, list[Cell]] = {}
    width = len(rows[0])
    for y, row in enumerate(rows):
        for x, symbol in enumerate(row):
            if symbol not in _KNOWN:
                problem = f"{symbol!r} is not a map character; use one of # . K D G > v < ^"
                raise LayoutError(problem, line=y + 1, column=x + 1, source=source)
            found.setdefault(symbol, []).append((x, y))
        if len(row) != width:
            problem = f"the row has {len(row)} cells and the first row has {width}; make all rows equally long"
            raise LayoutError(problem, line=y + 1, column=min(len(row), width) + 1, source=source)
    return found


def _check_outer_walls(rows: list[str], source: str) -> None:
    height, width = len(rows), len(rows[0])
    for y, row in enumerate(rows):
        for x, symbol in enumerate(row):
            if symbol != "#" and (x in (0, width - 1) or y in (0, height - 1)):
                problem = f"the outer border must be wall (#), not {symbol!r}"
                raise LayoutError(problem, line=y + 1, column=x + 1, source=source)


def _only(found: dict[str, list[Cell]], symbol: str, name: str, end: dict[str, int], source: str) -> Cell:
    cells = found.get(symbol, [])
    if not cells:
        raise LayoutError(f"there is no {name}; put one on the map", **end, source=source)
    if len(cells) > 1:
        x, y = cells[1]
        raise LayoutError(f"there is a second {name}; keep one", line=y + 1, column=x + 1, source=source)
    return cells[0]
