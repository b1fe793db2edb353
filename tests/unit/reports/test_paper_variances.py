import pandas as pd
import pytest
from hypothesis import given, settings
from scipy import stats

from tests.unit.reports.paper_blocks import check_is_sound, names_of, reasons_of, rows_of, small_frames, text_of
from tests.unit.reports.rated import rated, study_data
from webapp.reports.sections.paper_variances import section

FRAME = rated(60, seed=4)


def own(kind: str) -> "pd.Series[int]":
    chosen = FRAME[(FRAME["kind"] == kind) & (FRAME["item"] == "general")]
    return chosen.sort_values("participant")["rating"].reset_index(drop=True)


def test_variances_stand_beside_the_papers_in_experiment_2_alone() -> None:
    made = section(study_data(FRAME))
    check_is_sound(made)
    second = rows_of(made, "general_variances_2")
    assert [(row["kind"], row["paper"]) for row in second] == [("all_key_points", "0.93"), ("first_key_point", "1.45")]
    assert [row["variance"] for row in second] == pytest.approx([own(str(row["kind"])).var() for row in second])
    assert all("paper" not in row for row in rows_of(made, "general_variances_1"))


def test_three_tests_of_the_variances_agree_with_scipy() -> None:
    (found,) = rows_of(section(study_data(FRAME)), "variance_tests_2")
    a, b = own("all_key_points"), own("first_key_point")
    ratio = a.var() / b.var()
    tail = min(stats.f.cdf(ratio, 59, 59), stats.f.sf(ratio, 59, 59))
    assert (found["ratio"], found["p_f"]) == pytest.approx((ratio, 2 * tail))
    assert found["df"] == "59, 59"
    assert found["p_brown_forsythe"] == pytest.approx(stats.levene(a, b, center="median").pvalue)
    assert found["p_pitman_morgan"] == pytest.approx(stats.pearsonr(a + b, a - b).pvalue)
    assert found["pairs"] == 60


def test_the_papers_variances_are_told_with_what_an_f_test_makes_of_them() -> None:
    told = text_of(section(study_data(FRAME)))
    p_value = 2 * stats.f.sf(1.45 / 0.93, 59, 59)
    assert f"{p_value:.3f}".removeprefix("0") in told
    other = FRAME.replace({"kind": {"first_key_point": "highlights"}})
    assert "0.93" not in text_of(section(study_data(other)))


def test_people_who_rated_one_of_two_kinds_do_not_count_as_pairs() -> None:
    gone = FRAME.index[(FRAME["participant"] < "person0010") & (FRAME["kind"] == "first_key_point")]
    (found,) = rows_of(section(study_data(FRAME.drop(index=gone).reset_index(drop=True))), "variance_tests_2")
    assert (found["pairs"], found["df"]) == (50, "59, 49")


def test_equal_ratings_get_statements_with_their_number() -> None:
    made = section(study_data(FRAME.assign(rating=3)))
    check_is_sound(made)
    assert all(row["variance"] is None for row in rows_of(made, "general_variances_2"))
    assert "all 60 are 3" in " ".join(reasons_of(made).values())


def test_an_experiment_that_does_not_ask_for_the_general_rating_is_named() -> None:
    kept = FRAME[FRAME["item"] != "general"].reset_index(drop=True)
    items = {"1": ("likeliness", "loveliness"), "2": ("likeliness", "loveliness")}
    made = section(study_data(kept, type(study_data(FRAME).plan)((), (), items)))
    assert names_of(made) == []
    assert set(reasons_of(made).values()) == {"its items do not include general"}


def test_a_single_kind_has_nothing_to_be_compared_with() -> None:
    kept = FRAME[FRAME["kind"] == "full"].reset_index(drop=True)
    made = section(study_data(kept, kinds={"1": ("full",)}))
    check_is_sound(made)
    assert reasons_of(made) == {"comparison of variances in experiment 1": "the only kind rated is full"}


@settings(max_examples=40, deadline=None)
@given(small_frames())
def test_scarce_ratings_never_crash_the_section_and_no_cell_is_nan(frame: pd.DataFrame) -> None:
    check_is_sound(section(study_data(frame)))
