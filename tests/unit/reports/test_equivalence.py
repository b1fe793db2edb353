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


def normality(data: StudyData) -> tuple[str, str]:
    (found,) = [each for each in section(data).assumptions if "is normal" in each.assumes]
    return found.verdict, found.check


def test_normality_is_judged_by_the_skewness_of_its_own_differences_not_by_their_number_alone() -> None:
    rows = []
    for n in range(60):
        rows += [
            (f"p{n:02}", 1, "a", "full", "general", 1),
            (f"p{n:02}", 2, "b", "subgoals", "general", 1 + (n < 2) * 4),
        ]
    verdict, check = normality(data_of(rows, plan=plan_of_kinds(items=("general",))))
    assert verdict == "doubtful"
    assert "from 0.050 to 0.1" in check
    assert normality(near(0.0))[0] == "holds"
    assert normality(near(0.2, 3))[0] == "not checkable"
    (row,) = table(section(near(0.0)), "equivalence_statistics")
    assert row["skewness"] == pytest.approx(0, abs=1e-12)


def test_whoever_rated_one_kind_alone_is_counted_and_told() -> None:
    data = near(0.45)
    dropped = data.ratings["participant"].str.startswith("p1") & (data.ratings["kind"] == "full")
    rows = data.ratings[~dropped][["participant", "trial", "layout", "kind", "item", "rating"]].to_numpy()
    made = section(data_of([tuple(row) for row in rows], plan=plan_of_kinds(items=("general",))))
    (row,) = table(made, "equivalence")
    assert (row["people"], row["left_out"]) == (70, 10)
    assert "up to 10 of 80 people who rated either, so that it speaks of the 70 who rated both" in str(made.blocks[0])


def test_a_difference_found_here_is_secondary_to_the_planned_comparisons() -> None:
    made = section(near(1.0))
    assert "secondary here" in str(made.blocks[0])
    assert "what decides whether kinds differ are the planned comparisons" in str(made.blocks[0])


@given(ROWS)
@settings(max_examples=40, deadline=None)
def test_any_ratings_give_numbers_or_reasons(rows: list[tuple[str, int, str, str, str, int]]) -> None:
    made = section(data_of(rows))
    check_sound(made)
    assert len(table(made, "equivalence")) + len(statements(made)) == (2 if rows else 1)
