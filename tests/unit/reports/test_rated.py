from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.unit.reports.rated import rated as made_up_ratings
from tests.unit.reports.rated import study_data
from webapp.analysis import two_samples
from webapp.analysis.censoring import Undefined
from webapp.reports.sections.rated import (
    Undecided,
    independence,
    rated_experiments,
    rejections,
    titled,
    told_apart,
)
from webapp.stimuli.sources import find_study
from webapp.study.protocol import parse_study


def test_ratings_of_a_pair_are_those_of_whoever_rated_both_once() -> None:
    frame = made_up_ratings(6)
    lone = frame[(frame["participant"] == "person0001") & (frame["kind"] == "full")]
    again = frame[(frame["participant"] == "person0002") & (frame["kind"] == "random")].assign(trial=9)
    changed = pd.concat([frame.drop(index=lone.index), again], ignore_index=True)
    first, _ = rated_experiments(study_data(changed))
    a, b = first.paired("full", "random", "general")
    kept = changed[(changed["item"] == "general") & ~changed["participant"].isin(["person0001", "person0002"])]
    assert [list(a), list(b)] == [
        kept[kept["kind"] == kind].sort_values("participant")["rating"].to_list() for kind in ("full", "random")
    ]


def test_a_row_of_the_wide_frame_is_a_trial_with_all_items() -> None:
    frame = made_up_ratings(3)
    gone = frame.index[(frame["participant"] == "person0000") & (frame["item"] == "loveliness")][0]
    first, _ = rated_experiments(study_data(frame.drop(index=gone).reset_index(drop=True)))
    wide = first.wide(["likeliness", "loveliness"])
    assert len(wide) == 8
    for row in wide.itertuples():
        own = frame[(frame["participant"] == row.participant) & (frame["trial"] == row.trial)]
        own = own[own["experiment"] == "1"].set_index("item")["rating"]
        assert (row.likeliness, row.loveliness) == (own["likeliness"], own["loveliness"])


def test_only_the_kinds_of_the_paper_and_no_others_make_an_experiment_the_papers() -> None:
    frame = made_up_ratings(3)
    assert [one.paper for one in rated_experiments(study_data(frame))] == ["1", "2"]
    other = frame.replace({"kind": {"random": "highlights"}})
    assert [one.paper for one in rated_experiments(study_data(other))] == [None, "2"]


def test_the_kind_that_the_paper_proposes_stands_first_in_a_pair() -> None:
    first, second = rated_experiments(study_data(made_up_ratings(3)))
    assert set(first.pairs("general")) == {("subgoals", "full"), ("full", "random"), ("subgoals", "random")}
    assert second.pairs("general") == (("all_key_points", "first_key_point"),)


def test_what_fails_for_one_reason_is_told_in_one_statement() -> None:
    undecided = Undecided()
    for number in range(8):
        undecided.add(f"thing {number}", Undefined("there are 0"))
    undecided.add("another", Undefined("there is 1"))
    many, one = undecided.statements("a test")
    assert many.subject == "a test: thing 0; thing 1; thing 2; thing 3; thing 4; thing 5 and 2 more"
    assert (one.subject, one.reason) == ("a test: another", "there is 1")


@pytest.mark.parametrize(
    ("p_values", "verdict"),
    [([], "not checkable"), ([0.5, 0.2], "holds"), ([0.03, 0.5], "doubtful"), ([0.01, 0.5], "violated")],
)
def test_an_assumption_is_violated_where_a_test_rejects_after_correction(p_values: list[float], verdict: str) -> None:
    found = [two_samples.TestResult("a test", 1.0, p_value) for p_value in p_values]
    assert rejections("t", "normal", found, "cells").verdict == verdict


def test_ratings_are_independent_only_where_nobody_rates_twice() -> None:
    frame = made_up_ratings(40)
    first, _ = rated_experiments(study_data(frame))
    told = independence("t", first, ["general"])
    assert told.verdict == "violated"
    assert "general 0." in told.check
    alone = frame[(frame["experiment"] == "1") & (frame["trial"] == 1)].reset_index(drop=True)
    assert independence("t", rated_experiments(study_data(alone))[0], ["general"]).verdict == "holds"


def test_ratings_come_as_floats_by_participant() -> None:
    frame = made_up_ratings(5).sample(frac=1, random_state=1).reset_index(drop=True)
    first, _ = rated_experiments(study_data(frame))
    own = frame[(frame["kind"] == "full") & (frame["item"] == "general")].sort_values("participant")
    assert np.array_equal(first.ratings("full", "general"), own["rating"])


def test_an_item_is_not_missed_of_a_kind_that_is_not_asked_about_it() -> None:
    study = parse_study((find_study("understanding") / "study.toml").read_text(encoding="utf-8"))
    (only,) = rated_experiments(replace(study_data(made_up_ratings(3).iloc[:0]), declared=study))
    assert only.kinds == study.experiments[0].kinds
    assert "none" in only.kinds_of("foresee")
    assert "none" not in only.kinds_of("likeliness")
    assert not any("none" in pair for pair in only.pairs("likeliness"))


def test_of_many_kinds_only_the_planned_pairs_are_compared() -> None:
    frame = made_up_ratings(4)
    kinds = ("full", "subgoals", "random", "none", "placebic")
    more = [
        frame,
        frame.replace({"kind": {"full": "none", "random": "placebic"}}).assign(trial=lambda rows: rows.trial + 3),
    ]
    both = pd.concat(more, ignore_index=True)
    data = study_data(both[both["experiment"] == "1"], kinds={"1": kinds})
    (first,) = rated_experiments(data)
    assert first.pairs("general") == tuple(("subgoals", kind) for kind in ("full", "random", "none", "placebic"))


def test_other_scales_than_the_papers_make_an_experiment_another() -> None:
    data = study_data(made_up_ratings(3))
    other = replace(data, points=dict.fromkeys(data.points, 7))
    assert [one.paper for one in rated_experiments(other)] == [None, None]
    assert titled(data, "ratings") == "The paper's analysis, as printed: ratings"
    assert titled(other, "ratings") == "In the paper's way: ratings"
    assert told_apart(data, rated_experiments(data)) == ""
    assert "of scales (7 points and not 5) and of material" in told_apart(other, rated_experiments(other))
