import pytest
from hypothesis import given, settings
from matplotlib.figure import Figure as Canvas
from scipy import stats

from tests.unit.reports.measured import by_chance, check_sound, data_of, plan_of_kinds, statements, table
from tests.unit.reports.test_robustness import ROWS
from webapp.reports.blocks import Figure
from webapp.reports.sections.equivalence import section
from webapp.reports.study_data import StudyData


def near(difference: float, num_people: int = 40) -> StudyData:
    """People who rate subgoals higher than full by so much on average, give or take a point."""
    rows = []
    for n in range(num_people):
        extra = (n % 2) + (n < difference * num_people) * 1
        rows += [(f"p{n:02}", 1, "a", "full", "general", 2), (f"p{n:02}", 2, "b", "subgoals", "general", 2 + extra)]
        rows += [(f"q{n:02}", 1, "a", "full", "general", 3), (f"q{n:02}", 2, "b", "subgoals", "general", 3 - n % 2)]
    return data_of(rows, plan=plan_of_kinds(items=("general",)))


def conclusion(data: StudyData) -> object:
    (row,) = table(section(data), "equivalence")
    return row["conclusion"]


def test_the_conclusion_follows_from_both_tests() -> None:
    assert conclusion(near(0.0)) == "equivalent"
    assert conclusion(near(0.45)) == "equivalent though different"
    assert conclusion(near(1.0)) == "different"
    assert conclusion(near(0.2, 3)) == "undecided"


def test_numbers_are_two_one_sided_t_tests_of_scipy() -> None:
    data = by_chance()
    wide = data.ratings[data.ratings["item"] == "general"].pivot_table("rating", "participant", "kind")
    differences = (wide["subgoals"] - wide["full"]).to_numpy(dtype=float)
    row = next(row for row in table(section(data), "equivalence_statistics") if row["item"] == "general")
    lower = stats.ttest_1samp(differences, -0.5, alternative="greater")
    upper = stats.ttest_1samp(differences, 0.5, alternative="less")
    assert (row["p_lower"], row["p_upper"]) == pytest.approx((lower.pvalue, upper.pvalue))


def test_whose_the_margin_is_is_told() -> None:
    assert "ours, since the study file declares none" in str(section(by_chance()).blocks[0])
    declared = by_chance(plan=plan_of_kinds(margin=0.75, is_margin_declared=True))
    assert "0.75 rating points of 0 (as the study file declares)" in str(section(declared).blocks[0])


def test_as_good_as_asks_for_the_lower_side_alone() -> None:
    (row,) = table(section(near(1.0)), "equivalence")
    assert (row["conclusion"], row["is_as_good"]) == ("different", True)


def test_no_pair_to_test_is_said() -> None:
    data = by_chance(plan=plan_of_kinds(equivalences=()))
    assert statements(section(data)) == [
        "Equivalence: no pair of kinds is declared for it, and the study has none of which the paper claims it"
    ]


def test_the_figure_has_an_interval_for_each_test_and_the_band() -> None:
    (figure,) = [block for block in section(by_chance()).blocks if isinstance(block, Figure)]
    canvas = Canvas(figsize=figure.size)
    figure.fill(canvas)
    (axes,) = canvas.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == [
        "subgoals \N{MINUS SIGN} full, general (1)",
        "subgoals \N{MINUS SIGN} full, foresee (1)",
    ]
    band = axes.patches[0].get_extents().transformed(axes.transData.inverted())
    assert (band.x0, band.x1) == pytest.approx((-0.5, 0.5))


@given(ROWS)
@settings(max_examples=40, deadline=None)
def test_any_ratings_give_numbers_or_reasons(rows: list[tuple[str, int, str, str, str, int]]) -> None:
    made = section(data_of(rows))
    check_sound(made)
    assert len(table(made, "equivalence")) + len(statements(made)) == (2 if rows else 1)
