"""What frames the sections: the headline, the plan beside what was run, the assumptions, the methods."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.unit.reports.made_up import ITEMS, ORIGIN, PEOPLE, made_up_plan, made_up_report, made_up_study, planned
from webapp.explainer.pictures.figure_style import drawn
from webapp.reports.assembly import SECTIONS, Assembled
from webapp.reports.blocks import Cell, Column, Drawing, Section, Statement, Table
from webapp.reports.csv_tables import csv_of
from webapp.reports.departures import departures
from webapp.reports.findings import findings
from webapp.reports.methods import methods_text
from webapp.reports.origin import origin_of
from webapp.reports.people import Headcount, headcount
from webapp.reports.study_data import StudyData

REASON = "in experiment 2 all 48 ratings are 3"


def section_of(made: Assembled, name: str) -> Section:
    return next(section for section in made.report.sections if section.name == name)


def texts_of(section: Section) -> str:
    return "\n".join(block for block in section.blocks if isinstance(block, str))


def table_of(made: Assembled, name: str) -> list[dict[str, Cell]]:
    table = next(table for table in made.report.tables if table.name == name)
    return [dict(zip((column.name for column in table.columns), row, strict=True)) for row in table.rows]


def nothing_computed(_: StudyData) -> Section:
    return Section("ordinal", "Planned comparisons", (Statement("the models", REASON),))


@pytest.fixture(scope="module")
def made() -> Assembled:
    return made_up_report()


def test_sections_come_in_the_order_of_reading(made: Assembled) -> None:
    names = [section.name for section in made.report.sections]
    assert names[0] == "summary"
    assert names[-2:] == ["assumptions", "methods"]
    assert names.index("plan") < names.index("ordinal") < names.index("looks")


def test_the_summary_counts_what_holds_after_the_correction(made: Assembled) -> None:
    told = texts_of(section_of(made, "summary"))
    answers = table_of(made, "summary")
    held = [row for row in answers if str(row["answer"]).endswith("rated higher")]
    assert len(held) == sum(row["p_holm"] is not None and float(row["p_holm"]) < 0.05 for row in answers) == 4
    assert "Of 9 planned (by default) comparisons, 4 show a difference" in told
    assert "1 comparison could not be made" in told
    assert f"{PEOPLE} participants with 360 ratings are analysed, of 28 who agreed to take part; 4 are not" in told
    assert "incomplete (2), excluded by a researcher (1) and straight_lining (1)" in told


def test_the_kind_that_is_rated_higher_is_named_whichever_side_of_the_contrast_it_is_on() -> None:
    def negative(data: StudyData) -> Section:
        section = planned(data)
        table = section.blocks[1]
        assert isinstance(table, Table)
        rows = tuple((*row[:3], -0.8, -1.0, -0.6, 0.001, 0.003) for row in table.rows)
        return replace(section, blocks=(replace(table, rows=rows),))

    first = table_of(made_up_report(makers={"ordinal": negative}), "summary")[0]
    assert (first["contrast"], first["answer"]) == ("subgoals \N{MINUS SIGN} full", "full rated higher")


@pytest.mark.parametrize(
    ("shown", "told"),
    [
        ((), "none shows it."),
        (("a",), "1 shows it: a in experiment 1 on general."),
        (("a", "b"), "2 show it: a in experiment 1 on general; b in"),
    ],
)
def test_the_summary_names_what_is_as_good_as_something_else(shown: tuple[str, ...], told: str) -> None:
    def equivalence(_: StudyData) -> Section:
        columns = tuple(Column(name, name) for name in ("contrast", "experiment", "item", "is_as_good"))
        rows = tuple((name, "1", "general", name in shown) for name in ("a", "b"))
        return Section("equivalence", "Equivalence", (Table("equivalence", "Tests", columns, rows),))

    made = made_up_report(makers={"equivalence": equivalence})
    assert "Of 2 tests whether the first kind of a pair is as good as the second" in texts_of(made.report.sections[0])
    assert told in texts_of(made.report.sections[0])


def test_every_planned_comparison_is_run_or_has_a_reason(made: Assembled) -> None:
    lines = table_of(made, "plan_and_run")
    assert len(lines) == made_up_plan().num_tests
    assert all(bool(line["was_run"]) != bool(line["reason"]) for line in lines)
    assert [line["was_run"] for line in lines].count(False) == 1


def test_the_reason_is_the_sections_own_where_it_tells_one() -> None:
    def told(data: StudyData) -> Section:
        section = planned(data)
        why = Statement("Experiment 2, loveliness: all_key_points \N{MINUS SIGN} first_key_point", REASON)
        return replace(section, blocks=(*section.blocks, why))

    assert table_of(made_up_report(makers={"ordinal": told}), "plan_and_run")[-1]["reason"] == REASON


def test_a_missing_kind_and_a_missing_item_are_named_as_reasons() -> None:
    data = made_up_study()
    ratings = data.ratings
    is_gone = (ratings["kind"] == "full") | ((ratings["experiment"] == "2") & (ratings["item"] == "general"))
    data = made_up_study(ratings=ratings[~is_gone].reset_index(drop=True))
    reasons = {(str(each.contrast), each.item): each.reason for each in findings(data, nothing_computed(data))}
    assert reasons["subgoals \N{MINUS SIGN} full", "general"] == "no rating of full"
    assert (
        reasons["all_key_points \N{MINUS SIGN} first_key_point", "general"] == "nobody who is analysed rated this item"
    )


def test_an_item_that_is_not_asked_about_a_kind_is_not_missing() -> None:
    plan = made_up_plan(asked={("1", "random"): ("general",)})
    lines = table_of(made_up_report(made_up_study(plan=plan), {}), "plan_and_run")
    assert [line["item"] for line in lines if line["contrast"] == "subgoals \N{MINUS SIGN} random"] == ["general"]
    assert len(lines) == plan.num_tests


def test_a_report_without_any_result_says_so() -> None:
    made = made_up_report(makers={"ordinal": nothing_computed})
    assert "None of 9 planned (by default) comparisons could be made" in texts_of(section_of(made, "summary"))
    assert "9 planned comparisons of 9 could not be made" in " ".join(made.differences)


def test_the_default_plan_is_called_the_default_and_nothing_registered() -> None:
    made = made_up_report(makers={})
    told = " ".join(made.differences)
    assert "declares no contrasts" in told
    assert "declares no margin" in told
    assert {row["source"] for row in table_of(made, "plan")} == {"the default plan", "comparisons times items"}
    assert any(isinstance(block, Statement) for block in section_of(made, "plan").blocks)


def registered() -> StudyData:
    plan = made_up_plan(is_declared=True, is_margin_declared=True, text="# Our plan\n\nCompare.")
    return made_up_study(plan=plan)


def all_made(data: StudyData) -> Section:
    section = planned(data)
    table = section.blocks[1]
    assert isinstance(table, Table)
    rows = tuple((*row[:3], 0.8, 0.6, 1.0, 0.001, 0.009) for row in table.rows)
    return replace(section, blocks=(replace(table, rows=rows),))


def test_a_registered_plan_that_was_followed_has_no_departures_and_stands_in_the_report() -> None:
    made = made_up_report(registered(), {"ordinal": all_made})
    assert made.differences == ()
    assert "# Our plan\n\nCompare." in section_of(made, "plan").blocks
    assert "Everything was run as it was registered." in texts_of(section_of(made, "summary"))
    assert "Of 9 planned comparisons, 9 show a difference" in texts_of(section_of(made, "summary"))


def test_data_that_are_no_data_and_options_that_change_the_people_are_departures() -> None:
    origin = origin_of(
        {}, {"include_incomplete": True}, (), ("Files that are not as they were exported: ratings.csv.",)
    )
    told = " ".join(departures(replace(registered(), mode="bot"), (), origin))
    assert "The mode is bot" in told
    assert "--include-incomplete" in told
    assert "Files that are not as they were exported: ratings.csv." in told


def test_without_a_plan_in_words_nobody_says_that_everything_was_registered() -> None:
    data = registered()
    made = made_up_report(replace(data, plan=replace(data.plan, text=None)), {"ordinal": all_made})
    assert made.differences == ()
    for name in ("summary", "plan", "methods"):
        assert "No plan in words is registered" in texts_of(section_of(made, name))
        assert "as it was registered" not in texts_of(section_of(made, name))


def test_items_that_are_not_planned_are_named() -> None:
    plan = made_up_plan(items={"1": ITEMS[:2], "2": ITEMS})
    told = " ".join(made_up_report(made_up_study(plan=plan), {}).differences)
    assert "Experiment 1 has ratings of loveliness, which the plan does not test." in told


def test_all_assumptions_are_counted_and_the_doubtful_ones_repeated(made: Assembled) -> None:
    assert "rest on 6 assumptions (holds: 1, doubtful: 1, violated: 1, not checkable: 1, by design: 2)" in texts_of(
        section_of(made, "assumptions")
    )
    assert [row["verdict"] for row in table_of(made, "assumptions_in_doubt")] == [
        "doubtful",
        "violated",
        "not checkable",
    ]
    assert len(made.report.assumptions().rows) == 6


def test_the_methods_name_people_model_correction_versions_and_hashes(made: Assembled) -> None:
    told = methods_text(made_up_study(), ORIGIN, made.differences).decode()
    for words in (
        f"{PEOPLE} participants with 360 ratings",
        "straight_lining (1)",
        "cumulative link mixed model",
        "Holm's method at the level 0.05",
        "±0.5 rating points",
        "9 tests are one family",
        "NumPy 2.4.0",
        ORIGIN.input_hash[:12],
        *ORIGIN.files,
        *ORIGIN.files.values(),
        *made.differences,
    ):
        assert words in told


def test_one_person_and_unknown_others_are_told_in_the_singular() -> None:
    data = made_up_study(everybody=None)
    one = data.ratings[data.ratings["participant"] == "p00"].reset_index(drop=True)
    alone = replace(data, ratings=one, participants=data.participants.head(1))
    assert headcount(alone).sentence().startswith("1 participant with 15 ratings is analysed; the data set does not")


def alike(ratings: pd.DataFrame) -> pd.DataFrame:
    return ratings.assign(rating=3)


def of_one_person(ratings: pd.DataFrame) -> pd.DataFrame:
    return ratings[ratings["participant"] == "p00"].reset_index(drop=True)


def of_one_kind(ratings: pd.DataFrame) -> pd.DataFrame:
    return ratings[ratings["kind"] == "full"].reset_index(drop=True)


def of_two_answers(ratings: pd.DataFrame) -> pd.DataFrame:
    return ratings.assign(rating=np.where(ratings["rating"] > 3, 5, 1))


def of_nobody(ratings: pd.DataFrame) -> pd.DataFrame:
    return ratings.head(0)


def once_each(ratings: pd.DataFrame) -> pd.DataFrame:
    return ratings.drop_duplicates(["participant", "item"]).reset_index(drop=True)


def of_one_item(ratings: pd.DataFrame) -> pd.DataFrame:
    return ratings[ratings["item"] == "loveliness"].reset_index(drop=True)


@pytest.mark.parametrize(
    "change", [alike, of_one_person, of_one_kind, of_two_answers, of_nobody, once_each, of_one_item]
)
def test_scarce_and_degenerate_data_make_a_whole_report(change: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    ratings = change(made_up_study().ratings)
    people = pd.DataFrame({"participant": sorted(set(ratings["participant"]))}, dtype="str")
    data = made_up_study(ratings=ratings, participants=people, everybody=None)
    made = made_up_report(data, SECTIONS)
    assert len(made.report.sections) == len(SECTIONS) + 4
    assert all(section.blocks for section in made.report.sections)
    for table in made.report.tables:
        csv_of(table)
    for figure in made.report.figures:
        assert isinstance(figure, Drawing) or drawn(figure.fill, figure.size, ".svg", figure.name)


def test_the_sections_of_this_program_make_a_report_of_made_up_data() -> None:
    made = made_up_report(makers=SECTIONS)
    titles = [section.title for section in made.report.sections]
    assert len(titles) == len(set(titles))


def test_one_person_who_is_not_analysed_is_told_as_one() -> None:
    told = Headcount(11, 165, 12, (("incomplete", 1),)).sentence()
    assert (
        told
        == "11 participants with 165 ratings are analysed, of 12 who agreed to take part; 1 is not: incomplete (1)."
    )
