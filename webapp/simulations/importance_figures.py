"""The importance of each state of a path as a figure (after Sakai et al. 2021, section 5.1): one panel per importance.

The drawings are for a page of 16 cm. What colours tell apart is told apart by shape and lightness, too.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from webapp.explainer.pictures.figure_style import BLUE, GREEN, GREY, INK, drawn
from webapp.simulations.importance_rows import Series, exact_series, find_series
from webapp.simulations.importance_settings import ImportanceSettings
from webapp.simulations.key_door_walks import Walk, walk_by_name

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE_WIDTH = 6.3
"""Inches: 16 cm."""
FAINT, ORANGE = "#D9D9D9", "#E69F00"
IMPORTANCE_NAMES: Mapping[str, str] = {"return_probability": "return probability", "ace": "average causal effect"}

_DARKER = "#A6A6A6"
_INCHES_PER_STEP, _PANEL_HEIGHT, _MARGIN_HEIGHT = 0.27, 1.95, 1.35
_BAR, _ASIDE = 0.78, 0.2
"""The width of a bar, and how far beside its middle the sampled values stand, in steps."""


def drawn_twice(name: str, size: tuple[float, float], fill: Callable[["Figure"], None]) -> dict[str, bytes]:
    """Draw a figure as an SVG and as a PNG file; the same drawing gives the same bytes.

    Args:
        name: Of the files, without a suffix.
        size: Width and height in inches.
        fill: Draws into the empty figure.
    """
    return {f"{name}{suffix}": drawn(fill, size, suffix, name) for suffix in (".svg", ".png")}


def draw_importance(settings: ImportanceSettings, rows: pd.DataFrame) -> dict[str, bytes]:
    """Draw the importance of every step of the planner's path, exact and estimated, as `importance.svg` and `.png`.

    The agent's own path is left out, because its steps need not be the planner's.

    Args:
        settings: Of the run.
        rows: What it found.

    Raises:
        ValueError: The rows are of another run.
    """
    exact = exact_series(rows, settings.importances[0])
    width = max(PAGE_WIDTH, _INCHES_PER_STEP * len(exact.values) + 0.7)
    height = _PANEL_HEIGHT * len(settings.importances) + _MARGIN_HEIGHT
    return drawn_twice("importance", (width, height), lambda figure: _fill(figure, settings, rows, exact))


def _fill(figure: "Figure", settings: ImportanceSettings, rows: pd.DataFrame, first: Series) -> None:
    way = walk_by_name(settings.map, first.actions)
    panels = figure.subplots(len(settings.importances), 1, sharex=True, squeeze=False)[:, 0]
    for axes, kind in zip(panels, settings.importances, strict=True):
        _panel(axes, rows, kind)
        _draw_phases(axes, way)
    _name_phases(panels[0], way)
    _name_steps(panels[-1], first)
    figure.legend(
        handles=_handles(settings), loc="outside lower center", ncols=3, frameon=False, fontsize=7, columnspacing=1.6
    )


def _panel(axes: "Axes", rows: pd.DataFrame, kind: str) -> None:
    exact = exact_series(rows, kind)
    for step, value in zip(exact.steps, exact.values, strict=True):
        chosen = step in exact.subgoals
        axes.bar(step, value, _BAR, facecolor=_DARKER if chosen else FAINT, edgecolor=INK, linewidth=0.9 * chosen)
    axes.axhline(exact.threshold, color=ORANGE, linewidth=1.6, zorder=1.5)
    _dots(axes, find_series(rows, kind, "sampled"), -_ASIDE, BLUE, "o")
    _dots(axes, find_series(rows, kind, "learned sampled"), _ASIDE, GREEN, "D")
    learned = find_series(rows, kind, "learned exact")
    if learned is not None:
        axes.hlines(learned.values, *_ends(learned), color=INK, linewidth=1.1, zorder=2.5)
    _mark_subgoals(axes, exact, _tops(rows, kind))
    highest = max(1.0, exact.values.max())
    axes.set(xlim=(0.4, len(exact.values) + 0.6), ylim=(min(0.0, exact.values.min()), 1.12 * highest))
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1], ["0", "", "0.5", "", "1"])
    axes.set_ylabel(IMPORTANCE_NAMES[kind])
    axes.tick_params(axis="x", length=0)


def _ends(series: Series) -> tuple[Any, Any]:
    middles = np.array(series.steps)
    return middles - _BAR / 2, middles + _BAR / 2


def _dots(axes: "Axes", series: Series | None, aside: float, colour: str, marker: str) -> None:
    if series is None:
        return
    shown = slice(0, -1)  # The target's importance is no estimate.
    values = series.values[shown]
    axes.errorbar(
        np.array(series.steps)[shown] + aside,
        values,
        # Rounding may put a limit a hair on the wrong side of its value.
        yerr=np.clip([values - series.low[shown], series.high[shown] - values], 0, None),
        fmt=marker,
        color=colour,
        markersize=2.6,
        markerfacecolor=colour if marker == "o" else "white",
        markeredgewidth=0.8,
        elinewidth=0.9,
        capsize=1.6,
        capthick=0.9,
        zorder=4,
        clip_on=False,
    )


def _tops(rows: pd.DataFrame, kind: str) -> Mapping[int, float]:
    """Return the highest thing that is drawn at each step."""
    drawn_here = rows[(rows["importance"] == kind) & (rows["policy"] == "planner")]
    tops = drawn_here[["value", "high"]].max(axis=1).groupby(drawn_here["step"]).max()
    return {int(step): float(top) for step, top in tops.items()}


def _mark_subgoals(axes: "Axes", exact: Series, tops: Mapping[int, float]) -> None:
    places = [tops[step] + 0.075 for step in exact.subgoals]
    axes.plot(exact.subgoals, places, "v", color=INK, markersize=4.5, linestyle="none", zorder=5, clip_on=False)


def _draw_phases(axes: "Axes", way: Walk) -> None:
    for phase in way.phases[:-1]:
        axes.axvline(phase.last + 0.5, color=GREY, linewidth=0.6, linestyle=(0, (2, 2)), zorder=0.5)


def _name_phases(axes: "Axes", way: Walk) -> None:
    """Write above each part of the path what it ends with."""
    across = axes.get_xaxis_transform()
    for phase in way.phases:
        ends = (phase.first - 0.42, phase.last + 0.42)
        axes.plot(ends, (1.035, 1.035), color=INK, linewidth=0.8, transform=across, clip_on=False)
        axes.text(sum(ends) / 2, 1.055, phase.name, transform=across, ha="center", va="bottom")


def _name_steps(axes: "Axes", first: Series) -> None:
    labels = [f"{step}  {action}" for step, action in zip(first.steps, (*first.actions, "target"), strict=True)]
    axes.set_xticks(list(first.steps), labels, rotation=90)
    for label, step in zip(axes.get_xticklabels(), first.steps, strict=True):
        label.set_fontweight("bold" if step in first.subgoals else "normal")
    axes.set_xlabel("step and action of the optimal path")


def _handles(settings: ImportanceSettings) -> list["Artist"]:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - loaded by now.
    from matplotlib.patches import Patch  # noqa: PLC0415

    trials = f"{settings.num_trials:,} trials"
    dot: Mapping[str, Any] = {"linestyle": "none", "markersize": 3.2}
    sampled = Line2D([], [], marker="o", color=BLUE, label=f"sampled, {trials}, 95 %", **dot)
    handles: list[Artist] = [
        Patch(facecolor=FAINT, label="exact"),
        Line2D([], [], color=ORANGE, linewidth=1.6, label="mean of the exact values"),
        Line2D([], [], color=INK, marker="v", linestyle="none", markersize=4.5, label="subgoal"),
        sampled,
    ]
    if settings.learned:
        hollow = {**dot, "markerfacecolor": "white"}
        handles.append(Line2D([], [], marker="D", color=GREEN, label=f"learned model, {trials}, 95 %", **hollow))
        handles.append(Line2D([], [], color=INK, linewidth=1.1, label="learned model, exact"))
    return handles
