"""The data as analysts read them: with pandas, with the types that the description gives."""

import json
from pathlib import Path

import pandas as pd

from webapp.storage.variables import Type, Variable

_DTYPES = {"Text": "string", "Integer": "Int64", "Number": "Float64", "Boolean": "boolean", "DateTime": "string"}
_NAMES: dict[Type, str] = {
    "text": "Text",
    "integer": "Integer",
    "number": "Number",
    "boolean": "Boolean",
    "time": "DateTime",
}


def read_described(path: Path) -> pd.DataFrame:
    """Read a table of a data set by the description beside it."""
    described = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))["variableMeasured"]
    return _read(path, {one["name"]: one["additionalType"].removeprefix("https://schema.org/") for one in described})


def read_variables(path: Path, variables: tuple[Variable, ...]) -> pd.DataFrame:
    """Read a table whose columns are known."""
    return _read(path, {variable.name: _NAMES[variable.type] for variable in variables})


def _read(path: Path, types: dict[str, str]) -> pd.DataFrame:
    dtypes = {name: _DTYPES[kind] for name, kind in types.items()}
    frame = pd.read_csv(path, dtype=dtypes, keep_default_na=False, na_values=[""])
    for name in (name for name, kind in types.items() if kind == "DateTime"):
        frame[name] = pd.to_datetime(frame[name], format="ISO8601", utc=True)
    return frame
