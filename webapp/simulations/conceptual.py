"""The paper's conceptual diagram as a world: whoever goes from S to G passes C, and A or B (Sakai et al. 2021).

The caption of section 4.2 says that "the most important node is C, followed by A and B". The diagram itself is drawn
here from these words: S - A - C and S - B - C, each passable both ways, and C - G, which ends the episode. An action is
named for the node it leads to and leaves the state as it is where there is no such way. Neither A nor B is the shorter
way, so that which of them is passed is the policy's choice alone.

In this world, `apart`, every way leads from S or C to A or B, or back. After an even number of random actions from A
nobody is where the policy would lead back to A, and A's return probability is 0. A second world, `joined`, has a way
between A and B, too, and the caption is as true of it.

What holds of the caption's order, `C` above `A` on the way through A and above `B` on the way through B:

- with return probabilities in both worlds for every r from 1 on;
- with average causal effects in `joined` for every r from 1 on, in `apart` for every r from 2 on; with r = 1 in `apart`
  forbidding the way from A leaves only S to go to, from where the policy leads back to A: A is as important as C;
- with r = 0 for neither: without a random action nothing is returned to, and without its best action no state of a
  path reaches the goal.

A and B are above S, and so second, in `joined` for every r from 1 on; in `apart` for every odd r, while for every even
one they share their place with S.
"""

from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
import pandas as pd

from webapp.explainer.importance import PROBABILITY_KINDS, exact_importance
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.pictures.figure_style import BLUE, GREY, INK, VERMILION
from webapp.explainer.solvers import follow, plan
from webapp.simulations.importance_figures import IMPORTANCE_NAMES, PAGE_WIDTH, drawn_twice

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ConceptKind = Literal["apart", "joined"]
Way = Literal["A", "B"]
NODES = ("S", "A", "B", "C", "G")
MOST_RANDOM_STEPS = 10

_DIAMOND = (("S", "A"), ("S", "B"), ("A", "C"), ("B", "C"))
_WAYS: Mapping[ConceptKind, tuple[tuple[str, str], ...]] = {
    "apart": _DIAMOND,
    "joined": (*_DIAMOND, ("A", "B")),
}
"""The two-way ways of each world; C leads on to G in both."""


def conceptual_world(kind: ConceptKind = "apart") -> DeterministicMDP:
    """Return the diagram as a world of five states and five actions, each named for the node it leads to.

    Args:
        kind: Whether there is a way between A and B.
    """
    index = {node: place for place, node in enumerate(NODES)}
    moves = np.repeat(np.arange(len(NODES), dtype=np.int32)[:, None], len(NODES), axis=1)
    ways = [pair for first, second in _WAYS[kind] for pair in ((first, second), (second, first))]
    for here, there in [*ways, ("C", "G")]:
        moves[index[here], index[there]] = index[there]
    ends = np.array([node == "G" for node in NODES])
    return DeterministicMDP(NODES, tuple(f"to {node}" for node in NODES), moves, ends, ends.copy(), index["S"])


def policy_through(world: DeterministicMDP, way: Way) -> Policy:
    """Return the policy that takes a shortest path everywhere, and from S the one through A or through B.

    Args:
        world: One of the two.
        way: Which of the two nodes to pass.
    """
    policy = plan(world)
    policy[world.index["S"]] = world.actions.index(f"to {way}")
    return policy


def conceptual_rows() -> pd.DataFrame:
    """Return the exact importance of each node that is passed, one row per world, importance, r, way and node.

    The columns are world, importance, random_steps (r), way (A or B), node and value. G is the target.
    """
    rows: list[dict[str, object]] = []
    for kind, way in product(get_args(ConceptKind), get_args(Way)):
        world = conceptual_world(kind)
        policy = policy_through(world, way)
        path = follow(world, policy)
        for importance, r in product(PROBABILITY_KINDS, range(MOST_RANDOM_STEPS + 1)):
            values = exact_importance(importance, world, policy, path, r).values.tolist()
            about = {"world": kind, "importance": importance, "random_steps": r, "way": way}
            rows += [about | {"node": NODES[s], "value": v} for s, v in zip(path.states, values, strict=True)]
    return pd.DataFrame(rows)


def draw_conceptual(rows: pd.DataFrame) -> dict[str, bytes]:
    """Draw the diagram, and the importance of its nodes over r, as `conceptual.svg` and `.png`.

    Args:
        rows: As `conceptual_rows` returns them.
    """
    return drawn_twice("conceptual", (PAGE_WIDTH, 2.35), lambda figure: _fill(figure, rows))


_PLACES: Mapping[str, tuple[float, float]] = {
    "S": (0.0, 0.0),
    "A": (1.0, 0.75),
    "B": (1.0, -0.75),
    "C": (2.0, 0.0),
    "G": (3.0, 0.0),
}
_LINES = (("C", VERMILION, "o"), ("A", BLUE, "s"), ("S", GREY, "^"))
"""The nodes that are passed on the way through A; by symmetry B's importance is A's on the other way."""


def _fill(figure: "Figure", rows: pd.DataFrame) -> None:
    diagram, *panels = figure.subplots(1, 3, width_ratios=(1.1, 1, 1))
    _diagram(diagram)
    for axes, importance in zip(panels, PROBABILITY_KINDS, strict=True):
        for kind, (node, colour, marker) in product(get_args(ConceptKind), _LINES):
            _line(axes, rows, importance, kind, node, colour, marker)
        axes.set(xlabel="r, random actions", ylim=(-0.04, 1.06), xticks=range(0, MOST_RANDOM_STEPS + 1, 2))
        axes.set_title(IMPORTANCE_NAMES[importance], fontsize=8, loc="center")
        axes.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
    _legend(figure)


def _line(
    axes: "Axes", rows: pd.DataFrame, importance: str, kind: ConceptKind, node: str, colour: str, marker: str
) -> None:
    wanted = (rows["importance"] == importance) & (rows["world"] == kind) & (rows["way"] == "A")
    own = rows[wanted & (rows["node"] == node)]
    joined = kind == "joined"
    axes.plot(
        own["random_steps"],
        own["value"],
        color=colour,
        marker=marker,
        markersize=3.4,
        markerfacecolor="white" if joined else colour,
        markeredgewidth=0.8,
        linewidth=0.9,
        linestyle=(0, (3, 2)) if joined else "solid",
        clip_on=False,
        zorder=3,
    )


def _diagram(axes: "Axes") -> None:
    for first, second in _WAYS["joined"]:
        _arrow(axes, first, second, "<|-|>", "solid" if (first, second) in _WAYS["apart"] else (0, (3, 2)))
    _arrow(axes, "C", "G", "-|>", "solid")
    colours = {"C": VERMILION, "A": BLUE, "B": BLUE}
    for node, (x, y) in _PLACES.items():
        axes.plot([x], [y], "o", markersize=15, color=colours.get(node, "white"), markeredgecolor=INK, clip_on=False)
        dark = node in colours
        axes.text(x, y, node, ha="center", va="center_baseline", fontweight="bold", color="white" if dark else INK)
    axes.set(xlim=(-0.3, 3.3), ylim=(-1.1, 1.1), aspect="equal")
    axes.axis("off")


def _arrow(axes: "Axes", first: str, second: str, style: str, line: object) -> None:
    gap = {"shrinkA": 8.5, "shrinkB": 8.5}
    look = {"arrowstyle": style, "color": INK, "linewidth": 0.9, "linestyle": line, "mutation_scale": 7}
    axes.annotate("", _PLACES[second], xytext=_PLACES[first], arrowprops={**gap, **look})


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - loaded by now.

    names = {"C": "C", "A": "A (B the same)", "S": "S"}
    lines = [
        Line2D([], [], color=colour, marker=marker, markersize=3.4, linewidth=0.9, label=names[node])
        for node, colour, marker in _LINES
    ]
    dashed = Line2D([], [], color=INK, linewidth=0.9, linestyle=(0, (3, 2)), label="with the way between A and B")
    figure.legend(handles=[*lines, dashed], loc="outside lower center", ncols=4, frameon=False, fontsize=7)
