"""A comparison of selectors as a figure: how far each explanation leads, over how many steps it shows."""

from pathlib import Path
from typing import TYPE_CHECKING

from webapp.explainer.comparison import Comparison, Rating
from webapp.explainer.pictures.figure_files import write_new_picture
from webapp.explainer.pictures.figure_style import BLUE, INK, VERMILION, drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_OURS, _RIVAL, _OTHERS = VERMILION, BLUE, "#C8C8C8"

_SIZE = (7.4, 4.2)
_COLUMNS = 4
_LABEL_HEIGHT = 0.08
"""What a label beside the axis takes up of its height."""

_CONFIDENCE = 1.96
"""So many standard errors to either side hold the mean in 95 of 100 cases."""


def write_picture(comparison: Comparison, path: Path) -> None:
    r"""Draw the fidelity over k of every selector, and the smallest k that exceeds alpha, into a new file.

    One panel per selector shows its curve in front of all others; the last panel compares what equation 1 of Sakai et
    al. 2021 asks for. The same comparison always gives the same bytes.

    Args:
        comparison: Of the selectors on one path.
        path: Where to: a name that ends in `.png` or `.svg` and is not there yet.

    Raises:
        ValueError: The name ends otherwise, there is such a file, or its folder is missing.
        OSError: The file cannot be written.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> from webapp.explainer import (
        ...     ComparisonSettings, compare, follow, parse_layout, plan_world, tabulate,
        ...     write_comparison_picture)
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> found = compare(world, policy, path, ComparisonSettings())
        >>> with TemporaryDirectory() as folder:
        ...     write_comparison_picture(found, Path(folder, "comparison.svg"))
        ...     [file.name for file in Path(folder).iterdir()]
        ...
        ['comparison.svg']
    """
    write_new_picture(path, lambda suffix: drawn(lambda figure: _fill(figure, comparison), _SIZE, suffix, "comparison"))


def _fill(figure: "Figure", comparison: Comparison) -> None:
    num_panels = len(comparison.ratings) + 1
    num_rows = -(-num_panels // _COLUMNS)
    panels = figure.subplots(num_rows, _COLUMNS, squeeze=False)
    for place, (axes, rating) in enumerate(zip(panels.flat, comparison.ratings, strict=False)):
        _draw_curve(axes, comparison, rating)
        axes.tick_params(labelleft=place % _COLUMNS == 0)
    _draw_smallest(panels.flat[num_panels - 1], comparison)
    for axes in panels.flat[num_panels:]:
        axes.remove()
    figure.supylabel(f"probability of the goal within {comparison.horizon} actions", fontsize=8)
    figure.supxlabel("k, the number of steps at which the policy is followed; random actions elsewhere", fontsize=8)


def _draw_curve(axes: "Axes", comparison: Comparison, rating: Rating) -> None:
    colour = _colour(rating)
    budgets = range(len(rating.curve))
    for other in comparison.ratings:
        axes.plot(budgets, [measure.value for measure in other.curve], color=_OTHERS, linewidth=0.7)
    values = [measure.value for measure in rating.curve]
    axes.axhline(comparison.alpha, color=INK, linewidth=0.6, linestyle=(0, (4, 3)))
    axes.plot(budgets, values, color=colour, linewidth=1.8)
    margins = [_CONFIDENCE * (measure.standard_error or 0.0) for measure in rating.curve]
    if any(margins):
        low, high = ([value + sign * margin for value, margin in zip(values, margins, strict=True)] for sign in (-1, 1))
        axes.fill_between(budgets, low, high, color=colour, alpha=0.25, linewidth=0)
    if rating.smallest is not None:
        _mark(axes, comparison, rating.smallest, values[rating.smallest], colour)
    axes.set_title(rating.selector, color=colour, fontweight="bold")
    top = max(comparison.scale, comparison.alpha)
    ends = [end for end in (0.0, top) if abs(end - comparison.alpha) > _LABEL_HEIGHT * top]
    axes.set(xlim=(0, comparison.path.num_steps * 1.02), ylim=(-0.02 * top, 1.04 * top))
    axes.set_yticks([comparison.alpha, *ends], [f"alpha = {comparison.alpha:g}", *(f"{end:.2g}" for end in ends)])
    axes.set_xticks(_ticks(comparison.path.num_steps))


def _mark(axes: "Axes", comparison: Comparison, budget: int, value: float, colour: str) -> None:
    """Draw a dot and write its k on the side that the curve leaves free."""
    axes.plot([budget], [value], "o", color=colour, markersize=4.5, clip_on=False)
    left = budget > comparison.path.num_steps / 4
    axes.annotate(
        f"k = {budget}",
        (budget, value),
        xytext=(-7 if left else 7, 0),
        textcoords="offset points",
        ha="right" if left else "left",
        va="center",
        color=colour,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
    )


def _draw_smallest(axes: "Axes", comparison: Comparison) -> None:
    """Draw one dot per selector at its smallest k; one that never exceeds alpha has none."""
    num_steps = comparison.path.num_steps
    for row, rating in enumerate(reversed(comparison.ratings)):
        axes.axhline(row, color=_OTHERS, linewidth=0.5)
        colour = _colour(rating)
        if rating.smallest is not None:
            axes.plot([rating.smallest], [row], "o", color=colour, markersize=4.5, clip_on=False)
        found = "none" if rating.smallest is None else str(rating.smallest)
        axes.text(0, row + 0.16, rating.selector, color=colour, va="bottom", fontsize=7)
        axes.text(num_steps * 1.02, row + 0.16, found, color=colour, va="bottom", ha="right", fontsize=7)
    axes.set_title(f"smallest k above {comparison.alpha:g}", fontweight="bold")
    axes.set(xlim=(0, num_steps * 1.02), ylim=(-0.5, len(comparison.ratings) - 0.1), yticks=[])
    axes.set_xticks(_ticks(num_steps))
    axes.spines["left"].set_visible(False)


def _ticks(num_steps: int) -> list[int]:
    """Both ends and the middle, as far as they differ."""
    return sorted({0, num_steps // 2, num_steps})


def _colour(rating: Rating) -> str:
    return _OURS if rating.selector == "subgoals" else _RIVAL
