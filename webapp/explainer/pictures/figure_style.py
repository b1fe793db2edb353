"""How figures with numbers look, and that the same numbers give the same bytes.

Colours are Okabe and Ito's, which people with any colour vision tell apart. Matplotlib is loaded only to draw.
"""

import atexit
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
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
    _give_matplotlib_a_home()
    import matplotlib as mpl  # noqa: PLC0415 - takes half a second to load.
    from matplotlib.figure import Figure  # noqa: PLC0415 - the same.

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({**STYLE, "svg.hashsalt": name})
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        fill(figure)
        return encoded(figure, suffix, DPI)


def _give_matplotlib_a_home() -> None:
    """Let matplotlib keep its files in a temporary folder where its own cannot be written, as in many containers.

    It would do so by itself, but say so on standard error each time.
    """
    if os.environ.get("MPLCONFIGDIR") or "matplotlib" in sys.modules:
        return
    try:
        for folder in _homes_of_matplotlib():
            folder.mkdir(parents=True, exist_ok=True)
            if not os.access(folder, os.W_OK):
                raise PermissionError
    except (OSError, RuntimeError):  # The latter where there is no home at all.
        folder = Path(tempfile.mkdtemp(prefix="xar-matplotlib-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        os.environ["MPLCONFIGDIR"] = str(folder)


def _homes_of_matplotlib() -> Iterator[Path]:
    """Yield the folders that matplotlib makes: for settings, and for what it keeps of fonts."""
    if sys.platform.startswith(("linux", "freebsd")):
        for variable, name in (("XDG_CONFIG_HOME", ".config"), ("XDG_CACHE_HOME", ".cache")):
            yield Path(os.environ.get(variable) or Path.home() / name) / "matplotlib"
    else:
        yield Path.home() / ".matplotlib"
