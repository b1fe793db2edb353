"""The numbers that R found, and the data that it was given."""

import json
from pathlib import Path
from typing import Any

import pandas as pd

FOLDER = Path(__file__).parents[2] / "golden" / "analysis"
DATA_SETS = ("mild", "strong")
AGREEMENT = 1e-6
"""Relative."""


def numbers(data_set: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((FOLDER / "anova.json").read_text())[data_set]
    return found


def rows(data_set: str) -> pd.DataFrame:
    read = pd.read_csv(FOLDER / "anova.csv")
    return read[read["data"] == data_set].reset_index(drop=True)
