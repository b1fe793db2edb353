"""The stability of an explanation as a picture for a paper: how often each step is a subgoal, by each choice.

Matplotlib is loaded only when a picture is drawn.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from webapp.explainer.pictures.figure_files import encoded, write_new_picture
from webapp.explainer.pictures.stability_names import level_name, num_ways, percent
from webapp.explainer.stability import Count, Level, Stability

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DOTS_PER_INCH = 200
_ROW, _COLUMN, _MARGINS = 0.27, 0.28, (2.4, 3.1)
_NARROWEST, _WIDEST = 8.0, 12.0
_GROUP_GAP = 0.35
_EDGE = 0.06
"""Beyond the outermost rows, so that their lines are not cut off."""
_MOST_NUMBERED = 50
"""On longer paths a column is too narrow for numbers and names."""
_DARK = 0.62
"""From this share on a cell is dark, and its number white."""
_FAINTEST = 0.06
_LETTERS_PER_INCH, _MARGIN = 10, 0.01
_INK, _PALE, _FRAME = "#222222", "#9a9a9a", "#d55e00"


def write_picture(stability: Stability, path: Path, title: str = "") -> None:
    r"""Draw a stability into a file; the same stability gives the same bytes.

    Shares are told apart by lightness and numbers, subgoals by frames, flips by hatching, so that the picture can be
    read without colours.

    Args:
        stability: Of one path.
        path: The file, whose suffix, `.png` or `.svg`, chooses the format; the folder must exist.
        title: The name of the map or world.

    Raises:
        ValueError: There is another suffix, no such folder, or such a file already.
        OSError: The file cannot be written.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> from webapp.explainer import (
        ...     StabilitySettings, assess_stability, follow, parse_layout, plan_world, tabulate,
        ...     write_stability_picture)
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> found = assess_stability(world, policy, path, StabilitySettings(random_steps=2))
        >>> with TemporaryDirectory() as folder:
        ...     write_stability_picture(found, Path(folder, "stability.svg"), "a corridor")
        ...     [file.name for file in Path(folder).iterdir()]
        ...
        ['stability.svg']
    """
    write_new_picture(path, lambda suffix: _draw(stability, title, suffix))


def draw_stability(stability: Stability, title: str = "") -> "Figure":
    """Draw a stability as a matplotlib figure, in matplotlib's default style whatever style the caller has set.

    Args:
        stability: Of one path.
        title: The name of the map or world.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - takes half a second to load.
    from matplotlib.figure import Figure  # noqa: PLC0415

    with _style():
        width = _MARGINS[0] + _COLUMN * len(stability.steps)
        width = max(_NARROWEST, width) if _is_numbered(stability) else _WIDEST
        figure = Figure(figsize=(width, _MARGINS[1] + _ROW * _height(stability)), layout="constrained")
        FigureCanvasAgg(figure)
        _compose(figure, stability, title)
    return figure


def _draw(found: Stability, title: str, suffix: str) -> bytes:
    figure = draw_stability(found, title)
    with _style():
        return encoded(figure, suffix, _DOTS_PER_INCH)


@contextmanager
def _style() -> Iterator[None]:
    """Set aside the caller's style, and the random part of the names inside an SVG."""
    from matplotlib import rc_context, style  # noqa: PLC0415 - takes half a second to load.

    with style.context("default"), rc_context({"svg.hashsalt": "stability", "font.size": 9, "hatch.linewidth": 0.8}):
        yield


def _is_numbered(found: Stability) -> bool:
    return len(found.steps) <= _MOST_NUMBERED


def _height(found: Stability) -> float:
    """Return the height of the matrix, in rows."""
    return max((bottom for _, _, bottom in _groups(found)), default=0.0)


def _groups(found: Stability) -> Iterator[tuple[list[tuple[int, Level]], float, float]]:
    """Yield the levels of each factor with their numbers, and where their rows begin and end."""
    top = 0.0
    for _, levels in groupby(enumerate(found.levels), key=lambda each: each[1].factor):
        group = list(levels)
        yield group, top, top + len(group)
        top += len(group) + _GROUP_GAP


def _compose(figure: "Figure", found: Stability, title: str) -> None:
    height = max(1.0, _height(found))
    shares, matrix = figure.subplots(2, 1, sharex=True, height_ratios=(1.15 / _ROW, height))
    heading = wrap(title, round(_LETTERS_PER_INCH * figure.get_figwidth()))
    heading.append(f"Subgoals in {num_ways(found)} to explain one path")
    figure.suptitle("\n".join(heading), x=_MARGIN, ha="left", fontsize="medium", fontweight="bold")
    _bars(shares, found)
    _matrix(matrix, found)
    matrix.set_xlim(0.5, len(found.steps) + 0.5)
    matrix.set_ylim(height + _EDGE, -_EDGE)
    _name_steps(matrix, found)
    _legend(figure, found)


def _bars(axes: "Axes", found: Stability) -> None:
    for step in found.steps:
        axes.bar(
            step.step,
            step.overall.share,
            width=0.8,
            facecolor="white" if step.flips else _INK,
            edgecolor=_INK,
            hatch="/////" if step.flips else None,
            linewidth=0.8 if step.overall.count else 0.0,
        )
    axes.set_ylim(0, 1)
    axes.set_yticks([0, 0.5, 1], ["0%", "50%", "100%"])
    axes.set_ylabel("share of\nall ways")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(axis="x", length=0, labelbottom=False)


def _matrix(axes: "Axes", found: Stability) -> None:
    from matplotlib.patches import Rectangle  # noqa: PLC0415 - loaded by now.

    columns = np.arange(len(found.steps) + 1) + 0.5
    ticks: list[tuple[float, str, bool]] = []
    for group, top, bottom in _groups(found):
        table = np.array([[_darkness(step.by_level[number]) for step in found.steps] for number, _ in group])
        rows = top + np.arange(len(group) + 1)
        lines = _PALE if _is_numbered(found) else "face"
        axes.pcolormesh(columns, rows, table, cmap="Greys", vmin=0, vmax=1, edgecolors=lines, linewidth=0.3)
        if not _is_numbered(found):
            axes.add_patch(Rectangle((0.5, top), len(found.steps), bottom - top, fill=False, edgecolor=_PALE, lw=0.6))
        for place, (number, level) in enumerate(group):
            ticks.append((top + place + 0.5, _row_name(level, found), 0 in level.variants))
            if _is_numbered(found):
                _number_row(axes, found, number, top + place + 0.5)
        for step in found.subgoals:
            frame = Rectangle((step - 0.5, top), 1, bottom - top, fill=False, edgecolor=_FRAME, lw=1.6, zorder=3)
            axes.add_patch(frame).set_clip_on(False)
    axes.set_yticks([place for place, _, _ in ticks], [name for _, name, _ in ticks])
    for label, (_, _, explained) in zip(axes.get_yticklabels(), ticks, strict=True):
        label.set_fontweight("bold" if explained else "normal")
    axes.tick_params(axis="both", length=0)
    axes.spines[:].set_visible(False)


def _darkness(count: Count) -> float:
    """Set a small share apart from none."""
    return _FAINTEST + (1 - _FAINTEST) * count.share if count.count else 0.0


def _number_row(axes: "Axes", found: Stability, number: int, middle: float) -> None:
    for step in found.steps:
        count = step.by_level[number]
        if count.count:
            colour = "white" if count.share >= _DARK else "black"
            axes.text(step.step, middle, percent(count), ha="center", va="center", fontsize=7, color=colour)


def _row_name(level: Level, found: Stability) -> str:
    name = level_name(level, found.settings, full=True)
    return {"random actions": f"r = {name}", "threshold": f"threshold: {name}"}.get(level.factor, name)


def _name_steps(axes: "Axes", found: Stability) -> None:
    if _is_numbered(found):
        labels = [f"{step.step}  {step.action}" for step in found.steps]
        axes.set_xticks(range(1, len(found.steps) + 1), labels, rotation=90)
        for label, step in zip(axes.get_xticklabels(), found.steps, strict=True):
            label.set_fontweight("bold" if step.is_subgoal else "normal")
    axes.set_xlabel("step of the path")


def _legend(figure: "Figure", found: Stability) -> None:
    from matplotlib.patches import Patch  # noqa: PLC0415 - loaded by now.

    share = f"{found.settings.tolerance:.0%}"
    handles = [
        Patch(facecolor="none", edgecolor=_FRAME, linewidth=1.6, label="subgoal of the explanation"),
        Patch(facecolor=_INK, edgecolor=_INK, label="holds"),
        Patch(facecolor="white", edgecolor=_INK, hatch="/////", label=f"flips (differs in more than {share})"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, title=_caption(found))


def _caption(found: Stability) -> str:
    numbers = (
        "numbers: per cent of the ways" if _is_numbered(found) else "the darker, the more of the ways; white: none"
    )
    return f"Explained (bold): {found.settings}; {numbers}"
