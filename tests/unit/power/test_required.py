import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.power.required import Required, never_falling, required, required_samples, required_table
from webapp.power.settings import PowerSettings

GRID = (10, 20, 40, 80)
SHARES = st.lists(st.floats(0, 1), min_size=4, max_size=4)


@given(SHARES)
def test_a_curve_that_never_falls_is_the_nearest_such_one(shares: list[float]) -> None:
    fitted = never_falling(shares)
    assert np.all(np.diff(fitted) >= -1e-12)
    # Of all sequences that never fall on a fine lattice, by dynamic programming, none is nearer.
    lattice = np.linspace(0, 1, 201)
    best = np.zeros(len(lattice))
    for share in shares:
        best = np.minimum.accumulate(best) + (lattice - share) ** 2
    assert ((fitted - shares) ** 2).sum() <= best.min() + 1e-9


@given(st.floats(0.01, 0.99))
def test_the_required_number_of_a_straight_line_is_where_it_crosses(wanted: float) -> None:
    line = [number / 80 for number in GRID]
    found = required(GRID, line, line, line, wanted)
    assert found.participants == max(10, int(np.ceil(80 * wanted - 1e-6)))


@given(SHARES, st.floats(0.05, 0.95), st.floats(0, 0.2))
def test_more_power_never_needs_more_participants(shares: list[float], wanted: float, error: float) -> None:
    low, high = (np.clip(np.add(shares, change), 0, 1) for change in (-error, error))
    found = required(GRID, shares, low, high, wanted)
    numbers = [np.inf if number is None else number for number in (found.low, found.participants, found.high)]
    assert numbers == sorted(numbers)


def test_too_little_power_everywhere_needs_more_than_was_tried() -> None:
    flat = [0.1, 0.2, 0.3, 0.4]
    assert required(GRID, flat, flat, [0.1, 0.2, 0.3, 0.9], 0.8) == Required(None, 74, None, is_smallest=False)


def test_enough_power_at_the_smallest_number_says_that_fewer_may_do() -> None:
    steep = [0.9, 0.95, 1, 1]
    assert required(GRID, steep, steep, steep, 0.8) == Required(10, 10, 10, is_smallest=True)


def a_power_table(second_kind_power: float) -> pd.DataFrame:
    rows = [
        {"experiment": "1", "items": "general", "first": "a", "second": second, "effect": 0.5, "participants": number}
        | {f"{part}_{step}": share for part in ("power", "low", "high") for step in ("first_step", "last_step")}
        for second, shares in (("b", [0.2, 0.9]), ("c", [0.2, second_kind_power]))
        for number, share in zip((10, 20), shares, strict=True)
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize(("power", "participants"), [(0.9, 19), (0.8, 20), (0.7, None)])
def test_what_a_study_needs_is_what_its_weakest_contrast_needs(power: float, participants: int | None) -> None:
    settings = PowerSettings(effects=(0.5,), participants=(10, 20))
    found = required_samples(required_table(a_power_table(power), settings.power), settings)
    assert [sample.participants for sample in found.samples] == [participants]
    assert found.most_participants == 20
