"""The power curves: a panel for each contrast, a line for each effect, a band for what chance leaves open."""

from collections.abc import Mapping, Sequence
from textwrap import shorten
from typing import Any, cast

import pandas as pd

from webapp.explainer.pictures.figure_style import BLUE, GREEN, GREY, INK, SKY, VERMILION
from webapp.power.settings import PAPER_PARTICIPANTS

COLOURS = (SKY, BLUE, GREEN, VERMILION)
MOST_PANELS = 12
_WIDE = 3
_PANEL = (2.4, 2.5)
_TICKS = (2, 5, 10, 20, 40, 60, 100, 200, 400, 1000, 2000, 4000, 10000)

_SOLID: Mapping[str, Any] = {"linewidth": 1.4}
_DOTTED: Mapping[str, Any] = {"linewidth": 0.9, "linestyle": (0, (1, 1.5))}

_Panel = tuple[str, pd.DataFrame]


def panels(power: pd.DataFrame) -> list[_Panel]:
    """Return title and rows of each panel; of too many contrasts, the one with the least power for each items."""
    contrasts = [(_title(*_names(key)), rows) for key, rows in power.groupby(_CONTRAST, sort=False)]
    if len(contrasts) <= MOST_PANELS:
        return contrasts
    weakest = []
    for key, rows in power.groupby(["experiment", "items"], sort=False):
        means = rows[rows["effect"] > 0].groupby(["first", "second"], sort=False)["power_first_step"].mean()
        first, second = means.idxmin()
        chosen = rows[(rows["first"] == first) & (rows["second"] == second)]
        weakest.append((_title(*_names((*key, first, second))), chosen))
    return weakest[:MOST_PANELS]


def size(power: pd.DataFrame) -> tuple[float, float]:
    """Return width and height in inches."""
    num = len(panels(power))
    rows = -(-num // _WIDE)
    return _PANEL[0] * min(num, _WIDE) + (1.2 if num == 1 else 0.0), _PANEL[1] * rows + 0.7


def fill(canvas: Any, power: pd.DataFrame, wanted: float) -> None:  # noqa: ANN401 - a figure of matplotlib.
    """Draw into an empty figure."""
    shown = panels(power)
    width = min(len(shown), _WIDE)
    axes = canvas.subplots(-(-len(shown) // width), width, sharex=True, sharey=True, squeeze=False).ravel()
    for axis, (title, rows) in zip(axes, shown, strict=False):
        _draw(axis, rows, wanted)
        axis.set_title(title, fontsize=7, pad=11)
    for axis in axes[len(shown) :]:
        axis.set_visible(False)
    for place, axis in enumerate(axes[: len(shown)]):
        if place % width == 0:
            axis.set_ylabel("power")
        if place + width >= len(shown):
            axis.set_xlabel("participants (logarithmic)")
            axis.tick_params(labelbottom=True)
    handles, labels = axes[0].get_legend_handles_labels()
    lines = [axes[0].plot([], [], color=INK, **style)[0] for style in (_SOLID, _DOTTED)]
    names = ["first step of Holm's correction; band: error of simulation", "last step"]
    columns = -(-len(labels) // 2) + 1
    canvas.legend([*handles, *lines], [*labels, *names], loc="outside lower center", ncols=columns, frameon=False)


def _draw(axis: Any, rows: pd.DataFrame, wanted: float) -> None:  # noqa: ANN401 - of matplotlib, which has no types here.
    axis.axhline(wanted, color=INK, linewidth=0.6, linestyle=(0, (4, 3)))
    _mark_paper(axis, rows["participants"])
    effects = list(dict.fromkeys(rows["effect"]))
    for effect, colour in zip(effects, _colours(effects), strict=True):
        curve = rows[rows["effect"] == effect]
        x = curve["participants"]
        axis.fill_between(x, curve["low_first_step"], curve["high_first_step"], color=colour, alpha=0.25, linewidth=0)
        name = f"d = {effect:g}" if effect else "no effect"
        axis.plot(x, curve["power_first_step"], color=colour, label=name, **_SOLID)
        axis.plot(x, curve["power_last_step"], color=colour, **_DOTTED)
    _scale(axis, rows["participants"])


def _mark_paper(axis: Any, participants: pd.Series) -> None:  # noqa: ANN401
    if not participants.min() <= PAPER_PARTICIPANTS <= participants.max():
        return
    axis.axvline(PAPER_PARTICIPANTS, color=INK, linewidth=0.8)
    axis.annotate(
        f"paper: N = {PAPER_PARTICIPANTS}",
        (PAPER_PARTICIPANTS, 1.02),
        xytext=(0, 2),
        textcoords="offset points",
        fontsize=6.5,
        ha="center",
        va="bottom",
    )


def _scale(axis: Any, participants: pd.Series) -> None:  # noqa: ANN401
    from matplotlib.ticker import FixedLocator, NullLocator, PercentFormatter  # noqa: PLC0415 - takes half a second.

    least, most = int(participants.min()), int(participants.max())
    axis.set_xscale("log")
    ticks = [tick for tick in _TICKS if least <= tick <= most]
    axis.xaxis.set_major_locator(FixedLocator(ticks or [least]))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter("{x:.0f}")
    axis.yaxis.set_major_formatter(PercentFormatter(1, symbol=" %"))
    axis.set_yticks([0, 0.2, 0.4, 0.6, 0.8, 1])
    axis.set_ylim(-0.02, 1.02)


def _colours(effects: Sequence[float]) -> list[str]:
    planted = [effect for effect in effects if effect > 0]
    colours = {effect: COLOURS[place % len(COLOURS)] for place, effect in enumerate(planted)}
    return [colours.get(effect, GREY) for effect in effects]


def _names(key: object) -> tuple[str, str, str, str]:
    experiment, items, first, second = map(str, cast("tuple[object, ...]", key))
    return experiment, items, first, second


def _title(experiment: str, items: str, first: str, second: str) -> str:
    contrast = f"{first} \N{MINUS SIGN} {second}"
    return f"experiment {experiment}\n{shorten(contrast, 44)}\n{shorten(items.replace(' ', ', '), 44)}"


_CONTRAST = ["experiment", "items", "first", "second"]
