"""Figures as files: which names a picture may have, and the same bytes for the same figure."""

from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_METADATA: Mapping[str, Mapping[str, str | None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
}
"""By suffix: what matplotlib would write of itself and the time, so that the same figure gives the same bytes."""


def check_new_picture(path: Path) -> None:
    """Refuse a name under which no picture can be written, before the work for it begins.

    Raises:
        ValueError: The name has another suffix than `.png` or `.svg`, its folder is missing, or there is such a file.
    """
    if path.suffix.lower() not in _METADATA:
        raise ValueError(f"a picture is a {' or '.join(_METADATA)} file, and {str(path)!r} is neither")
    if not path.parent.is_dir():
        raise ValueError(f"there is no folder {str(path.parent)!r} for the picture; make it first")
    if path.exists():
        raise ValueError(f"{str(path)!r} exists already; remove it or choose another name")


def write_new_picture(path: Path, draw: Callable[[str], bytes]) -> None:
    """Write a picture into a file that is not there yet.

    Args:
        path: A name that ends in `.png` or `.svg`.
        draw: Draws the picture in the format of a suffix, `.png` or `.svg`.

    Raises:
        ValueError: As in `check_new_picture`.
        OSError: The file cannot be written.
    """
    check_new_picture(path)
    drawing = draw(path.suffix.lower())
    try:
        with path.open("xb") as file:
            file.write(drawing)
    except FileExistsError as error:
        raise ValueError(f"{str(path)!r} exists already; remove it or choose another name") from error


def encoded(figure: "Figure", suffix: str, dots_per_inch: int) -> bytes:
    """Return a figure in the format of a suffix, `.png` or `.svg`, without a word on when and by what it was drawn."""
    drawing = BytesIO()
    figure.savefig(drawing, format=suffix[1:], dpi=dots_per_inch, metadata=dict(_METADATA[suffix]))
    return drawing.getvalue()
