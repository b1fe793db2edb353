"""Figures of the learning experiments: every run a dot, interquartile means with intervals, censored runs apart."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from webapp.analysis.censoring import kaplan_meier
from webapp.explainer.pictures.figure_style import BLACK, BLUE, GREEN, GREY, INK, SKY, VERMILION, drawn
from webapp.simulations.claims import sample_of
from webapp.simulations.conditions import Condition
from webapp.simulations.settings import SweepSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {
    "none": BLACK,
    "derived": VERMILION,
    "derived again": VERMILION,
    "random, some shared": BLUE,
    "random, none shared": SKY,
    "rival": GREEN,
    "useless": GREY,
    "main": BLUE,
    "other": GREY,
}
_VARIANTS = {"repeatable": "paid whenever executed", "once": "paid once per episode"}
_WIDTH, _ROW, _MARGINS = 7.4, 0.23, 1.5
_SPREAD = 0.56
"""How much of a row its dots are spread over."""


def usefulness_figure(summary: pd.DataFrame, rows: pd.DataFrame, settings: SweepSettings, suffix: str) -> bytes:
    """Draw one row per condition and one panel per variant; the group without sub-rewards stands in each.

    Args:
        summary: One row per condition, as `learning_report.described` returns them.
        rows: Of all runs.
        settings: Of the sweep.
        suffix: `.svg` or `.png`.
    """
    num_rows = len(summary[summary["variant"].isin(["none", settings.variants[0]])])
    fill: Callable[[Figure], None] = lambda figure: _fill_usefulness(figure, summary, rows, settings)
    return drawn(fill, (_WIDTH, _MARGINS + _ROW * num_rows), suffix, "usefulness")


def count_figure(summary: pd.DataFrame, rows: pd.DataFrame, settings: SweepSettings, suffix: str) -> bytes:
    """Draw episodes over the number of subgoals, one panel per variant; arguments as in `usefulness_figure`."""
    fill: Callable[[Figure], None] = lambda figure: _fill_count(figure, summary, rows, settings)
    return drawn(fill, (_WIDTH, 3.6), suffix, "count")


def learned_figure(groups: Sequence[Condition], rows: pd.DataFrame, settings: SweepSettings, suffix: str) -> bytes:
    """Draw the share of agents that have learned the path over episodes (Kaplan and Meier 1958).

    Args:
        groups: The conditions.
        rows: Of all runs.
        settings: Of the sweep.
        suffix: `.svg` or `.png`.
    """
    fill: Callable[[Figure], None] = lambda figure: _fill_learned(figure, groups, rows, settings)
    return drawn(fill, (_WIDTH, 3.6), suffix, "learned")


def _panels(figure: "Figure", settings: SweepSettings) -> list[tuple[str, "Axes"]]:
    axes = figure.subplots(1, len(settings.variants), sharey=True, squeeze=False)[0]
    for variant, panel in zip(settings.variants, axes, strict=True):
        panel.set_title(_VARIANTS[variant], fontweight="bold")
    return list(zip(settings.variants, axes, strict=True))


def _own(summary: pd.DataFrame, variant: str) -> list[Any]:
    return list(summary[summary["variant"].isin(["none", variant])].itertuples())


def _fill_usefulness(figure: "Figure", summary: pd.DataFrame, rows: pd.DataFrame, settings: SweepSettings) -> None:
    budget = settings.fresh.max_episodes
    for variant, axes in _panels(figure, settings):
        groups = _own(summary, variant)
        for place, group in enumerate(groups):
            runs = _runs(rows, group)
            _dots(axes, runs[runs["is_optimal"] == 1], place + _offsets(len(runs)), _COLOURS[group.kind], across=True)
            _middle(axes, group, place, across=True)
            _note_censored(axes, group, place, budget)
        axes.axvline(budget, color=INK, linewidth=0.6, linestyle=(0, (4, 3)))
        axes.set(xlim=(0, budget * (1 + _NOTE_SHARE)), ylim=(len(groups) - 0.5, -0.5))
        axes.set_xticks([tick for tick in axes.get_xticks() if tick <= budget])
        axes.set_xlabel("episodes until the path was learned")
        axes.tick_params(axis="y", length=0)
    first, groups = figure.axes[0], _own(summary, settings.variants[0])
    first.set_yticks(range(len(groups)), [_label(group) for group in groups])
    for tick, group in zip(first.get_yticklabels(), groups, strict=True):
        tick.set_color(_COLOURS[group.kind])
    _legend(figure, circles=bool((summary["keeps_optimum"] == 0).any()))


def _middle(axes: "Axes", group: Any, place: float, *, across: bool, colour: str = INK) -> None:  # noqa: ANN401 - a row.
    """Draw the interquartile mean with its interval; hollow if censored runs are in it."""
    ends, places = [group.iqm_low, group.iqm_high], [place, place]
    axes.plot(*((ends, places) if across else (places, ends)), color=colour, linewidth=1.6, zorder=4)
    face, edge = ("white", colour) if group.iqm_is_lower_bound else (colour, "white")
    at = ([group.iqm], [place]) if across else ([place], [group.iqm])
    axes.plot(*at, "D", color=face, markeredgecolor=edge, markersize=5, zorder=5)


def _note_censored(axes: "Axes", group: Any, place: float, budget: int) -> None:  # noqa: ANN401 - a row of a table.
    """Write behind the budget how many runs did not learn, and whether circles are to blame."""
    circle = "" if group.keeps_optimum else _CIRCLE
    if group.censored or circle:
        told = f"{group.censored} of {group.runs}{circle}"
        axes.text(budget * 1.03, place, told, ha="left", va="center", fontsize=7, color=_COLOURS[group.kind])


def _label(group: Any) -> str:  # noqa: ANN401 - a row of a table.
    return (
        group.condition
        if group.kind in {"none", "useless"} or group.condition.startswith("random")
        else (f"{group.condition} ({group.steps})")
    )


def _runs(rows: pd.DataFrame, group: Any) -> pd.DataFrame:  # noqa: ANN401 - a row of a table.
    own = rows[(rows["condition"] == group.condition) & (rows["variant"] == group.variant)]
    return own.sort_values("number")


def _offsets(count: int) -> NDArray[np.float64]:
    """Spread dots evenly, neighbours in the file far apart, the same way every time."""
    order = np.argsort((np.arange(count) * _GOLDEN) % 1.0, kind="stable")
    places = np.empty(count)
    places[order] = np.arange(count)
    return (places / max(count - 1, 1) - 0.5) * _SPREAD


def _dots(axes: "Axes", runs: pd.DataFrame, places: NDArray[np.float64], colour: str, *, across: bool) -> None:
    """Draw learned runs as dots and censored ones as open triangles; `across` where episodes run to the right."""
    for number, episodes, is_optimal in zip(runs["number"], runs["episodes"], runs["is_optimal"], strict=True):
        at = (episodes, places[number]) if across else (places[number], episodes)
        face, marker = (colour, "o") if is_optimal else ("white", "^")
        axes.plot(*at, marker, color=face, markeredgecolor=colour, markersize=3.3, markeredgewidth=0.8, alpha=0.8)


def _fill_count(figure: "Figure", summary: pd.DataFrame, rows: pd.DataFrame, settings: SweepSettings) -> None:
    budget = settings.fresh.max_episodes
    for variant, axes in _panels(figure, settings):
        groups = _own(summary, variant)
        main = [group for group in groups if group.kind != "other"]
        for count, group in enumerate(main):
            runs = _runs(rows, group)
            _dots(axes, runs, count + _offsets(len(runs)), _COLOURS[group.kind if count else "none"], across=False)
            _middle(axes, group, count, across=False)
        axes.plot(range(len(main)), [group.iqm for group in main], color=INK, linewidth=0.8, zorder=3)
        others = [group for group in groups if group.kind == "other"]
        for group in others:
            place = len(group.steps.split()) + _BESIDE
            _middle(axes, group, place, across=False, colour=GREY)
            axes.text(place + 0.12, group.iqm, group.steps, color=INK, fontsize=7, ha="left", va="center")
        axes.axhline(budget, color=INK, linewidth=0.6, linestyle=(0, (4, 3)))
        axes.set_xticks(range(len(main)), [f"{count}\n{_told(group)}" for count, group in enumerate(main)])
        axes.set(xlim=(-0.5, len(main) - 0.3), ylim=(0, budget * 1.05), xlabel="subgoals, and which steps they are")
    figure.axes[0].set_ylabel("episodes until the path was learned")
    _legend(figure, circles=False)


def _told(group: Any) -> str:  # noqa: ANN401 - a row of a table.
    """The steps, three in a line so that they fit below their number."""
    steps = group.steps.split() if group.variant != "none" else []
    return "\n".join(" ".join(steps[start : start + 3]) for start in range(0, len(steps), 3))


def _fill_learned(figure: "Figure", groups: Sequence[Condition], rows: pd.DataFrame, settings: SweepSettings) -> None:
    for variant, axes in _panels(figure, settings):
        own = [group for group in groups if group.variant in {"none", variant}]
        for group, (label, colour, width) in zip(own, _lines(own), strict=True):
            times, shares = kaplan_meier(sample_of(group, rows))
            until, learned = np.append(times, settings.fresh.max_episodes), 1 - np.append(shares, shares[-1])
            axes.step(until, learned, where="post", color=colour, linewidth=width, label=label)
        axes.set(xlim=(0, settings.fresh.max_episodes), ylim=(0, 1.02), xlabel="episodes")
        axes.set_yticks([0, 0.5, 1], ["0 %", "50 %", "100 %"])
    figure.axes[0].set_ylabel("agents that have learned the path")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)


def _lines(groups: Sequence[Condition]) -> list[tuple[str | None, str, float]]:
    """Return label, colour and width of each group's line: a label per kind, or per group where they are counts."""
    if any(group.kind == "main" for group in groups):
        return [(group.name, shade, 1.4) for group, shade in zip(groups, _shades(len(groups)), strict=True)]
    lines: list[tuple[str | None, str, float]] = []
    for number, group in enumerate(groups):
        is_first = group.kind not in {other.kind for other in groups[:number]} and group.kind != "derived again"
        label = {"none": "no sub-reward", "useless": "behind the start"}.get(group.kind, group.kind)
        lines.append((label if is_first else None, _COLOURS[group.kind], 1.8 if group.kind in _BOLD else 0.9))
    return lines


def _shades(count: int) -> list[str]:
    """Return colours from dark to light, in an order that survives a print in grey."""
    from matplotlib import colormaps, colors  # noqa: PLC0415 - loaded by now.

    return [colors.to_hex(colormaps["viridis"](0.95 * number / max(count - 1, 1))) for number in range(count)]


def _legend(figure: "Figure", *, circles: bool) -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - loaded by now.

    handles = [
        Line2D([], [], linestyle="none", marker="o", color=INK, markersize=3.3, label="one agent"),
        Line2D([], [], marker="D", markersize=5, color=INK, label="interquartile mean, 95 % interval"),
        Line2D([], [], marker="D", markersize=5, color=INK, markerfacecolor="white", label="the same, at least"),
    ]
    if circles:
        handles.append(
            Line2D([], [], linestyle="none", label=f"n of N: did not learn;{_CIRCLE}: the path is not optimal")
        )
    num_columns = 2 if circles else len(handles)  # Four would be wider than the page.
    figure.legend(handles=handles, loc="outside lower center", ncols=num_columns, frameon=False, handlelength=1.4)


_GOLDEN = 0.6180339887498949
"""Multiples of it, modulo 1, lie nowhere close together."""
_BOLD = frozenset({"derived", "none"})
_CIRCLE = " ○"
_NOTE_SHARE = 0.24
"""The room behind the budget, as a share of it."""
_BESIDE = 0.3
"""How far beside the main line another choice of as many subgoals stands."""
