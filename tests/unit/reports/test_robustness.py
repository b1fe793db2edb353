import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from tests.unit.reports.measured import ITEMS, KINDS, by_chance, check_sound, data_of, plan_of_kinds, statements, table
from webapp.analysis.multiplicity import holm
from webapp.reports.sections.robustness import section
from webapp.study.analysis_plan import Contrast

ROWS = st.lists(
    st.tuples(
        st.sampled_from(["p1", "p2", "p3", "p4", "p5"]),
        st.integers(1, 3),
        st.sampled_from(["a", "b"]),
        st.sampled_from(KINDS),
        st.sampled_from(ITEMS),
        st.integers(1, 5),
    ),
    unique_by=lambda row: (row[0], row[1], row[4]),
    max_size=24,
)


def test_each_planned_contrast_is_tested_on_each_item_and_adjusted_as_one_family() -> None:
    found = table(section(by_chance()), "robustness")
    assert [(row["contrast"], row["item"]) for row in found] == [
        (f"subgoals \N{MINUS SIGN} {kind}", item) for kind in ("full", "none") for item in ITEMS
    ]
    assert [row["p_holm"] for row in found] == pytest.approx(list(holm([float(str(row["p"])) for row in found])))


def test_numbers_are_scipys() -> None:
    data = by_chance()
    wide = data.ratings[data.ratings["item"] == "general"].pivot_table("rating", "participant", "kind")
    first, second = wide["subgoals"].to_numpy(dtype=float), wide["none"].to_numpy(dtype=float)
    made = section(data)
    ranked = next(
        row
        for row in table(made, "robustness")
        if row["contrast"] == "subgoals \N{MINUS SIGN} none" and row["item"] == "general"
    )
    tested = next(
        row
        for row in table(made, "robustness_t")
        if row["contrast"] == "subgoals \N{MINUS SIGN} none" and row["item"] == "general"
    )
    wilcoxon = stats.wilcoxon(first - second, zero_method="pratt", method="asymptotic", correction=False)
    assert ranked["test"] == "signed rank, normal"
    assert ranked["p"] == pytest.approx(wilcoxon.pvalue)
    student = stats.ttest_rel(first, second)
    assert tested["t"] == pytest.approx(student.statistic)
    assert tested["p"] == pytest.approx(student.pvalue)


def test_where_few_people_saw_both_kinds_the_groups_are_different_people() -> None:
    rows = [(f"p{n}", 1, "a", kind, "general", 1 + (n * 7) % 5) for n in range(20) for kind in (KINDS[n % 2 * 2],)]
    rows += [("p0", 2, "b", "subgoals", "general", 3)]
    data = data_of(rows, plan=plan_of_kinds(contrasts=(Contrast("1", "subgoals", "full"),), items=("general",)))
    made = section(data)
    (found,) = table(made, "robustness")
    assert (found["test"], found["people"]) == ("rank sum, exact", 19)
    assert table(made, "robustness_t") == []
    assert "1 test fewer than half" in str(made.blocks[0])
    assert any(each.test == "Mann-Whitney" and "up to 1 person" in each.check for each in made.assumptions)


def test_a_kind_that_nobody_saw_is_said_to_be_one() -> None:
    data = data_of([("p1", 1, "a", "subgoals", "general", 3), ("p2", 1, "a", "subgoals", "general", 3)])
    assert (
        "The rank test of subgoals \N{MINUS SIGN} full on general in experiment 1: "
        "nobody rated the kind full on general" in statements(section(data))
    )


def test_equal_ratings_are_no_test_and_still_count_in_the_family() -> None:
    data = by_chance()
    data.ratings.loc[data.ratings["item"] == "foresee", "rating"] = 3
    made = section(data)
    assert any("all 40 are 0 (40 rated both" in told for told in statements(made))
    (smallest,) = sorted(float(str(row["p"])) for row in table(made, "robustness"))[:1]
    assert min(float(str(row["p_holm"])) for row in table(made, "robustness")) == pytest.approx(min(1.0, 4 * smallest))


def test_the_same_data_give_the_same_section() -> None:
    first, second = section(by_chance()), section(by_chance())
    assert first == second


def test_skewed_differences_are_doubted() -> None:
    rng = np.random.default_rng(1)
    rows = []
    for n in range(60):
        rows += [
            (f"p{n:02}", 1, "a", "full", "general", 3),
            (f"p{n:02}", 2, "a", "subgoals", "general", 5 if rng.random() < 0.1 else 3),
        ]
    data = data_of(rows, plan=plan_of_kinds(contrasts=(Contrast("1", "subgoals", "full"),), items=("general",)))
    verdicts = {each.verdict for each in section(data).assumptions if "symmetrically" in each.assumes}
    assert verdicts == {"doubtful"}


def test_where_all_differences_lie_on_one_side_the_effect_has_no_interval_and_that_is_said() -> None:
    rows = [(f"p{n}", *(1, "a", "full", "general", 1 + n % 2)) for n in range(6)]
    rows += [(f"p{n}", *(2, "b", "subgoals", "general", 4)) for n in range(6)]
    made = section(
        data_of(rows, plan=plan_of_kinds(contrasts=(Contrast("1", "subgoals", "full"),), items=("general",)))
    )
    (found,) = table(made, "robustness")
    assert (found["rank_biserial"], found["low"], found["high"]) == (1.0, None, None)
    assert any("The interval of r of" in told and "on both sides of 0, and all 6" in told for told in statements(made))


def test_the_mean_of_many_skewed_differences_is_no_normal_one() -> None:
    rows = []
    for n in range(60):
        rows += [
            (f"p{n:02}", 1, "a", "full", "general", 1),
            (f"p{n:02}", 2, "a", "subgoals", "general", 1 + (n < 2) * 4),
        ]
    data = data_of(rows, plan=plan_of_kinds(contrasts=(Contrast("1", "subgoals", "full"),), items=("general",)))
    (found,) = [each for each in section(data).assumptions if "mean difference is normal" in each.assumes]
    assert found.verdict == "doubtful"
    assert "In 1 of 1 there are fewer than 30 people or than 25 times the squared skewness" in found.check


@given(ROWS)
@settings(max_examples=40, deadline=None)
def test_any_ratings_give_numbers_or_reasons(rows: list[tuple[str, int, str, str, str, int]]) -> None:
    made = section(data_of(rows))
    check_sound(made)
    assert len(table(made, "robustness")) + sum("rank test" in told for told in statements(made)) == (4 if rows else 1)
