import pandas as pd
import pytest
from hypothesis import given, settings
from scipy import stats

from tests.unit.reports.paper_blocks import check_is_sound, draw_all, names_of, reasons_of, rows_of, small_frames
from tests.unit.reports.rated import rated, study_data
from webapp.reports.blocks import Figure
from webapp.reports.sections.paper_ratings import section

FRAME = rated(60, {"subgoals": 0.8, "random": -0.5}, seed=4)


def own(kind: str, item: str, experiment: str = "1") -> "pd.Series[int]":
    chosen = FRAME[(FRAME["experiment"] == experiment) & (FRAME["kind"] == kind) & (FRAME["item"] == item)]
    return chosen["rating"]


def test_means_stand_with_scipys_intervals_and_the_papers_numbers_beside_them() -> None:
    made = section(study_data(FRAME))
    check_is_sound(made)
    by_place = {(row["kind"], row["item"]): row for row in rows_of(made, "rating_means_1")}
    assert len(by_place) == 9
    found, values = by_place["subgoals", "likeliness"], own("subgoals", "likeliness")
    assert found["paper"] == "3.38"
    assert [row["paper"] for place, row in by_place.items() if place != ("subgoals", "likeliness")] == [None] * 8
    low, high = stats.t.interval(0.95, 59, values.mean(), stats.sem(values))
    assert (found["num"], found["mean"], found["low"], found["high"]) == pytest.approx((60, values.mean(), low, high))
    assert found["variance"] == pytest.approx(values.var())
    second = rows_of(made, "rating_means_2")
    assert [row["paper"] for row in second if row["item"] == "likeliness"] == ["> 4", "> 4"]
    assert [row["paper_variance"] for row in second if row["item"] == "general"] == ["0.93", "1.45"]


def test_all_pairs_of_kinds_are_compared_by_students_t_test_and_the_paper_is_quoted() -> None:
    made = section(study_data(FRAME))
    rows = {(row["contrast"], row["item"]): row for row in rows_of(made, "kind_comparisons_1")}
    assert len(rows) == 9
    found = rows["subgoals \N{MINUS SIGN} random", "loveliness"]
    oracle = stats.ttest_ind(own("subgoals", "loveliness"), own("random", "loveliness"))
    assert (found["t"], found["p"], found["df"]) == pytest.approx((oracle.statistic, oracle.pvalue, 118))
    quoted = {place for place, row in rows.items() if row["paper"] == "subgoals higher"}
    assert quoted == {
        *(("subgoals \N{MINUS SIGN} random", item) for item in ("likeliness", "loveliness", "general")),
        ("subgoals \N{MINUS SIGN} full", "loveliness"),
    }
    second = {row["item"]: row["paper"] for row in rows_of(made, "kind_comparisons_2")}
    assert second == {"likeliness": "do not differ", "loveliness": "differ", "general": "do not differ"}


def test_another_study_has_the_same_tables_without_the_papers_numbers() -> None:
    other = study_data(FRAME[FRAME["experiment"] == "1"].replace({"kind": {"random": "highlights"}}))
    made = section(other)
    check_is_sound(made)
    for name in ("rating_means_1", "kind_comparisons_1"):
        assert not any(column.startswith("paper") for row in rows_of(made, name) for column in row)
    assert "paper" not in next(block for block in made.blocks if isinstance(block, Figure)).title


def test_every_assumption_has_its_numbers_and_repeated_ratings_violate_independence() -> None:
    told = [row for row in section(study_data(FRAME)).assumptions if row.test.endswith("experiment 1")]
    assert [told[place].verdict for place in (0, 2, 3)] == ["violated", "violated", "not checkable"]
    assert "in 9 of 9 kinds and items" in told[0].check
    p_values = [
        stats.levene(*(own(kind, item) for kind in ("full", "subgoals", "random")), center="median").pvalue
        for item in ("likeliness", "loveliness", "general")
    ]
    assert f"p < .05 in {sum(p_value < 0.05 for p_value in p_values)} of 3 items" in told[1].check
    assert f"{min(p_values):.3f}".removeprefix("0") in told[1].check
    assert "ICC(1)" in told[2].check


def test_the_figure_is_drawn_the_same_each_time_with_the_papers_mean_in_its_caption() -> None:
    made = section(study_data(FRAME))
    first, second = draw_all(made), draw_all(section(study_data(FRAME)))
    assert first == second
    assert list(first) == ["experiment_1_bars", "experiment_2_bars"]
    figure = next(block for block in made.blocks if isinstance(block, Figure))
    assert "diamonds are the paper's means" in figure.title
    assert f"subgoals {own('subgoals', 'likeliness').mean():.2f}" in figure.alt


def test_many_kinds_and_items_of_different_scales_are_drawn_in_rows() -> None:
    kinds = {f"kind_{number}": number for number in range(12)}
    rows = [
        (f"p{person}", "own", number + 1, "a", kind, item, 1 + (person + number) % 3)
        for person in range(4)
        for kind, number in kinds.items()
        for item in ("likeliness", "ease", "general")
    ]
    names = ["participant", "experiment", "trial", "layout", "kind", "item", "rating"]
    data = study_data(pd.DataFrame(rows, columns=names), kinds={"own": tuple(kinds)})
    made = section(data)
    check_is_sound(made)
    figure = next(block for block in made.blocks if isinstance(block, Figure))
    assert figure.size[1] > 7
    assert len(draw_all(made)["experiment_own_bars"]) > 10_000


def test_equal_ratings_have_a_mean_and_no_interval_and_no_test() -> None:
    made = section(study_data(FRAME.assign(rating=3)))
    check_is_sound(made)
    for row in rows_of(made, "rating_means_1"):
        assert (row["mean"], row["sd"], row["low"], row["high"]) == (3.0, 0.0, None, None)
    assert all(row["p"] is None for row in rows_of(made, "kind_comparisons_1"))
    assert "all are 3 here and 3 there" in " ".join(reasons_of(made).values())
    draw_all(made)


def test_one_participant_gets_means_and_statements() -> None:
    made = section(study_data(FRAME[FRAME["participant"] == "person0000"].reset_index(drop=True)))
    check_is_sound(made)
    assert all(row["num"] == 1 and row["sd"] is None for row in rows_of(made, "rating_means_1"))
    assert "there are 1 and 1" in " ".join(reasons_of(made).values())


def test_no_ratings_at_all_are_said_to_be_none() -> None:
    made = section(study_data(FRAME.iloc[:0]))
    assert names_of(made) == []
    assert reasons_of(made) == {"means of ratings": "there are 0 ratings"}


@settings(max_examples=40, deadline=None)
@given(small_frames())
def test_scarce_ratings_never_crash_the_section_and_no_cell_is_nan(frame: pd.DataFrame) -> None:
    check_is_sound(section(study_data(frame)))
