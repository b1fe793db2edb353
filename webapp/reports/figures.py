"""The figures of a report as files: SVG and PNG, the same bytes for the same numbers."""

import base64

from webapp.explainer.pictures.figure_style import drawn
from webapp.reports.blocks import Drawing, Figure


def files_of(figure: Figure | Drawing) -> dict[str, bytes]:
    """Return a figure's files by suffix; what is SVG already has no PNG."""
    if isinstance(figure, Drawing):
        return {".svg": figure.svg.encode()}
    return {suffix: drawn(figure.fill, figure.size, suffix, figure.name) for suffix in (".svg", ".png")}


def as_address(svg: bytes) -> str:
    """Return an SVG as an address that holds all of it, for a page that loads nothing.

    As an image a figure keeps its styles and the names inside it to itself, and prints as sharp as it is drawn.
    """
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode('ascii')}"
