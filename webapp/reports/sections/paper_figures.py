"""The figures of the paper's analysis: bars of means by item and kind, and the cells of the interaction."""

import math
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING

from webapp.analysis.means import Described
from webapp.explainer.pictures.figure_style import BLACK, BLUE, GREEN, GREY, INK, SKY, VERMILION
from webapp.reports.blocks import Figure
from webapp.reports.formatting import counted
from webapp.reports.sections.paper_numbers import CELLS, MEANS
from webapp.reports.sections.rated import Rated

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_WIDTH = 7.2
_MOST_BARS = 20
"""In one row of a figure, so that their numbers do not touch."""

_MOST_IN_LEGEND = 5
"""In one row, where its words are short."""

_LEGEND_KEY, _LEGEND_LETTER = 0.5, 0.075
"""Inches that an entry takes for its patch, and for each letter."""

_PINK, _ORANGE = "#CC79A7", "#E69F00"
"""The rest of Okabe and Ito's colours, but for yellow, which is lost on white."""

_LOOKS = (
    (BLUE, ""),
    (VERMILION, "////"),
    (GREEN, "...."),
    (SKY, "xxxx"),
    (BLACK, ""),
    (GREY, "\\\\\\\\"),
    (_PINK, "||||"),
    (_ORANGE, "----"),
    (BLUE, "...."),
    (VERMILION, "xxxx"),
    (GREEN, "////"),
    (SKY, ""),
)
"""Colour and hatching of the kinds in turn, told apart without colour too; the colours are those of the curves."""

_GRID = "#E4E4E4"

_BAR, _GROUP = 0.86, 0.8
"""How much of its place a bar takes, and how much of an item's place its bars take."""

Means = Mapping[tuple[str, str], Described]
"""By kind and item; what was not rated is not there."""

Cells = Mapping[tuple[bool, bool], Described]
"""By whether likeliness and whether loveliness is high."""


def bars_figure(rated: Rated, described: Means) -> Figure:
    """Return the bars of one experiment, in rows of items whose scales are equally long."""
    rows = _rows(rated)
    told = [
        f"{item}: "
        + ", ".join(f"{kind} {described[kind, item].mean:.2f}" for kind in rated.kinds if (kind, item) in described)
        for item in rated.items
    ]
    title = f"Mean ratings in experiment {rated.id} by item and kind of explanation, with 95 % t intervals"
    title += "; diamonds are the paper's means" if _has_paper(rated, exact=True) else ""
    title += "; triangles the values that the paper's means exceed" if _has_paper(rated, exact=False) else ""
    size = (_WIDTH, 0.5 + 2.4 * len(rows))
    alt = f"Bars of mean ratings. {'. '.join(told)}."
    return Figure(f"experiment_{rated.id}_bars", title, alt, size, lambda canvas: _fill_bars(canvas, rated, described))


def interaction_figure(rated: Rated, cells: Cells, classes: tuple[str, str, str, str]) -> Figure:
    """Return the means of the four cells.

    Args:
        rated: The experiment.
        cells: Of the analysis of variance; those without ratings are missing.
        classes: How the low and high class of likeliness, then of loveliness read, such as `1 to 3`.
    """
    names = {False: "low", True: "high"}
    told = ", ".join(
        f"{one.mean:.2f} where likeliness is {names[a]} and loveliness {names[b]}" for (a, b), one in cells.items()
    )
    title = f"The general rating in experiment {rated.id} by likeliness and loveliness, with 95 % t intervals"
    title += "; diamonds are the paper's means" if rated.paper == "1" else ""
    fill = lambda canvas: _fill_cells(canvas, rated, cells, classes)
    return Figure(f"interaction_cells_{rated.id}", title, f"Mean general rating: {told}.", (5.2, 3.2), fill)


def _has_paper(rated: Rated, *, exact: bool) -> bool:
    return any(
        experiment == rated.paper and printed.is_lower_bound is not exact
        for (experiment, _, _), printed in MEANS.items()
    )


def _rows(rated: Rated) -> list[tuple[int, list[str]]]:
    """Return the points of a scale and the items that stand in one row of the figure."""
    most = max(1, _MOST_BARS // max(1, len(rated.kinds)))
    rows: list[tuple[int, list[str]]] = []
    for points in dict.fromkeys(rated.points):
        items = [item for item in rated.items if rated.points_of(item) == points]
        num = math.ceil(len(items) / most)
        each = math.ceil(len(items) / num)
        rows += [(points, items[start : start + each]) for start in range(0, len(items), each)]
    return rows


def _fill_bars(canvas: "Canvas", rated: Rated, described: Means) -> None:
    rows = _rows(rated)
    panels = canvas.subplots(len(rows), 1, squeeze=False)[:, 0]
    widest = max(len(items) for _, items in rows)
    for (points, items), axes in zip(rows, panels, strict=True):
        for place, kind in enumerate(rated.kinds):
            _draw_kind(axes, rated, described, items, place, kind)
        axes.set(ylim=(1, points + 0.3), ylabel="mean rating", xlim=(-0.5, widest - 0.5))
        axes.set_yticks(range(1, points + 1))
        axes.set_xticks(range(len(items)), items)
        axes.tick_params(axis="x", length=0, labelsize=8)
        axes.grid(axis="y", color=_GRID, linewidth=0.6)
        axes.set_axisbelow(True)
    handles = _legend(rated)
    longest = max(len(str(handle.get_label())) for handle in handles)
    fitting = min(_MOST_IN_LEGEND, max(1, int(_WIDTH / (_LEGEND_KEY + _LEGEND_LETTER * longest))))
    num_columns = math.ceil(len(handles) / math.ceil(len(handles) / fitting))
    canvas.legend(handles=handles, loc="outside upper left", ncols=num_columns, frameon=False)


def _draw_kind(axes: "Axes", rated: Rated, described: Means, items: Sequence[str], place: int, kind: str) -> None:
    """Draw one kind's bar in each item's group, with its interval, its number and what the paper has of it."""
    step = _GROUP / len(rated.kinds)
    colour, hatch = _LOOKS[place % len(_LOOKS)]
    for group, item in enumerate(items):
        x = group - _GROUP / 2 + (place + 0.5) * step
        one = described.get((kind, item))
        if one is None and (kind, item) in rated.unasked:
            continue
        if one is None:
            axes.text(x, 1.06, "no rating", ha="center", va="bottom", fontsize=6, color=INK, rotation=90)
            continue
        axes.bar(x, one.mean - 1, step * _BAR, bottom=1, color=colour, hatch=hatch, edgecolor="white", linewidth=0)
        if one.low is not None and one.high is not None:
            _whisker(axes, x, one.low, one.high, min(0.06, step / 5))
        # No interval is drawn beyond the end of the scale.
        top = one.mean if one.high is None else min(one.high, float(rated.points_of(item)))
        axes.text(x, top + 0.04, f"{one.mean:.2f}", ha="center", va="bottom", fontsize=7)
        _mark_paper(axes, rated, kind, item, x - step * _BAR * 0.27)


def _whisker(axes: "Axes", x: float, low: float, high: float, cap: float) -> None:
    """Draw an interval with a light rim, without which it is lost on a dark bar."""
    for colour, width, rim in (("white", 2.8, 0.004), (INK, 1.1, 0.0)):
        axes.plot([x, x], [low, high], color=colour, linewidth=width, solid_capstyle="butt", zorder=3)
        for end in (low, high):
            ends = [x - cap - rim, x + cap + rim]
            axes.plot(ends, [end, end], color=colour, linewidth=width, solid_capstyle="butt", zorder=3)


def _mark_paper(axes: "Axes", rated: Rated, kind: str, item: str, x: float) -> None:
    printed = MEANS.get((rated.paper, kind, item)) if rated.paper else None
    if printed and printed.value is not None:
        _diamond(axes, x, printed.value, "^" if printed.is_lower_bound else "D")


def _diamond(axes: "Axes", x: float, y: float, marker: str = "D") -> None:
    axes.plot([x], [y], marker, color="white", markeredgecolor="black", markeredgewidth=1.1, markersize=6, zorder=4)


def _legend(rated: Rated) -> "list[Artist]":
    """Return what the legend shows, each with its label."""
    from matplotlib.lines import Line2D  # noqa: PLC0415 - loaded only to draw.
    from matplotlib.patches import Patch  # noqa: PLC0415 - the same.

    handles: list[Artist] = [
        Patch(facecolor=colour, hatch=hatch, edgecolor="white", linewidth=0, label=kind)
        for kind, (colour, hatch) in zip(rated.kinds, cycle(_LOOKS))
    ]
    for marker, label, exact in (("D", "the paper's mean", True), ("^", "the paper: above this", False)):
        if _has_paper(rated, exact=exact):
            handles.append(
                Line2D([], [], marker=marker, label=label, color="white", markeredgecolor="black", linestyle="none")
            )
    return handles


def _fill_cells(canvas: "Canvas", rated: Rated, cells: Cells, classes: tuple[str, str, str, str]) -> None:
    axes = canvas.subplots()
    _draw_cells(axes, cells, f"likeliness high ({classes[1]})", is_likely=True)
    _draw_cells(axes, cells, f"likeliness low ({classes[0]})", is_likely=False)
    if rated.paper == "1":
        _draw_paper(axes)
    points = rated.points_of("general")
    _label_cells(axes, cells, points)
    axes.set(ylim=(1, points + 0.1), xlim=(-0.45, 1.45), ylabel="mean general rating")
    axes.set_yticks(range(1, points + 1))
    axes.set_xticks([0, 1], [f"loveliness low ({classes[2]})", f"loveliness high ({classes[3]})"])
    axes.tick_params(axis="x", length=0, labelsize=8)
    axes.grid(axis="y", color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    canvas.legend(loc="outside upper left", ncols=3, frameon=False)


def _draw_paper(axes: "Axes") -> None:
    """Draw the paper's means a little inside of ours, their lines in the style of the same class."""
    for likely, style in ((True, "-"), (False, "--")):
        places = [_SHIFT[likely] + 0.07, 1 + _SHIFT[likely] - 0.07]
        means = [CELLS[likely, lovely].value or 0.0 for lovely in (False, True)]
        axes.plot(places, means, linestyle=style, color=GREY, linewidth=1.1)
        for x, mean in zip(places, means, strict=True):
            _diamond(axes, x, mean)
            axes.text(x, mean - 0.14, f"{mean:.2f}", ha="center", va="top", fontsize=6.5, color=INK)
    (shown,) = axes.plot([], [], "D-", color=GREY, linewidth=1.1, markersize=6, label="the paper's means")
    shown.set(markerfacecolor="white", markeredgecolor="black")


_SHIFT = {True: 0.02, False: -0.02}
"""The two lines stand beside each other, so that intervals do not cover each other."""


def _draw_cells(axes: "Axes", cells: Cells, label: str, *, is_likely: bool) -> None:
    """Draw the line of one class of likeliness and its intervals."""
    colour, style, marker = (BLUE, "-", "o") if is_likely else (VERMILION, "--", "s")
    there = [(lovely, cells[is_likely, lovely]) for lovely in (False, True) if (is_likely, lovely) in cells]
    places = [lovely + _SHIFT[is_likely] for lovely, _ in there]
    means = [one.mean for _, one in there]
    axes.plot(places, means, marker, linestyle=style, color=colour, linewidth=1.6, markersize=6, label=label, zorder=3)
    for x, (_, one) in zip(places, there, strict=True):
        if one.low is not None and one.high is not None:
            axes.plot([x, x], [one.low, one.high], color=colour, linewidth=1.2, solid_capstyle="butt")


def _label_cells(axes: "Axes", cells: Cells, points: int) -> None:
    """Write each cell's number outside of the lines, two that would touch moved apart."""
    gap = 0.05 * (points - 1)
    for lovely, x, align in ((False, -0.06, "right"), (True, 1.06, "left")):
        there = [one for likely in (False, True) if (one := cells.get((likely, lovely)))]
        heights = [one.mean for one in there]
        if len(heights) > 1 and abs(heights[1] - heights[0]) < gap:
            middle, up = sum(heights) / 2, math.copysign(gap / 2, heights[1] - heights[0])
            heights = [middle - up, middle + up]
        for one, height in zip(there, heights, strict=True):
            told = f"{one.mean:.2f} ({counted(one.num, 'rating')})"
            axes.text(x, height, told, ha=align, va="center", fontsize=7)
