"""How figures with numbers look, and that the same numbers give the same bytes.

Colours are Okabe and Ito's, which people with any colour vision tell apart. Matplotlib is loaded only to draw.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from webapp.explainer.pictures.figure_files import encoded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VERMILION, BLUE, SKY, GREEN = "#D55E00", "#0072B2", "#56B4E9", "#009E73"
BLACK, GREY, INK = "#000000", "#8C8C8C", "#404040"
DPI = 200

STYLE: Mapping[Any, Any] = {
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9,
    "font.family": "DejaVu Sans",  # It comes with matplotlib, so that every machine draws the same.
    "font.size": 8,
    "legend.fontsize": 8,
    "text.color": INK,
    "xtick.color": INK,
    "xtick.labelsize": 7,
    "ytick.color": INK,
    "ytick.labelsize": 7,
}


def drawn(fill: Callable[["Figure"], None], size: tuple[float, float], suffix: str, name: str) -> bytes:
    """Return a figure as the content of a file, in this style whatever style the caller has set.

    Args:
        fill: Draws into the empty figure.
        size: Width and height in inches.
        suffix: `.svg` or `.png`.
        name: Of the figure; names inside an SVG are derived from it.
    """
    import matplotlib as mpl  # noqa: PLC0415 - takes half a second to load.
    from matplotlib.figure import Figure  # noqa: PLC0415 - the same.

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({**STYLE, "svg.hashsalt": name})
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        fill(figure)
        return encoded(figure, suffix, DPI)
