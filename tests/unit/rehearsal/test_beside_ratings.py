import numpy as np
import pandas as pd
import pytest

from tests.unit.rehearsal.samples import PLAN, STUDY, effects, ratings
from webapp.bots.effects import Effects
from webapp.bots.opinions import expected_rating
from webapp.rehearsal.beside_ratings import beside
from webapp.reports.study_data import StudyData


def data_of(rated: pd.DataFrame, probes: pd.DataFrame | None = None, drives: pd.DataFrame | None = None) -> StudyData:
    points = {(experiment.id, item.id): item.points for experiment in STUDY.experiments for item in experiment.items}
    people = pd.DataFrame({"participant": sorted(set(rated["participant"]))})
    return StudyData(
        study="sakai2021",
        study_version="",
        mode="bot",
        ratings=rated,
        participants=people,
        everybody=None,
        answers=None,
        probes=probes,
        drives=drives,
        declared=STUDY,
        wordings={},
        points=points,
        plan=PLAN,
    )


def outcomes(chances: dict[str, float], num_people: int = 300) -> pd.DataFrame:
    rng = np.random.default_rng(5)
    rows = [
        {"participant": f"p{person}", "experiment": "1", "kind": kind, "hit": rng.random() < chance}
        for person in range(num_people)
        for kind, chance in chances.items()
    ]
    return pd.DataFrame(rows)


def test_equivalences_show_the_difference_of_what_bots_rate_on_average() -> None:
    planted = effects("subgoals=0.4")
    shown = beside(data_of(ratings(planted, 400)), planted)
    assert len(shown) == len(PLAN.equivalences) * 3
    for each in shown[:3]:
        assert each.planted == pytest.approx(expected_rating(5, 0.4) - 3)
        assert each.found == pytest.approx(each.planted, abs=0.2)
    assert shown[0].note == "margin 0.5 points: planted inside, found inside"


def test_a_difference_that_is_too_large_to_be_alike_is_told_in_words() -> None:
    planted = effects("subgoals=1")
    shown = beside(data_of(ratings(planted, 200)), planted)
    assert shown[0].note == "margin 0.5 points: planted outside, found not shown to be inside"


def test_where_nobody_rated_both_kinds_it_says_why_there_is_no_number() -> None:
    rated = ratings(effects())
    shown = beside(data_of(rated[rated["kind"] != "full"]), effects())
    assert [each.found for each in shown[:3]] == [None] * 3
    assert all("0" in each.note for each in shown[:3])


def test_predictions_and_drives_stand_beside_the_chance_that_was_planted() -> None:
    planted = Effects({("subgoals", "probe"): 0.3, ("full", "drive"): -0.9})
    probes = outcomes({"subgoals": 0.9, "full": 0.6}).rename(columns={"hit": "is_correct"})
    drives = outcomes({"subgoals": 0.7, "full": 0.0}).assign(phase="after")
    drives["end"] = np.where(drives.pop("hit"), "reached", "gave_up")
    before = drives.assign(phase="before", end="gave_up")
    shown = beside(data_of(ratings(effects()), probes, pd.concat([drives, before])), planted)
    found = {(each.what, each.name): each for each in shown}
    assert found["right predictions", "subgoals"].planted == pytest.approx(0.9)
    assert found["drives that arrive", "full"].planted == 0
    for each in found.values():
        if each.what != "difference in points":
            assert each.found == pytest.approx(each.planted, abs=0.08)
