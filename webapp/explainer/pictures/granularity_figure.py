"""One path explained at every granularity, as a figure for the documents: `python -m` this module `OUT.png [MAP.txt]`.

Each row has the map, with lines between the cells that the granularity tells apart, and the importance of its steps as
bars along the same axis of fine steps. Nothing is told by colour alone: subgoals are dark, numbered and named in bold.
Matplotlib is loaded only when the figure is drawn.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from webapp.explainer.explanation import Explanation, explain
from webapp.explainer.granularity import RANDOM_STEPS, Granularity, coarse_world, explain_coarsely
from webapp.explainer.importance import exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.figure_files import encoded
from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds.key_door import key_door_state, tabulate
from webapp.explainer.worlds.key_door_abstractions import COARSE_GRANULARITIES
from webapp.explainer.worlds.layout import Cell, Layout, parse_layout

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIMULATION = Path(__file__).parents[2] / "studies" / "sakai2021" / "layouts" / "simulation.txt"
_WIDTH, _ROW_HEIGHT, _DPI = 12.0, 3.1, 150
"""Inches, inches, and pixels per inch."""
_INK, _PALE, _LINE, _WALL, _BAND, _QUIET = "#0b3c6f", "#b9cfe6", "#b04a00", "#3d4652", "#eef1f5", "#4a5461"
_PAPER = {"boxstyle": "square,pad=0.08", "facecolor": "white", "linewidth": 0}
"""What a letter on the map stands on, so that the path does not cross it."""
_RANDOM_STEPS = 10
"""The paper's r, as chosen in docs/decisions/0001, for the row of steps."""


@dataclass(frozen=True, slots=True)
class Row:
    """One granularity of the figure.

    Attributes:
        granularity: Its name.
        world: The world at this granularity.
        spans: `[T']`, the first and the last fine step that each of its steps covers.
        explanation: Of the path, in steps of this granularity.
        random_steps: The r behind its importance.
        zones: For each cell, the states of this world in which the agent may stand there.
    """

    granularity: Granularity
    world: DeterministicMDP
    spans: tuple[tuple[int, int], ...]
    explanation: Explanation
    random_steps: int
    zones: Mapping[Cell, frozenset[int]]

    @property
    def names(self) -> tuple[str, ...]:
        """`[T']`: the action of each of its steps."""
        return tuple(self.world.actions[action] for action in self.explanation.path.actions)

    @property
    def summary(self) -> str:
        """What the importance was computed with."""
        return f"{len(self.spans)} steps, {self.world.num_states} states, r = {self.random_steps}"


def rows_of(layout: Layout) -> tuple[tuple[Cell, ...], tuple[Row, ...]]:
    """Explain the planner's path on a map at every granularity, by exact return probabilities.

    Returns:
        The cells of the planner's path, one per state, and a row per granularity from fine to coarse.

    Raises:
        LayoutError: The goal cannot be reached.
    """
    mdp = tabulate(layout)
    policy = plan(mdp)
    path = follow(mdp, policy)
    each = tuple((step, step) for step in range(1, path.num_steps + 1))
    fine = explain(mdp, policy, lambda path: exact_importance("return_probability", mdp, policy, path, _RANDOM_STEPS))
    rows = [Row("steps", mdp, each, fine, _RANDOM_STEPS, _zones(mdp, range(mdp.num_states)))]
    for granularity in COARSE_GRANULARITIES:
        coarse = coarse_world(mdp, layout, granularity)
        found, explanation = explain_coarsely(coarse, path)
        zones = _zones(mdp, coarse.block_of.tolist())
        rows.append(Row(granularity, coarse.mdp, found.spans, explanation, RANDOM_STEPS, zones))
    return tuple(_cell(mdp, state) for state in path.states), tuple(rows)


def draw(layout: Layout) -> bytes:
    """Draw the figure.

    Returns:
        A PNG without metadata, `_WIDTH * _DPI` pixels wide: the same bytes for the same map under one matplotlib.

    Raises:
        LayoutError: The goal cannot be reached.
    """
    from matplotlib import rc_context  # noqa: PLC0415 - only who draws the figure needs matplotlib.
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    cells, rows = rows_of(layout)
    with rc_context({"font.family": "DejaVu Sans", "font.size": 10}):
        figure = Figure(figsize=(_WIDTH, _ROW_HEIGHT * len(rows)), dpi=_DPI)
        FigureCanvasAgg(figure)
        _fill(figure, layout, cells, rows)
        return encoded(figure, ".png", _DPI)


def main(arguments: Sequence[str]) -> int:
    """Write the figure of a map, the study's `simulation` where none is given, to a file."""
    if len(arguments) not in {1, 2}:
        sys.stderr.write("usage: python -m webapp.explainer.pictures.granularity_figure OUT.png [MAP.txt]\n")
        return 2
    source = Path(arguments[1]) if len(arguments) > 1 else _SIMULATION
    try:
        picture = draw(parse_layout(source.read_text(encoding="utf-8"), source.name))
        Path(arguments[0]).write_bytes(picture)
    except (OSError, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


def _cell(mdp: DeterministicMDP, state: int) -> Cell:
    label = key_door_state(mdp, state)
    return label.x, label.y


def _zones(mdp: DeterministicMDP, block_of: Iterable[int]) -> Mapping[Cell, frozenset[int]]:
    zones: dict[Cell, set[int]] = {}
    for state, block in enumerate(block_of):
        zones.setdefault(_cell(mdp, state), set()).add(block)
    return {cell: frozenset(blocks) for cell, blocks in zones.items()}


def _fill(figure: "Figure", layout: Layout, cells: Sequence[Cell], rows: Sequence[Row]) -> None:
    grid = figure.add_gridspec(
        len(rows), 2, width_ratios=(1, 4.1), left=0.01, right=0.93, top=0.935, bottom=0.11, wspace=0.1, hspace=0.72
    )
    for number, row in enumerate(rows):
        _map(figure.add_subplot(grid[number, 0]), layout, cells, row)
        axes = figure.add_subplot(grid[number, 1])
        _bars(axes, row)
        _steps(axes, len(cells) - 1, "step of the path" if number == 0 else "")


def _map(axes: "Axes", layout: Layout, cells: Sequence[Cell], row: Row) -> None:
    """Draw the map with lines only between cells that the granularity tells apart, the path, and the subgoals."""
    from matplotlib.patches import Rectangle  # noqa: PLC0415

    for x in range(layout.width):
        for y in range(layout.height):
            face = _WALL if (x, y) in layout.walls else "white"
            axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=face, linewidth=0))
            if row.zones.get((x, y)) != row.zones.get((x + 1, y)):
                axes.plot((x + 0.5, x + 0.5), (y - 0.5, y + 0.5), color=_WALL, linewidth=1)
            if row.zones.get((x, y)) != row.zones.get((x, y + 1)):
                axes.plot((x - 0.5, x + 0.5), (y + 0.5, y + 0.5), color=_WALL, linewidth=1)
    axes.plot([x for x, _ in cells], [y for _, y in cells], color=_LINE, linewidth=1.8)
    axes.plot(*cells[0], marker="o", markersize=5, color=_LINE)
    for letter, (x, y) in (("K", layout.key), ("D", layout.door), ("G", layout.goal)):
        axes.text(x, y, letter, ha="center", va="center", fontsize=10, fontweight="bold", bbox=_PAPER)
    for number, step in enumerate(row.explanation.subgoals, start=1):
        x, y = cells[row.spans[step - 1][1] - 1]
        _badge(axes, x, y, number, points=(9, 9))
    axes.set(xlim=(-0.5, layout.width - 0.5), ylim=(layout.height - 0.5, -0.5), aspect="equal")
    axes.set_title(row.granularity, fontsize=13, fontweight="bold")
    axes.text(0.5, -0.06, row.summary, transform=axes.transAxes, ha="center", va="top", fontsize=9.5)
    axes.axis("off")


def _bars(axes: "Axes", row: Row) -> None:
    """Draw the importance of each step as a bar as wide as the fine steps that it covers, every second one on grey."""
    values, threshold, subgoals = row.explanation.importance.values, row.explanation.threshold, row.explanation.subgoals
    middles = [(first + last) / 2 for first, last in row.spans]
    for step, (first, last) in enumerate(row.spans, start=1):
        value, chosen = float(values[step - 1]), step in subgoals
        if step % 2 == 0:
            axes.axvspan(first - 0.5, last + 0.5, color=_BAND, linewidth=0, zorder=0)
        face = _INK if chosen else _PALE
        axes.bar(middles[step - 1], value, width=last - first + 0.8, color=face, edgecolor=_INK, linewidth=0.9)
        if chosen:
            _badge(axes, middles[step - 1], value, subgoals.index(step) + 1, points=(0, 12))
    axes.axhline(threshold, color=_LINE, linewidth=1.4, linestyle=(0, (5, 3)))
    beside = axes.get_yaxis_transform()
    axes.text(1.008, threshold, f"mean {threshold:.2f}", transform=beside, va="center", fontsize=9, color=_LINE)
    axes.set(ylim=(0, 1.25), yticks=(0, 0.5, 1), ylabel="importance")
    axes.set_xticks(middles, row.names, rotation=35, ha="right", rotation_mode="anchor", fontsize=9.5)
    for step in subgoals:
        axes.get_xticklabels()[step - 1].set_fontweight("bold")
    axes.spines[["top", "right"]].set_visible(False)


def _steps(axes: "Axes", num_steps: int, title: str) -> None:
    """Number the fine steps along the top, the same in every row."""
    axes.set_xlim(0.5, num_steps + 0.5)
    top = axes.secondary_xaxis("top")
    top.set_xticks(range(1, num_steps + 1), [str(step) for step in range(1, num_steps + 1)], fontsize=8.5, color=_QUIET)
    top.set_xlabel(title, fontsize=9, color=_QUIET, labelpad=5)
    top.tick_params(length=0, pad=1)
    top.spines["top"].set_visible(False)


def _badge(axes: "Axes", x: float, y: float, number: int, points: tuple[float, float]) -> None:
    """Draw a number in a disc, some points to the right of and above a place."""
    disc = {"boxstyle": "circle,pad=0.2", "facecolor": _INK, "edgecolor": "white", "linewidth": 0.8}
    axes.annotate(
        str(number), (x, y), points, textcoords="offset points", ha="center", va="center", bbox=disc, fontsize=8,
        fontweight="bold", color="white",
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
