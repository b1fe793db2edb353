"""How the explanation is derived, on the map (after Sakai et al. 2021, section 5.1): subgoals, question, key points."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from webapp.explainer.pictures.figure_style import BLUE, GREY, INK, VERMILION
from webapp.explainer.questioner import Belief, believed_states
from webapp.explainer.worlds.key_door import start_state
from webapp.simulations.importance_claims import missed_steps
from webapp.simulations.importance_figures import PAGE_WIDTH, drawn_twice
from webapp.simulations.importance_rows import exact_series
from webapp.simulations.importance_settings import ImportanceSettings
from webapp.simulations.key_door_walks import Walk, walk, walk_by_name
from webapp.simulations.map_drawing import (
    draw_agent,
    draw_believed_door,
    draw_frame,
    draw_map,
    draw_stop,
    draw_way,
    number_steps,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_CELL, _NARROWEST = PAGE_WIDTH / 3 / 7, PAGE_WIDTH / 3
"""Inches: three maps of 8 cells, or narrower ones, fill the width of a page; wider ones make a wider figure."""
_TITLE, _LINE = 0.14, 0.132
"""Inches for a panel's title, and for a line of the text below it."""


@dataclass(frozen=True, slots=True)
class Derivation:
    """What the figure shows.

    Attributes:
        way: The planner's, from the map's start to the goal.
        subgoals: Steps of it, ascending.
        belief: What the questioner takes for the map.
        route: The questioner's action indices, a shortest path on that map.
        key_points: The subgoals that the route misses; the first is the explanation.
    """

    way: Walk
    subgoals: tuple[int, ...]
    belief: Belief | None = None
    route: tuple[int, ...] = ()
    key_points: tuple[int, ...] = ()


def derivation(settings: ImportanceSettings, rows: pd.DataFrame) -> Derivation:
    """Derive subgoals and key points from the exact values of the settings' first importance.

    Args:
        settings: Of the run.
        rows: What it found.

    Raises:
        ValueError: There are no such values.
    """
    exact = exact_series(rows, settings.importances[0])
    way = walk_by_name(settings.map, exact.actions)
    missed = missed_steps(settings, way)
    key_points = tuple(step for step in exact.subgoals if step in missed)
    return Derivation(way, exact.subgoals, settings.belief, settings.route or (), key_points)


def draw_derivation(settings: ImportanceSettings, rows: pd.DataFrame) -> dict[str, bytes]:
    """Draw the derivation as `derivation.svg` and `.png`: one panel, or three where somebody asks.

    Args:
        settings: Of the run.
        rows: What it found.
    """
    found = derivation(settings, rows)
    panels: list[Callable[[Axes, Derivation], None]] = [_subgoals]
    if found.belief is not None:
        panels += [_question, _key_points]
    layout = found.way.layout
    width = max(_NARROWEST, _CELL * (layout.width - 1))
    height = _TITLE + width * (layout.height - 1) / (layout.width - 1) + _LINE * max(2, len(found.subgoals))
    size = (width * len(panels), height)
    return drawn_twice("derivation", size, lambda figure: _fill(figure, panels, found))


def _fill(figure: "Figure", panels: Sequence[Callable[["Axes", Derivation], None]], found: Derivation) -> None:
    for axes, draw in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        draw_map(axes, found.way.layout)
        draw(axes, found)


def _subgoals(axes: "Axes", found: Derivation) -> None:
    way = found.way
    draw_way(axes, way.states, color=INK, linewidth=1.1, zorder=3)
    others = [step for step in range(1, len(way.actions) + 1) if step not in found.subgoals]
    number_steps(axes, way.states, others)
    draw_agent(axes, way.states[0])
    for step in found.subgoals:
        draw_frame(axes, way.states[step - 1], str(step), edgecolor=INK, linewidth=1.2)
    _title(axes, "(a) optimal path and subgoals")
    _caption(axes, [(f"{step}  {way.name(step)}", INK) for step in found.subgoals])


def _question(axes: "Axes", found: Derivation) -> None:
    if found.belief is None:
        raise ValueError("there is no panel for a question that nobody asks")
    layout = found.way.layout
    assumed = believed_states(found.belief, start_state(layout), found.route)
    real = walk(layout, found.route)
    if found.belief.layout.door != layout.door:
        draw_believed_door(axes, found.belief.layout.door)
    draw_way(axes, real.states, color=VERMILION, linewidth=2.6, zorder=2.8)
    draw_way(axes, assumed, color=BLUE, linewidth=1.2, linestyle=(0, (2.5, 1.2)), zorder=3)
    number_steps(axes, assumed, range(1, len(found.route) + 1), BLUE)
    draw_agent(axes, real.states[0])
    arrives = (real.states[-1].x, real.states[-1].y) == layout.goal
    if not arrives:
        draw_stop(axes, real.states[-1], VERMILION)
    _title(axes, "(b) route that the questioner assumes")
    end = "they lead to the goal, too" if arrives else "where its actions really lead"
    _caption(axes, [("dashed: as assumed", BLUE), (f"solid: {end}", VERMILION)])


def _key_points(axes: "Axes", found: Derivation) -> None:
    way = found.way
    draw_way(axes, way.states, color=GREY, linewidth=0.9, zorder=2)
    lines = []
    for step in found.subgoals:
        kind, look = _rank(found, step)
        draw_agent(axes, way.states[step - 1])
        draw_frame(axes, way.states[step - 1], str(step), **look)
        lines.append((f"{step}  {way.name(step)}: {kind}", str(look["edgecolor"])))
    _title(axes, "(c) key points and explanation")
    _caption(axes, lines)


def _rank(found: Derivation, step: int) -> tuple[str, dict[str, object]]:
    if step in found.key_points[:1]:
        return "explanation", {"edgecolor": VERMILION, "linewidth": 2.0}
    if step in found.key_points:
        return "key point", {"edgecolor": BLUE, "linewidth": 1.3, "linestyle": (0, (2.5, 1.2))}
    return "on the route, too", {"edgecolor": GREY, "linewidth": 0.9, "linestyle": (0, (1, 1))}


def _title(axes: "Axes", title: str) -> None:
    axes.set_title(title, fontsize=7.5, loc="left", pad=3)


def _caption(axes: "Axes", lines: Sequence[tuple[str, str]]) -> None:
    for number, (line, colour) in enumerate(lines):
        axes.annotate(
            line,
            (0, 0),
            xycoords="axes fraction",
            xytext=(0, -4 - 72 * _LINE * number),
            textcoords="offset points",
            va="top",
            fontsize=7,
            color=colour,
        )
