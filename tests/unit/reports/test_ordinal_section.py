"""The section of planned comparisons, and the one that asks whether they hang on who is analysed."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.reports.rated import ITEMS, KINDS, rated, study_data
from webapp.analysis.multiplicity import holm
from webapp.analysis.planned_comparisons import compare_kinds
from webapp.analysis.planned_model import fit_planned
from webapp.explainer.pictures.figure_style import drawn
from webapp.reports.blocks import Figure, Section, Statement, Table
from webapp.reports.sections import ordinal, sensitivity
from webapp.study.analysis_plan import Contrast


def table(section: Section, name: str) -> pd.DataFrame:
    found = next(block for block in section.blocks if isinstance(block, Table) and block.name == name)
    return pd.DataFrame(found.rows, columns=[column.name for column in found.columns])


def statements(section: Section) -> list[Statement]:
    return [block for block in section.blocks if isinstance(block, Statement)]


def test_what_was_planted_is_found_and_nothing_else() -> None:
    found = table(ordinal.section(study_data(rated(60, {"subgoals": 1.0}))), "planned_comparisons")
    of_first = found["experiment"] == "1"
    assert (found[of_first]["found"] == "subgoals higher").all()
    assert (found[~of_first]["found"] == "no difference found").all()
    assert (found[of_first]["d_low"] < 1.0).all()
    assert (found[of_first]["d_high"] > 1.0).all()


def test_all_planned_tests_are_one_family() -> None:
    found = table(ordinal.section(study_data(rated(24, {"subgoals": 0.4}))), "planned_comparisons")
    assert len(found) == 9
    assert found["p_holm"].to_numpy(float) == pytest.approx(holm(found["p"].to_numpy(float)))


def test_a_test_that_cannot_be_made_makes_no_other_one_easier() -> None:
    ratings = rated(40, {"subgoals": 0.5})
    there = compare_kinds(ratings, study_data(ratings).plan)
    gone = compare_kinds(ratings[ratings["experiment"] == "1"], study_data(ratings).plan)
    assert [test.p_holm for test in gone.tests if test.effect is None] == [None] * 3
    smallest = min(test.effect.p_value for test in there.tests if test.effect is not None)
    for comparisons in (there, gone):
        assert min(test.p_holm or 1 for test in comparisons.tests) == pytest.approx(9 * smallest)


def test_the_paper_s_claims_stand_beside_whatever_the_direction_of_the_contrast() -> None:
    ratings = rated(20)
    plan = replace(
        study_data(ratings).plan, contrasts=(Contrast("1", "random", "subgoals"), Contrast("1", "full", "random"))
    )
    found = table(ordinal.section(study_data(ratings, plan)), "planned_comparisons")
    assert list(found["paper"][:3]) == ["subgoals higher"] * 3
    assert found["paper"][3:].isna().all()


def test_the_layout_s_order_being_fixed_is_said_once_per_experiment() -> None:
    told = statements(ordinal.section(study_data(rated(20))))
    assert [statement.subject for statement in told] == [
        f"Experiment {number}, likeliness, loveliness, general" for number in ("1", "2")
    ]


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda frame: frame.assign(rating=3), "ratings are 3"),
        (lambda frame: frame[frame["participant"] == "person0000"], "one person"),
        (lambda frame: frame[frame["kind"] != "random"], "nobody rated the kind random"),
        (lambda frame: frame.iloc[:0], "there are no ratings"),
        (
            lambda frame: frame.assign(rating=np.where(frame["kind"] == "random", 1, frame["rating"].clip(lower=2))),
            "1 or lower",
        ),
    ],
)
def test_scarce_data_give_a_reason_in_place_of_a_number(spoil, reason: str) -> None:  # type: ignore[no-untyped-def] # noqa: ANN001
    section = ordinal.section(study_data(spoil(rated(12))))
    missing = table(section, "planned_comparisons").query("found == 'not determined'")
    assert len(missing)
    assert missing[["d", "p", "p_holm"]].isna().all(axis=None)
    assert any(reason in statement.reason for statement in statements(section))


@settings(deadline=None, max_examples=15)
@given(
    st.lists(
        st.tuples(st.sampled_from("abc"), st.sampled_from(KINDS["1"]), st.sampled_from(ITEMS), st.integers(1, 5)),
        max_size=20,
        unique_by=lambda row: row[:3],
    )
)
def test_whatever_the_ratings_no_table_holds_a_number_that_is_none(rows: list[tuple[str, str, str, int]]) -> None:
    frame = pd.DataFrame(
        [
            (who, "1", KINDS["1"].index(kind) + 1, f"layout-{kind}", kind, item, rating)
            for who, kind, item, rating in rows
        ],
        columns=["participant", "experiment", "trial", "layout", "kind", "item", "rating"],
    )
    for block in ordinal.section(study_data(frame, kinds={"1": KINDS["1"]})).blocks:
        if isinstance(block, Table):
            cells = [cell for row in block.rows for cell in row if isinstance(cell, float)]
            assert np.all(np.isfinite(cells))
        if isinstance(block, Figure):
            assert drawn(block.fill, block.size, ".svg", block.name)


def test_seven_points_and_the_scale_s_own_points_are_drawn() -> None:
    data = study_data(rated(8))
    wide = replace(data, points=dict.fromkeys(data.points, 7))
    names = [block.name for block in ordinal.section(wide).blocks if isinstance(block, Figure)]
    assert names == ["planned_comparisons_forest", "experiment_1_distribution", "experiment_2_distribution"]


def test_people_who_turn_a_conclusion_around_are_told() -> None:
    data = study_data(rated(40, {"subgoals": 0.9}))
    contrary = rated(40, {"subgoals": -3.0}, seed=1).assign(participant=lambda frame: "x" + frame["participant"])
    everybody = study_data(pd.concat([data.ratings, contrary], ignore_index=True))
    section = sensitivity.section(data, [("with everybody", everybody), ("without corrections", data)])
    rows = table(section, "sensitivity")
    assert set(rows["choice"]) == {"as planned", "with everybody"}
    assert set(rows[rows["choice"] == "with everybody"]["people"]) == {80}
    assert (rows["changed"] == "changed").any()
    assert any("instead of subgoals higher" in block for block in section.blocks if isinstance(block, str))
    assert "These choices lead to exactly the data that are analysed: without corrections." in section.blocks


def test_where_no_choice_gives_other_data_this_is_a_sentence_and_no_table() -> None:
    data = study_data(rated(8))
    section = sensitivity.section(data, [("nobody excluded", data)])
    assert all(isinstance(block, str) for block in section.blocks)
    assert "No other choice gives other data: nobody was left out and nothing was corrected." in section.blocks


def test_the_logit_link_gives_odds_ratios_of_the_same_direction() -> None:
    data = study_data(rated(40, {"subgoals": 1.0}))
    odds = table(ordinal.section(data), "ordinal_odds_ratios")
    assert (odds[odds["experiment"] == "1"]["odds_ratio"] > 1).all()
    one = data.ratings.query("experiment == '1' and item == 'general'")
    effect = fit_planned(one, link="logit").contrast("subgoals", "random")
    row = odds.query("item == 'general' and contrast == 'subgoals \N{MINUS SIGN} random'").iloc[0]
    assert row["odds_ratio"] == pytest.approx(np.exp(effect.value))


def assumed(ratings: pd.DataFrame, words: str) -> list[tuple[str, str]]:
    """Return check and verdict of the assumptions of experiment 1, general, that say these words."""
    of_it = ratings[(ratings["experiment"] == "1") & (ratings["item"] == "general")]
    section = ordinal.section(study_data(of_it, kinds={"1": KINDS["1"]}))
    return [(each.check, each.verdict) for each in section.assumptions if words in each.assumes]


def test_kinds_on_layouts_of_their_own_are_compared_together_with_their_layouts() -> None:
    ratings = rated(30)
    own = ratings.assign(layout="of " + ratings["kind"])
    (there,), (gone,) = (assumed(frame, "same layouts") for frame in (ratings, own))
    assert there[1] == "holds"
    assert gone[1] == "violated"
    assert "tell of kind and layout together" in gone[0]
    section = ordinal.section(study_data(own))
    reasons = " ".join(statement.reason for statement in statements(section))
    assert "subgoals \N{MINUS SIGN} full and subgoals \N{MINUS SIGN} random tell of kind and layout together" in reasons
    notes = " ".join(block.note for block in section.blocks if isinstance(block, Table))
    assert "all_key_points \N{MINUS SIGN} first_key_point in experiment 2" in notes.partition("Of kind and layout")[2]


def test_of_kinds_that_share_layouts_only_in_part_those_on_others_are_named() -> None:
    ratings = rated(30)
    apart = ratings.assign(layout=ratings["layout"].where(ratings["kind"] != "random", "elsewhere"))
    ((check, verdict),) = assumed(apart, "same layouts")
    assert verdict == "violated"
    assert "subgoals \N{MINUS SIGN} random tell of kind" in check
    assert "\N{MINUS SIGN} full" not in check


def test_that_kinds_act_alike_on_everybody_cannot_be_checked_where_each_is_rated_once() -> None:
    ((check, verdict),) = assumed(rated(30), "independent")
    assert verdict == "not checkable"
    assert "90 ratings of 30 people, each kind once per person" in check


def test_kinds_that_a_person_rates_repeatedly_put_independence_in_doubt() -> None:
    ratings = rated(30)
    again = ratings[ratings["kind"] == "full"].assign(trial=4)
    ((check, verdict),) = assumed(pd.concat([ratings, again], ignore_index=True), "independent")
    assert verdict == "doubtful"
    assert "in 30 of 90 cases, at most 2 times" in check


def test_normal_intercepts_near_the_end_of_the_scale_are_not_called_violated() -> None:
    ratings = rated(60, dict.fromkeys(KINDS["1"], 1.6))
    ((check, verdict),) = assumed(ratings, "normal distribution")
    assert verdict == "holds"
    assert "199 draws of ratings from the fitted model" in check
