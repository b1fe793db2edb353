"""Figures of the planned comparisons: the effects with their intervals, and what the ratings were."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pandas as pd

from webapp.analysis.planned_comparisons import Comparison, Comparisons, ratings_of
from webapp.explainer.pictures.figure_style import BLUE, GREY, INK, VERMILION
from webapp.reports.blocks import Figure
from webapp.reports.kind_outcomes import kinds_of
from webapp.reports.study_data import StudyData

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_ROW = 0.26
_MARGINS = 0.9
_LEAST_LABELLED = 0.06
"""Shares below this have no room for their number."""


def forest_figure(found: Comparisons) -> Figure:
    """Draw d with its interval for each planned comparison that was determined."""
    tests = [test for test in found.tests if test.effect is not None]
    shown = "; ".join(_sentence(test) for test in tests)
    height = _MARGINS + _ROW * (len(tests) + len({test.contrast for test in tests}))
    title = "Differences of kinds in standard deviations of the latent opinion, with 95 % intervals"
    return Figure(
        "planned_comparisons_forest",
        title,
        f"Forest plot. {shown}.",
        (7.2, height),
        lambda canvas: _fill_forest(canvas, tests),
    )


def _sentence(test: Comparison) -> str:
    effect = test.effect
    assert effect is not None  # noqa: S101 - chosen by the caller
    return f"{test.contrast}, {test.item}: {effect.d:.2f} ({effect.d_low:.2f} to {effect.d_high:.2f})"


def _fill_forest(canvas: "Canvas", tests: list[Comparison]) -> None:
    axes = canvas.subplots()
    place, ticks, labels = 0.0, [], []
    heads: list[tuple[float, str]] = []
    last = None
    for test in tests:
        effect = test.effect
        assert effect is not None  # noqa: S101
        if test.contrast != last:
            heads.append((place, f"Experiment {test.contrast.experiment}: {test.contrast}"))
            place, last = place + 1, test.contrast
        colour = (VERMILION if effect.d < 0 else BLUE) if test.is_found else GREY
        axes.plot([effect.d_low, effect.d_high], [place, place], color=colour, linewidth=1.8, solid_capstyle="butt")
        face = colour if test.is_found else "white"
        axes.plot([effect.d], [place], "o", color=face, markeredgecolor=colour, markersize=5.5)
        ticks.append(place)
        labels.append(test.item)
        place += 1
    axes.axvline(0, color=INK, linewidth=0.7)
    axes.set_yticks(ticks, labels)
    axes.set_ylim(place - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    for at, words in heads:
        across = axes.get_yaxis_transform()
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}  # So that the line at 0 crosses no word.
        axes.text(0.01, at, words, transform=across, va="center", fontsize=7.5, fontweight="bold", bbox=box)
    axes.set_xlabel("d; filled and coloured: a difference is found after Holm's correction")


def distribution_figures(data: StudyData) -> Iterator[Figure]:
    """Draw for each experiment what share of each kind's ratings was what."""
    for experiment in sorted(data.ratings["experiment"].unique()):
        frame = data.ratings[data.ratings["experiment"] == experiment]
        tested = [item for item in data.plan.items.get(experiment, ()) if item in set(frame["item"])]
        if tested:
            yield _distribution(data, experiment, tested)


def _distribution(data: StudyData, experiment: str, items: list[str]) -> Figure:
    shares = {item: _shares(data, experiment, item) for item in items}
    bars = sum(len(table) for table in shares.values())
    told = "; ".join(
        f"{item}, {kind}: {row[row.index[-2:]].sum() * 100:.0f} % of the two highest ratings"
        for item, table in shares.items()
        for kind, row in table.iterrows()
    )
    return Figure(
        f"experiment_{experiment}_distribution",
        f"Experiment {experiment}: what the ratings were",
        f"Stacked bars of ratings by item and kind. {told}.",
        (7.2, 0.8 + 0.2 * bars + 0.32 * len(items)),
        lambda canvas: _fill_distribution(canvas, shares),
    )


def _shares(data: StudyData, experiment: str, item: str) -> pd.DataFrame:
    """Return kinds, in the order of the study, x ratings, from 1 to the item's points."""
    frame = ratings_of(data.ratings, (experiment, item))
    points = range(1, data.points.get((experiment, item), int(frame["rating"].max())) + 1)
    shares = pd.crosstab(frame["kind"], frame["rating"], normalize="index")
    return shares.reindex(index=list(kinds_of(data, experiment, frame["kind"])), columns=points, fill_value=0.0)


def _fill_distribution(canvas: "Canvas", shares: dict[str, pd.DataFrame]) -> None:
    import matplotlib as mpl  # noqa: PLC0415 - loaded by now.

    counts = [len(table) for table in shares.values()]
    panels = canvas.subplots(len(shares), 1, sharex=True, squeeze=False, height_ratios=counts)[:, 0]
    widest = max((table for table in shares.values()), key=lambda table: len(table.columns))
    for (item, table), axes in zip(shares.items(), panels, strict=True):
        colours = mpl.colormaps["cividis_r"].resampled(len(table.columns))
        _stack(axes, table, colours)
        axes.set_title(item, fontsize=8, fontweight="bold")
    panels[-1].xaxis.set_major_formatter(mpl.ticker.PercentFormatter(1.0, decimals=0, symbol=" %"))
    colours = mpl.colormaps["cividis_r"].resampled(len(widest.columns))
    handles = [
        mpl.patches.Patch(color=colours(place), label=str(rating)) for place, rating in enumerate(widest.columns)
    ]
    canvas.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False, title="rating")


def _stack(axes: "Axes", table: pd.DataFrame, colours: Any) -> None:  # noqa: ANN401 - a colour map
    for row, (_, shares) in enumerate(table.iterrows()):
        left = 0.0
        for place, share in enumerate(shares):
            axes.barh(row, share, 0.82, left=left, color=colours(place), edgecolor="white", linewidth=0.5)
            if share >= _LEAST_LABELLED:
                ink = "white" if sum(colours(place)[:3]) < 1.5 else INK  # noqa: PLR2004 - half of the brightest
                words = f"{share * 100:.0f}"
                axes.text(left + share / 2, row, words, ha="center", va="center_baseline", fontsize=6.5, color=ink)
            left += share
    axes.set_yticks(range(len(table)), [str(kind) for kind in table.index])
    axes.set_ylim(len(table) - 0.5, -0.5)
    axes.set_xlim(0, 1)
    axes.tick_params(axis="both", length=0)
    axes.spines[["left", "bottom"]].set_visible(False)
