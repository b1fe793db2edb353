"""The planned model of a study's ratings: its contrasts and tests against R, its promises by simulation."""

import itertools
import json
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tests.conftest import ROOT
from webapp.analysis import planned_model
from webapp.analysis.censoring import Undefined
from webapp.analysis.multiplicity import holm
from webapp.analysis.planned_model import Effect, RatioTest, ShapeTest, fit_planned

GOLDEN = ROOT / "tests" / "golden" / "analysis"
FROM_R: dict[str, Any] = json.loads((GOLDEN / "clmm.json").read_text(encoding="utf-8"))
KINDS = ("full", "subgoals", "random")


def ratings_of_r() -> pd.DataFrame:
    return pd.read_csv(GOLDEN / "ratings.csv").rename(columns={"person": "participant"})


def simulated(num_people: int, shift: float, seed: int) -> pd.DataFrame:
    """Everybody sees the three kinds once, in every order equally often; the latent rating has the variance 1."""
    rng = np.random.default_rng(seed)
    orders = list(itertools.permutations(KINDS))
    rows = [
        (person, kind, f"layout{place}", place + 1)
        for person in range(num_people)
        for place, kind in enumerate(orders[person % len(orders)])
    ]
    frame = pd.DataFrame(rows, columns=["participant", "kind", "layout", "trial"])
    latent = 3 + rng.normal(0, 0.6, num_people)[frame["participant"]] + rng.normal(0, 0.8, len(frame))
    frame["rating"] = np.clip(np.round(latent + shift * (frame["kind"] == "subgoals")), 1, 5).astype(int)
    return frame


def shape_of(frame: pd.DataFrame) -> ShapeTest:
    return planned_model.check_shape(fit_planned(frame, KINDS))


def test_contrasts_are_those_of_emmeans_on_clmm() -> None:
    planned, known = fit_planned(ratings_of_r(), num_nodes=21), FROM_R["contrasts"]
    effects = [planned.contrast(*name.split("-")) for name in known["names"]]
    assert [effect.value for effect in effects] == pytest.approx(known["estimates"], rel=1e-4)
    assert [effect.standard_error for effect in effects] == pytest.approx(known["standard_errors"], rel=5e-5)
    assert [effect.z for effect in effects] == pytest.approx(known["z"], rel=1e-4)
    by_normal = [2 * stats.norm.sf(abs(effect.z)) for effect in effects]
    assert holm(by_normal) == pytest.approx(known["holm"], rel=1e-3)


@pytest.mark.parametrize("factor", ["kind", "layout"])
def test_likelihood_ratio_tests_are_those_of_anova_on_clmm(factor: str) -> None:
    found = fit_planned(ratings_of_r(), num_nodes=11).tests[factor]
    assert isinstance(found, RatioTest)
    statistic, df, p_value = FROM_R[f"without {factor}"]
    assert found.statistic == pytest.approx(statistic, rel=1e-4)
    assert found.df == df
    assert found.p_value == pytest.approx(p_value, rel=1e-3)


def test_a_fixed_order_of_layouts_leaves_position_out_and_says_so() -> None:
    planned = fit_planned(simulated(12, 0.0, 1), KINDS)
    assert planned.aliased == ("position 2, 3 cannot be told from kinds and layouts in this design",)
    assert planned.tests["position"] == planned.aliased[0]
    assert set(planned.columns) == {"kind", "layout"}


def test_a_counterbalanced_order_keeps_position() -> None:
    frame = simulated(24, 0.0, 1)
    turn = frame["participant"] // 6
    frame["trial"] = (frame["trial"] - 1 + turn) % 3 + 1
    planned = fit_planned(frame, KINDS)
    assert not planned.aliased
    assert isinstance(planned.tests["position"], RatioTest)


def test_the_difference_from_a_to_b_is_minus_that_from_b_to_a() -> None:
    planned = fit_planned(simulated(30, 0.7, 2), KINDS)
    there, back = planned.contrast("subgoals", "random"), planned.contrast("random", "subgoals")
    assert (there.value, there.d, there.p_value) == pytest.approx((-back.value, -back.d, back.p_value))
    chain = planned.contrast("subgoals", "full").value + planned.contrast("full", "random").value
    assert chain == pytest.approx(there.value)


def test_which_kind_comes_first_changes_no_contrast() -> None:
    frame = simulated(30, 0.7, 2)
    effects = [fit_planned(frame, order).contrast("subgoals", "random") for order in itertools.permutations(KINDS)]
    assert [effect.d for effect in effects] == pytest.approx([effects[0].d] * 6, abs=1e-6)
    assert [effect.p_value for effect in effects] == pytest.approx([effects[0].p_value] * 6, rel=1e-4)


def test_a_kind_that_nobody_rated_has_no_contrast_and_spoils_no_other() -> None:
    frame = simulated(30, 0.7, 2)
    planned = fit_planned(frame[frame["kind"] != "full"], KINDS)
    assert planned.contrast("subgoals", "random").d > 0
    with pytest.raises(Undefined, match="nobody rated the kind full"):
        planned.contrast("subgoals", "full")


def test_intervals_hold_the_planted_difference_and_nothing_is_found_where_nothing_is() -> None:
    """200 studies each: the shares lie within what 200 draws allow (binomial, 99.9 %)."""
    held, found, alarmed = 0, 0, 0
    for seed in range(200):
        effect = fit_planned(simulated(40, 0.6, seed), KINDS).contrast("subgoals", "random")
        none = fit_planned(simulated(40, 0.0, 1000 + seed), KINDS).contrast("subgoals", "random")
        held += effect.d_low < 0.6 < effect.d_high
        found += effect.p_value < 0.05
        alarmed += none.p_value < 0.05
    assert stats.binomtest(held, 200, 0.95).pvalue > 0.001
    assert stats.binomtest(alarmed, 200, 0.05).pvalue > 0.001
    assert found > 120  # A power of .8 or so; a model that finds nothing would pass the rest.


def test_few_people_get_a_wider_interval_than_the_normal_one() -> None:
    effect = Effect(1.0, 0.5, 10, 0.8, 0.4)
    assert effect.d_high - effect.d > 1.96 * 0.4
    assert effect.p_value == pytest.approx(2 * stats.t.sf(2, 10))


def test_a_kind_that_only_spreads_ratings_is_no_shift_and_the_shape_test_says_so() -> None:
    rng = np.random.default_rng(3)
    frame = simulated(150, 0.0, 3)
    wide = frame["kind"] == "random"
    frame.loc[wide, "rating"] = rng.choice([1, 2, 3, 4, 5], size=int(wide.sum()), p=[0.4, 0.08, 0.04, 0.08, 0.4])
    assert shape_of(frame).ratio.p_value < 1e-4
    assert shape_of(simulated(150, 0.4, 3)).ratio.p_value > 1e-3


def test_neighbouring_ratings_count_as_one_where_a_kind_lacks_one() -> None:
    frame = simulated(60, 0.0, 4)
    frame.loc[(frame["kind"] == "full") & (frame["rating"] == 1), "rating"] = 2
    frame.loc[(frame["kind"] == "random") & (frame["rating"] == 5), "rating"] = 4
    found = shape_of(frame)
    assert found.bins == ((1, 2), (3,), (4, 5))
    assert found.words == "1-2, 3, 4-5"
    assert found.ratio.df == 2  # Three kinds with two thresholds each, against two shifts of two thresholds.


def test_the_shape_cannot_be_tested_where_kinds_have_too_few_ratings_in_common() -> None:
    frame = simulated(40, 0.0, 4)
    frame["rating"] = np.where(frame["kind"] == "full", frame["rating"].clip(upper=3), frame["rating"].clip(lower=2))
    frame.loc[frame["kind"] == "full", "rating"] = frame.loc[frame["kind"] == "full", "rating"].clip(lower=2)
    with pytest.raises(Undefined, match="too few ratings in common"):
        shape_of(frame.replace({"rating": {5: 3, 4: 3}}))


@pytest.mark.parametrize(
    ("spread", "told"),
    [
        ({1: 5, 2: 5, 3: 5, 4: 5}, "every rating of random is 5 or higher, every other one 5 or lower"),
        ({2: 1, 3: 1, 4: 1, 5: 1}, "every rating of random is 1 or lower, every other one 1 or higher"),
    ],
)
def test_a_kind_beyond_all_others_has_no_estimate_and_spoils_no_other(spread: dict[int, int], told: str) -> None:
    frame = simulated(60, 0.6, 5)
    random = frame["kind"] == "random"
    frame.loc[random, "rating"] = frame.loc[random, "rating"].replace(spread)
    planned = fit_planned(frame, KINDS)
    with pytest.raises(Undefined, match=told):
        planned.contrast("subgoals", "random")
    alone = fit_planned(frame[~random], KINDS).contrast("subgoals", "full")
    assert planned.contrast("subgoals", "full").d == pytest.approx(alone.d)


def test_kinds_that_only_touch_have_no_estimate_either() -> None:
    """Between them lies nothing: the likelihood of 1, 2, 3 against 3, 4, 5 grows for ever with the difference."""
    frame = simulated(30, 0.0, 6)
    low = frame["kind"] != "subgoals"
    frame["rating"] = np.where(low, frame["rating"].clip(upper=3), frame["rating"].clip(lower=3))
    planned = fit_planned(frame, KINDS)
    with pytest.raises(Undefined, match="every rating of subgoals is 3 or higher"):
        planned.contrast("subgoals", "random")
    assert np.isfinite(planned.contrast("full", "random").d)


def test_too_few_ratings_for_their_effects_give_a_reason_and_no_interval() -> None:
    with pytest.raises(
        Undefined, match="9 ratings of 3 people leave 2 degrees of freedom beside 4 effects, fewer than 3"
    ):
        fit_planned(simulated(3, 0.0, 6), KINDS)
