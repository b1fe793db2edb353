"""The tables of a data set: which columns each has to have, and their cells from text to values."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import pandas as pd

from webapp.reports.read_faults import Faults
from webapp.reports.read_text import RawTable
from webapp.storage import export_columns
from webapp.storage.variables import Variable
from webapp.study.suggestions import nearest

_TRIAL = ("experiment", "trial")


@dataclass(frozen=True, slots=True)
class Form:
    """What a table has to be like.

    Attributes:
        variables: Its columns as the data dictionary describes them; others are left out.
        needed: The columns that have to be there, besides `filled`; the remaining ones are empty if they are not.
        filled: The columns that have to be there and have no empty cell.
        key: The columns in which no two rows are alike, besides those that say whose data they are; empty for none.
    """

    variables: tuple[Variable, ...]
    needed: tuple[str, ...]
    filled: tuple[str, ...]
    key: tuple[str, ...] = ()


FORMS: Mapping[str, Form] = {
    "ratings": Form(
        export_columns.RATINGS,
        (),
        ("participant", *_TRIAL, "layout", "kind", "item", "rating"),
        ("participant", *_TRIAL, "item"),
    ),
    "participants": Form(export_columns.PARTICIPANTS, ("completed_at",), ("participant",), ("participant",)),
    "answers": Form(
        export_columns.ANSWERS,
        ("answer",),
        ("participant", "purpose", "question"),
        ("participant", *_TRIAL, "purpose", "question", "attempt"),
    ),
    "probes": Form(
        export_columns.PROBES,
        (),
        ("participant", *_TRIAL, "layout", "kind", "question", "is_correct", "confidence"),
        ("participant", *_TRIAL, "question"),
    ),
    "drives": Form(
        export_columns.DRIVES,
        (*_TRIAL, "layout", "kind"),
        ("participant", "phase", "end", "num_steps", "optimum", "step_limit"),
        ("participant", *_TRIAL, "phase"),
    ),
    "allocation": Form(
        export_columns.ALLOCATION,
        ("participant",),
        ("record", "experiment", "arrangement", "layout_order"),
        ("record", "experiment"),
    ),
    "decisions": Form(
        export_columns.DECISIONS, ("page", "file", "question", "from", "to"), ("participant", "action"), ()
    ),
    "quality": Form(export_columns.QUALITY, (), ("participant", "rule", "flagged"), ("participant", "rule")),
}
"""The tables that are read, by name. `events` and `wide` hold nothing that the analysis needs beyond these."""

_OPEN_LEVELS = frozenset({"kind"})
"""Texts whose described values are not all there can be: a study may declare kinds of its own."""

_MORE_WISHES = {"rating": ", the lowest answer of every scale"}
"""What is said of some columns beside the bounds of their numbers."""

_TIME = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d{1,6})?)?(Z|[+-]\d\d:?\d\d)", re.ASCII)
_DTYPES = {"text": "str", "integer": "Int64", "number": "float64", "boolean": "boolean", "time": "datetime64[us, UTC]"}
_FILLED_DTYPES = {"integer": "int64", "boolean": "bool"}


def convert(form: Form, faults: Faults) -> pd.DataFrame:
    """Return a table's columns with values in place of texts; what cannot be converted is noted as a fault.

    Returns:
        Every column of the form, in its order; those that are not there are empty. Complete only without faults.
    """
    cells = faults.table.cells
    _note_missing(form, faults)
    columns: dict[str, pd.Series] = {}
    for variable in form.variables:
        if variable.name in cells.columns:
            # Whoever says of some rows who took part says it of all.
            is_filled = variable.name in form.filled or variable.name == "mode"
            columns[variable.name] = _converted(variable, faults, is_filled=is_filled)
        else:
            empty = pd.Series([None] * len(cells), dtype=_DTYPES[variable.type])
            columns[variable.name] = empty
    return pd.DataFrame(columns)


def extra_columns(form: Form, table: RawTable) -> list[str]:
    """Return the columns of a table that the data dictionary does not name."""
    known = {variable.name for variable in form.variables}
    return [name for name in table.cells.columns if name not in known]


def _note_missing(form: Form, faults: Faults) -> None:
    there = list(faults.table.cells.columns)
    known = {variable.name for variable in form.variables}
    for name in (*form.filled, *form.needed):
        if name not in there:
            near = nearest(name, [column for column in there if column not in known])
            meant = "" if near is None else f", but {near!r}; did you mean that one?"
            faults.of_table(f"has no column {name!r}{meant or '; add it'}")


def _converted(variable: Variable, faults: Faults, *, is_filled: bool) -> pd.Series:
    """Convert a column. Each of its different texts is converted once."""
    parse, wish = _reader(variable)
    codes, texts = pd.factorize(faults.table.cells[variable.name])
    values: list[object] = []
    wrong: list[int] = []
    for code, text in enumerate(texts):
        value = None if text == "" else parse(text)
        values.append(value)
        if value is None and (text != "" or is_filled):
            wrong.append(code)
    if wrong:
        faults.of_cells(pd.Series(codes).isin(wrong).to_numpy().nonzero()[0].tolist(), variable.name, wish)
    by_code = pd.Series(values, dtype=_DTYPES[variable.type])
    column = by_code.take(codes).reset_index(drop=True)
    return column.astype(_FILLED_DTYPES.get(variable.type, column.dtype)) if is_filled and not wrong else column


def _reader(variable: Variable) -> tuple[Callable[[str], object], str]:
    """Return what makes a value of a text, or None of a wrong one, and what to ask for."""
    match variable.type:
        case "integer":
            parse, wish = _integers(variable.minimum, variable.maximum)
            return parse, f"{wish}{_MORE_WISHES.get(variable.name, '')}"
        case "number":
            return _number, "use a number with a point, such as 0.5"
        case "boolean":
            return {"true": True, "false": False}.get, "use true or false"
        case "time":
            return _time, "use a time in UTC such as 2031-03-01T09:30:00.000017Z"
        case _:
            if variable.levels and variable.name not in _OPEN_LEVELS:
                *most, last = variable.levels
                wish = f"use {', '.join(most)} or {last}"
                return lambda text: text if text in variable.levels else None, wish
            return lambda text: text, "write something"


def _integers(minimum: int | None, maximum: int | None) -> tuple[Callable[[str], int | None], str]:
    least, most = -math.inf if minimum is None else minimum, math.inf if maximum is None else maximum
    bounds = {
        (True, True): "",
        (False, True): f" from {minimum}",
        (True, False): f" up to {maximum}",
        (False, False): f" from {minimum} to {maximum}",
    }[minimum is None, maximum is None]

    def integer(text: str) -> int | None:
        # Whole numbers come with a point from programs that hold a column with gaps as decimals.
        if not (found := re.fullmatch(r"(-?[0-9]{1,18})(\.0{1,18})?", text)):
            return None
        return value if least <= (value := int(found[1])) <= most else None

    return integer, f"use a whole number{bounds}"


def _number(text: str) -> float | None:
    return float(text) if re.fullmatch(r"-?[0-9]{1,30}(\.[0-9]{1,30})?([eE][+-]?[0-9]{1,2})?", text) else None


def _time(text: str) -> datetime | None:
    if not _TIME.fullmatch(text):
        return None
    try:
        return datetime.fromisoformat(text).astimezone(UTC)
    except (ValueError, OverflowError):
        return None
