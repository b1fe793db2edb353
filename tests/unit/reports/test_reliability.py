import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.reports.measured import by_chance, check_sound, data_of, statements, table
from tests.unit.reports.test_robustness import ROWS
from webapp.analysis.reliability import cronbach_alpha, mcdonald_omega
from webapp.reports.sections.reliability import section
from webapp.study.experiments import SATISFACTION_ITEMS


def test_a_scale_is_judged_for_each_kind_and_for_peoples_means() -> None:
    data = by_chance(scale=True)
    found = {row["kind"]: row for row in table(section(data), "reliability")}
    assert list(found) == ["full", "none", "subgoals", "all kinds"]
    rows = data.ratings[data.ratings["item"].isin(SATISFACTION_ITEMS)]
    of_kind = rows[rows["kind"] == "full"].pivot_table("rating", "participant", "item").to_numpy(dtype=float)
    assert found["full"]["alpha"] == pytest.approx(cronbach_alpha(of_kind).value)
    assert found["full"]["omega"] == pytest.approx(mcdonald_omega(of_kind).value)
    assert found["full"]["people"] == 40
    for row in found.values():
        for name in ("omega", "mean_correlation"):
            low, value, high = (float(str(row[each])) for each in (f"{name}_low", name, f"{name}_high"))
            assert low < value < high
    means = rows.pivot_table("rating", "participant", "item").to_numpy(dtype=float)
    assert found["all kinds"]["alpha"] == pytest.approx(cronbach_alpha(means).value)


def test_single_items_are_said_to_be_no_scale_and_correlated_for_information() -> None:
    data = by_chance()
    made = section(data)
    (told,) = statements(made)
    assert "experiment 1 has foresee and general, each an item of its own" in told
    (row,) = table(made, "reliability_items")
    means = data.ratings.pivot_table("rating", "participant", "item")
    assert row["between"] == pytest.approx(float(np.corrcoef(means["foresee"], means["general"])[0, 1]))


def test_whoever_left_an_item_out_is_not_in_the_row() -> None:
    data = by_chance(scale=True)
    left_out = (data.ratings["participant"] == "p0003") & (data.ratings["item"] == "satisfaction_4")
    changed = data_of(
        [
            tuple(row)
            for row in data.ratings[~left_out][["participant", "trial", "layout", "kind", "item", "rating"]].to_numpy()
        ]
    )
    assert {row["people"] for row in table(section(changed), "reliability")} == {39}


def test_a_scale_on_which_nobody_differs_is_a_statement() -> None:
    data = by_chance(scale=True)
    data.ratings.loc[data.ratings["item"].isin(SATISFACTION_ITEMS), "rating"] = 4
    made = section(data)
    assert table(made, "reliability") == []
    assert any(
        "Alpha of the scale after full" in told and "9 of 9 items do not vary" in told for told in statements(made)
    )


def test_each_alpha_and_omega_has_its_assumption() -> None:
    tests = [each.test for each in section(by_chance(scale=True)).assumptions]
    assert len(tests) == 8
    assert "McDonald's omega after all kinds in experiment 1" in tests


@given(ROWS, st.integers(0, 3))
@settings(max_examples=40, deadline=None)
def test_any_ratings_give_numbers_or_reasons(rows: list[tuple[str, int, str, str, str, int]], num_scaled: int) -> None:
    scaled = [
        (who, trial, layout, kind, f"satisfaction_{place}", 1 + (rating * place) % 5)
        for who, trial, layout, kind, item, rating in rows
        if item == "general"
        for place in range(1, 1 + num_scaled)
    ]
    check_sound(section(data_of([*rows, *scaled])))
