"""How one value of a table is shown to a reader: few digits, real minus signs, and no p-value that is 0."""

import math

import numpy as np

from webapp.reports.blocks import Cell, Column, ColumnKind

NOTHING = "\N{EN DASH}"
"""What an empty cell shows."""

MINUS = "\N{MINUS SIGN}"
_UNBROKEN = "\N{NO-BREAK SPACE}"
_LEAST_P, _MOST_P = 0.001, 0.999


def plain(cell: Cell) -> Cell:
    """Return a cell as plain Python's, whatever computed it; what is no number there is an empty cell."""
    value: Cell = cell.item() if isinstance(cell, np.generic) else cell
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


def shown(cell: Cell, column: Column) -> str:
    """Return what a reader sees of a cell."""
    value = plain(cell)
    if value is None:
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    return number(value, column.kind, column.digits)


def number(value: float, kind: ColumnKind = "number", digits: int = 2) -> str:
    """Return a number as a column of that kind shows it.

    Args:
        value: No NaN.
        kind: Of the column.
        digits: After the decimal point, for `number` and `percent`.
    """
    if math.isinf(value):
        return f"{MINUS if value < 0 else ''}\N{INFINITY}"
    if kind == "p":
        return p_value(value)
    if kind == "percent":
        return f"{_fixed(100 * value, digits)}{_UNBROKEN}%"
    if kind == "number":
        return _fixed(value, digits)
    return f"{value:,}".replace("-", MINUS)


def p_value(value: float) -> str:
    """Return a p-value without the zero before the point: `.012`, `< .001`, `> .999`."""
    if value < _LEAST_P:
        return f"<{_UNBROKEN}.001"
    if value > _MOST_P:
        return f">{_UNBROKEN}.999"
    return f"{value:.3f}".removeprefix("0")


def p_clause(value: float, name: str = "p") -> str:
    """Return a p-value within a sentence: `p = .012`, `p < .001`."""
    told = p_value(value)
    return f"{name}{_UNBROKEN}{told if told[0] in '<>' else f'={_UNBROKEN}{told}'}"


def counted(count: int, one: str, many: str = "") -> str:
    """Return a count with its noun: `1 rating`, `1,200 ratings`."""
    return f"{count:,} {one if count == 1 else many or one + 's'}"


def listed(words: list[str], join: str = "and") -> str:
    """Return words as a sentence lists them: `a, b and c`."""
    return f" {join} ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def _fixed(value: float, digits: int) -> str:
    told = f"{value:.{digits}f}"
    if float(told) == 0:
        told = told.removeprefix("-")
    return told.replace("-", MINUS)
