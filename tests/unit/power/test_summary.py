import pandas as pd
import pytest

from webapp.power.settings import PowerSettings
from webapp.power.summary import required_cells

SETTINGS = PowerSettings(participants=(20, 40, 60))


@pytest.mark.parametrize(
    ("participants", "low", "high", "is_smallest", "told"),
    [
        (43, 24, None, False, "43 (24 to more than 60)"),
        (43, 24, 51, False, "43 (24 to 51)"),
        (43, 43, 43, False, "43"),
        (20, 20, None, True, "at most 20 (up to more than 60)"),
        (20, 20, 31, True, "at most 20 (up to 31)"),
        (20, 20, 20, True, "at most 20"),
        (None, 50, None, False, "more than 60"),
    ],
)
def test_a_required_number_is_told_in_words(
    participants: int | None, low: int, high: int | None, is_smallest: bool, told: str
) -> None:
    row = {"experiment": "1", "items": "general", "first": "a", "second": "b", "effect": 0.5}
    row |= {"participants": participants, "low": low, "high": high, "is_smallest": is_smallest}
    table = pd.DataFrame([row | {"step": step} for step in ("first_step", "last_step")])
    table = table.astype(dict.fromkeys(("participants", "low", "high"), "Int64"))
    assert required_cells(table, SETTINGS) == [("1", "general", "a \N{MINUS SIGN} b", "0.5", told, told)]
