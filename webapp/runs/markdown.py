"""Markdown tables that read well as plain text too."""

import unicodedata
from collections.abc import Sequence


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    r"""Return a Markdown table whose columns line up in a fixed-width font, ending with a newline.

    A vertical bar in a cell is escaped and a line break becomes a space, so that no cell can end its column or row.

    Args:
        headings: One for each column.
        rows: Cells, as many in each row as there are headings.

    Raises:
        ValueError: There is no column, or a row has another number of cells than there are headings.

    Example:
        >>> print(table(["step", "action"], [["7", "pickup"], ["14", "toggle"]]), end="")
        | step | action |
        | ---- | ------ |
        | 7    | pickup |
        | 14   | toggle |
    """
    if not headings:
        raise ValueError("a table needs at least one heading, and there is none")
    for row in rows:
        if len(row) != len(headings):
            raise ValueError(f"{len(headings)} headings need rows of as many cells, not {list(row)}")
    cells = [[_one_line(cell) for cell in row] for row in (headings, *rows)]
    # A rule shorter than three hyphens is not recognised as a table by every reader of Markdown.
    widths = [max(3, *(_width(row[column]) for row in cells)) for column in range(len(headings))]
    rule = ["-" * width for width in widths]
    return "".join(_line(row, widths) for row in (cells[0], rule, *cells[1:]))


def _one_line(cell: str) -> str:
    return " ".join(cell.split()).replace("|", r"\|")


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    padded = (cell + " " * (width - _width(cell)) for cell, width in zip(row, widths, strict=True))
    return f"| {' | '.join(padded)} |\n"


def _width(text: str) -> int:
    """Return how many columns a terminal takes for a text: wide East Asian characters two, combining ones none."""
    return sum(
        0 if unicodedata.combining(letter) else 1 + (unicodedata.east_asian_width(letter) in "WF") for letter in text
    )
