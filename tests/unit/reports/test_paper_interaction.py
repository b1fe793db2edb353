import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from scipy import stats

from tests.unit.reports.paper_blocks import (
    check_is_sound,
    draw_all,
    names_of,
    reasons_of,
    rows_of,
    small_frames,
    text_of,
)
from tests.unit.reports.rated import rated, study_data
from webapp.analysis.factorial_anova import two_by_two
from webapp.reports.sections.paper_interaction import section
from webapp.reports.sections.paper_printed import joint_denominators
from webapp.reports.sections.rated import rated_experiments

FRAME = rated(60, {"subgoals": 0.8, "random": -0.5}, seed=4)
DATA = study_data(FRAME)
WIDE = rated_experiments(DATA)[0].wide(["likeliness", "loveliness", "general"])
NAMES = {False: "low (1 to 3)", True: "high (4 to 5)"}


def cell(*, likely: bool, lovely: bool) -> "pd.Series[int]":
    return WIDE["general"][((WIDE["likeliness"] >= 4) == likely) & ((WIDE["loveliness"] >= 4) == lovely)]


def test_correlations_pool_all_kinds_and_stand_beside_those_of_the_paper() -> None:
    found = rows_of(section(DATA), "general_correlations_1")
    oracle = stats.pearsonr(WIDE["likeliness"], WIDE["general"])
    low, high = oracle.confidence_interval()
    assert [found[0][name] for name in ("r", "low", "high", "p")] == pytest.approx(
        [oracle.statistic, low, high, oracle.pvalue]
    )
    assert [row["paper"] for row in found] == ["0.74", None, "0.08", None]
    assert [(row["num"], row["df"]) for row in found] == [(180, 178), (180, 119)] * 2


def test_cells_are_cut_between_3_and_4_and_stand_beside_the_papers_table() -> None:
    found = rows_of(section(DATA), "general_cells_1")
    assert [row["paper"] for row in found] == ["2.17", "1.98", "3.23", "4.07"]
    for row in found:
        likely, lovely = row["likeliness"] == NAMES[True], row["loveliness"] == NAMES[True]
        own = cell(likely=likely, lovely=lovely)
        assert (row["num"], row["mean"], row["sd"]) == pytest.approx((len(own), own.mean(), own.std()))


def test_type_iii_stands_first_and_each_type_has_the_papers_f_beside_it() -> None:
    found = rows_of(section(DATA), "general_anova_1")
    assert [row["type"] for row in found] == ["III"] * 3 + ["II"] * 3 + ["I"] * 3
    oracle = two_by_two(WIDE["general"], WIDE["likeliness"] > 3, WIDE["loveliness"] > 3, 3)
    assert [row["f"] for row in found[:3]] == [effect.statistic for effect in oracle.effects]
    assert {row["df"] for row in found} == {"1, 176"}
    assert [row["paper"] for row in found] == [
        "F = 67.65, p < .001",
        "F = 2.20, p = .143",
        "F = 6.56, p = .012",
    ] * 3


def test_simple_effects_are_tested_in_both_directions() -> None:
    found = rows_of(section(DATA), "general_simple_effects_1")
    for row, likely in zip(found, (False, True), strict=True):
        pair = cell(likely=likely, lovely=True), cell(likely=likely, lovely=False)
        larger = stats.ttest_ind(*pair, alternative="greater")
        assert (row["t"], row["p_high_larger"]) == pytest.approx((larger.statistic, larger.pvalue))
        assert row["p_two_sided"] == pytest.approx(stats.ttest_ind(*pair).pvalue)
        assert row["p_observed"] == pytest.approx(row["p_two_sided"] / 2)  # type: ignore[operator]
    assert [row["paper"] for row in found] == ["p = .251", "p < .001"]


def test_what_cannot_be_right_in_the_paper_is_computed_and_said() -> None:
    made = section(DATA)
    rows = {row["effect"]: row for row in rows_of(made, "printed_f_tests")}
    assert rows["loveliness"]["fits"] == "53 to 77"
    assert rows["interaction"]["fits"] == "72 to 142"
    assert rows["loveliness"]["p_1_98"] == pytest.approx(0.1412, abs=5e-5)
    assert rows["interaction"]["p_1_176"] == pytest.approx(0.0113, abs=5e-5)
    assert joint_denominators() == (72, 73, 74, 75, 76, 77)
    told = text_of(made)
    for said in ("fit only df from 72 to 77", "for df from 67 to 71", "F(1, 176)", "has p > .5", ".749"):
        assert said in told


def test_experiments_other_than_the_papers_have_no_column_and_no_table_of_the_paper() -> None:
    made = section(study_data(FRAME.replace({"kind": {"random": "highlights"}})))
    check_is_sound(made)
    assert "printed_f_tests" not in names_of(made)
    assert "F(3.98)" not in text_of(made)
    for name in ("general_correlations", "general_cells", "general_anova", "general_simple_effects"):
        for number in "12":
            assert all("paper" not in row for row in rows_of(made, f"{name}_{number}"))


def test_an_experiment_without_the_three_items_is_named_with_what_it_lacks() -> None:
    kept = FRAME[(FRAME["experiment"] == "1") | (FRAME["item"] != "loveliness")].reset_index(drop=True)
    data = study_data(kept)
    plan_items = {"1": ("likeliness", "loveliness", "general"), "2": ("likeliness", "general")}
    made = section(study_data(kept, type(data.plan)((), (), plan_items)))
    assert reasons_of(made) == {
        "what the general rating goes with, experiment 2": "its items do not include loveliness"
    }


def test_an_empty_cell_leaves_the_correlations_and_says_why_there_is_no_analysis() -> None:
    wide = FRAME[FRAME["experiment"] == "1"].copy()
    lovely = wide["item"] == "loveliness"
    likely = wide[wide["item"] == "likeliness"].set_index(["participant", "trial"])["rating"]
    same = likely.loc[list(zip(wide["participant"][lovely], wide["trial"][lovely], strict=True))].to_numpy()
    wide.loc[lovely, "rating"] = same
    made = section(study_data(wide.reset_index(drop=True), kinds={"1": ("full", "subgoals", "random")}))
    check_is_sound(made)
    assert "general_anova_1" not in names_of(made)
    num_low = int(np.count_nonzero(same < 4))
    assert f"there are {num_low}, 0, 0, {180 - num_low}" in " ".join(reasons_of(made).values())
    assert [row["mean"] for row in rows_of(made, "general_cells_1")][1:3] == [None, None]
    assert rows_of(made, "general_correlations_1")[0]["r"] is not None
    draw_all(made)


@pytest.mark.parametrize("rating", [1, 3, 5])
def test_equal_ratings_are_said_to_be_equal(rating: int) -> None:
    made = section(study_data(FRAME.assign(rating=rating)))
    check_is_sound(made)
    told = " ".join(reasons_of(made).values())
    assert "of 180 pairs one does not" in told
    assert "there are" in told
    draw_all(made)


def test_cells_whose_spread_cannot_be_compared_are_not_checkable_and_crash_nothing() -> None:
    rows = [
        (f"p{person}", "1", 1, "a", "full", item, rating)
        for person, (likely, lovely, general) in enumerate((a, b, c) for a in (1, 5) for b in (1, 5) for c in (1, 5))
        for item, rating in (("likeliness", likely), ("loveliness", lovely), ("general", general))
    ]
    names = ["participant", "experiment", "trial", "layout", "kind", "item", "rating"]
    made = section(study_data(pd.DataFrame(rows, columns=names), kinds={"1": ("full",)}))
    check_is_sound(made)
    told = {row.assumes: row.verdict for row in made.assumptions}
    assert told["the four cells have equal variances"] == "not checkable"


def test_on_a_longer_scale_the_cut_lies_above_its_middle() -> None:
    points = {(experiment, item): 7 for experiment in "12" for item in ("likeliness", "loveliness", "general")}
    made = section(type(DATA)(**{name: getattr(DATA, name) for name in DATA.__slots__} | {"points": points}))
    found = rows_of(made, "general_cells_1")
    assert {row["likeliness"] for row in found} == {"low (1 to 4)", "high (5 to 7)"}
    low = (WIDE["likeliness"] <= 4) & (WIDE["loveliness"] <= 4)
    assert [found[0]["num"], found[3]["num"]] == [
        low.sum(),
        ((WIDE[["likeliness", "loveliness"]] > 4).all(axis=1)).sum(),
    ]


def test_the_figure_is_drawn_the_same_each_time() -> None:
    assert draw_all(section(DATA)) == draw_all(section(study_data(FRAME)))


def test_the_factors_are_told_to_be_measured_and_ratings_to_depend_on_the_person() -> None:
    told = {row.assumes: row for row in section(DATA).assumptions if row.test.startswith("analysis of variance")}
    assert told["the factors are assigned and measured without error"].verdict == "violated"
    assert told["ratings are independent"].verdict == "violated"
    assert "ICC(1)" in told["ratings are independent"].check


@settings(max_examples=40, deadline=None)
@given(small_frames())
def test_scarce_ratings_never_crash_the_section_and_no_cell_is_nan(frame: pd.DataFrame) -> None:
    check_is_sound(section(study_data(frame)))
