"""Key-door maps in matplotlib patches: the cells and what lies in them, agents, and ways that keep to their side.

A way is drawn beside the middle of each cell, on the right of whoever walks it, so that there and back stay apart.
"""

from collections.abc import Iterable, Sequence
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any

from webapp.explainer.pictures.figure_style import GREEN, INK, VERMILION
from webapp.explainer.worlds.key_door import STEPS, KeyDoorState
from webapp.explainer.worlds.layout import Cell, Layout

if TYPE_CHECKING:
    from matplotlib.axes import Axes

YELLOW = "#F0E442"
_WALL, _GRID = "#8A8A8A", "#E2E2E2"
_LANE, _LABEL = 0.15, 0.25
"""How far beside the middle of a cell a way runs, and where the numbers of its steps begin."""
_RIM = 0.62
"""So much of the outer walls' cells is cut off, because there is nothing to see in them."""


def draw_map(axes: "Axes", layout: Layout) -> None:
    """Draw a map's cells, walls, goal, door and key, without the agent; y points down as on the map.

    Args:
        axes: Empty; it is sized to the map.
        layout: The map.
    """
    from matplotlib.patches import Rectangle  # noqa: PLC0415 - loaded by now.

    for y in range(layout.height):
        for x in range(layout.width):
            colour = _WALL if (x, y) in layout.walls else "white"
            edge = colour if colour == _WALL else _GRID
            axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=colour, edgecolor=edge, linewidth=0.5))
    x, y = layout.goal
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=GREEN, alpha=0.55, linewidth=0))
    _draw_door(axes, layout.door)
    _draw_key(axes, layout.key)
    axes.set(xlim=(_RIM - 0.5, layout.width - 0.5 - _RIM), ylim=(layout.height - 0.5 - _RIM, _RIM - 0.5))
    axes.set(aspect="equal", anchor="N", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def draw_believed_door(axes: "Axes", door: Cell) -> None:
    """Draw the dashed outline of a door that is not there."""
    from matplotlib.patches import Rectangle  # noqa: PLC0415 - loaded by now.

    look: dict[str, Any] = {"facecolor": "white", "edgecolor": INK, "linewidth": 0.9, "linestyle": (0, (2.5, 1.5))}
    axes.add_patch(Rectangle((door[0] - 0.48, door[1] - 0.48), 0.96, 0.96, zorder=1.5, **look))
    axes.text(door[0], door[1] - 0.2, "?", ha="center", va="center_baseline", fontsize=7, color=INK, zorder=1.6)


def draw_agent(axes: "Axes", state: KeyDoorState, *, size: float = 0.27, zorder: float = 5) -> None:
    """Draw the agent as a triangle that points where it faces."""
    from matplotlib.patches import Polygon  # noqa: PLC0415 - loaded by now.

    (dx, dy), (px, py) = STEPS[state.heading], STEPS[(state.heading + 1) % 4]
    corners = [(1.0, 0.0), (-0.8, 0.85), (-0.8, -0.85)]
    points = [
        (state.x + size * (ahead * dx + aside * px), state.y + size * (ahead * dy + aside * py))
        for ahead, aside in corners
    ]
    axes.add_patch(Polygon(points, facecolor=VERMILION, edgecolor=INK, linewidth=0.6, zorder=zorder))


def draw_frame(axes: "Axes", state: KeyDoorState, name: str, **look: Any) -> None:  # noqa: ANN401 - a patch's own options.
    """Frame the agent's cell and write a name onto the frame's corner, behind the agent and to its left.

    Args:
        axes: With a map.
        state: Where the agent is.
        name: What to write; short.
        look: Of the frame, as matplotlib's `Rectangle` calls it; the name gets the colour of its edge.
    """
    from matplotlib.patches import Rectangle  # noqa: PLC0415 - loaded by now.

    axes.add_patch(Rectangle((state.x - 0.47, state.y - 0.47), 0.94, 0.94, fill=False, zorder=6, **look))
    tag = {"facecolor": look["edgecolor"], "edgecolor": "none", "boxstyle": "round,pad=0.18"}
    place = (state.x - 0.42, state.y - 0.42)
    letters: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 5.5, "fontweight": "bold", "color": "white"}
    axes.text(*place, name, bbox=tag, zorder=7, **letters)


def draw_way(axes: "Axes", states: Sequence[KeyDoorState], **look: Any) -> None:  # noqa: ANN401 - a line's own options.
    """Draw a way as a line with an arrow at its end.

    Args:
        axes: With a map.
        states: At least one.
        look: Of the line, as matplotlib's `plot` calls it.
    """
    turns = [pair for pair in pairwise(states) if pair[0].heading != pair[1].heading]
    points = [_lane_point(states[0]), *(_corner(*turn) for turn in turns), _lane_point(states[-1])]
    axes.plot(*zip(*points, strict=True), solid_joinstyle="round", solid_capstyle="round", **look)
    axes.plot(*points[-1], marker=">v<^"[states[-1].heading], markersize=4, color=look["color"], zorder=look["zorder"])


def number_steps(axes: "Axes", states: Sequence[KeyDoorState], steps: Iterable[int], colour: str = INK) -> None:
    """Write the numbers of some steps beside the way, those that begin in one place and heading together.

    Args:
        axes: With a map.
        states: Of the way; that of step t is at t - 1.
        steps: Ascending, from 1.
        colour: Of the numbers.
    """
    from matplotlib.patheffects import AbstractPathEffect, Stroke  # noqa: PLC0415 - loaded by now.

    posed = groupby(steps, key=lambda step: (states[step - 1].x, states[step - 1].y, states[step - 1].heading))
    for (x, y, heading), group in posed:
        numbers = list(group)
        text = str(numbers[0]) if len(numbers) == 1 else f"{numbers[0]}–{numbers[-1]}"  # noqa: RUF001 - from, to.
        dx, dy = STEPS[(heading + 1) % 4]
        across = {1: "left", -1: "right"}.get(dx, "center")
        # Numbers above or below a way are as high as numbers are, however wide.
        place = (x + _LABEL * dx, y + (_LABEL + 0.07) * dy)
        # The halo is a text of its own: one with an effect is not noted as a text in an SVG file.
        halo: list[AbstractPathEffect] = [Stroke(linewidth=1.4, foreground="white")]
        for effects in (halo, []):
            number = axes.text(*place, text, ha=across, va="center_baseline", fontsize=5, color=colour, zorder=4)
            number.set_path_effects(effects)


def draw_stop(axes: "Axes", state: KeyDoorState, colour: str) -> None:
    """Mark with a cross where a way ends without having arrived."""
    axes.plot(*_lane_point(state), marker="X", markersize=8, color=colour, markeredgecolor="white", zorder=6)


def _lane_point(state: KeyDoorState) -> tuple[float, float]:
    dx, dy = STEPS[(state.heading + 1) % 4]
    return state.x + _LANE * dx, state.y + _LANE * dy


def _corner(before: KeyDoorState, after: KeyDoorState) -> tuple[float, float]:
    """Return where the lanes before and after a turn cross."""
    (x, y), (dx, dy) = _lane_point(after), STEPS[(before.heading + 1) % 4]
    return x + _LANE * dx, y + _LANE * dy


def _draw_door(axes: "Axes", door: Cell) -> None:
    from matplotlib.patches import Circle, Rectangle  # noqa: PLC0415 - loaded by now.

    x, y = door
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=YELLOW, edgecolor=INK, linewidth=0.7))
    axes.add_patch(Rectangle((x - 0.38, y - 0.38), 0.76, 0.76, fill=False, edgecolor=INK, linewidth=0.5))
    axes.add_patch(Circle((x + 0.24, y - 0.2), 0.06, facecolor=INK, linewidth=0))


def _draw_key(axes: "Axes", key: Cell) -> None:
    from matplotlib.patches import Circle, Rectangle  # noqa: PLC0415 - loaded by now.

    x, y = key
    look: dict[str, Any] = {"facecolor": YELLOW, "edgecolor": INK, "linewidth": 0.6}
    for corner, width, height in (((0.0, 0.14), 0.2, 0.08), ((0.0, 0.28), 0.2, 0.08), ((-0.05, -0.05), 0.1, 0.43)):
        axes.add_patch(Rectangle((x + corner[0], y + corner[1]), width, height, **look))
    axes.add_patch(Circle((x, y - 0.17), 0.16, **look))
    axes.add_patch(Circle((x, y - 0.17), 0.06, facecolor="white", edgecolor=INK, linewidth=0.6))
