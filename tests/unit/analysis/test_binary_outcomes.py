import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from webapp.analysis.binary_outcomes import Ratio, columns_of, fit_binary, without_constant_levels
from webapp.analysis.censoring import Undefined

FOLDER = Path(__file__).parents[2] / "golden" / "analysis"
GOLDEN: dict[str, Any] = json.loads((FOLDER / "mixed_logistic.json").read_text())
DATA = pd.read_csv(FOLDER / "mixed_logistic.csv").assign(right=lambda frame: frame["right"] == 1)
ROWS = st.lists(
    st.tuples(
        st.sampled_from(["p1", "p2", "p3", "p4"]),
        st.sampled_from(["full", "none", "subgoals"]),
        st.sampled_from(["a", "b"]),
        st.integers(1, 2),
        st.booleans(),
    ),
    max_size=25,
)


def frame_of(rows: list[tuple[str, str, str, int, bool]]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=["participant", "kind", "layout", "trial", "right"])


def test_the_mixed_logistic_model_is_that_of_rs_glmer_to_four_digits() -> None:
    found = fit_binary(DATA)
    intercept, *effects = GOLDEN["coefficients"]
    assert found.fit.thresholds[0] == pytest.approx(-intercept, rel=5e-4)
    assert found.fit.coefficients == pytest.approx(effects, rel=5e-4)
    assert found.fit.sd == pytest.approx(GOLDEN["sd"], rel=5e-4)
    assert found.fit.log_likelihood == pytest.approx(GOLDEN["log_likelihood"], rel=1e-5)
    ratio = found.odds_ratio("subgoals", "none")
    assert np.log(ratio.value) == pytest.approx(GOLDEN["subgoals_none"]["log_odds"], rel=5e-4)
    assert np.log(ratio.value) / ratio.t == pytest.approx(GOLDEN["subgoals_none"]["error"], rel=1e-3)


def test_average_probabilities_are_those_that_r_integrates() -> None:
    found = fit_binary(DATA)
    for kind, expected in zip(("full", "none", "subgoals"), GOLDEN["average"], strict=True):
        value, low, high = found.probability(kind)
        assert value == pytest.approx(expected, rel=5e-4)
        assert low < value < high


def test_average_probabilities_are_near_the_raw_shares_of_a_balanced_design() -> None:
    found = fit_binary(DATA)
    for kind, share in DATA.groupby("kind")["right"].mean().items():
        assert found.probability(str(kind))[0] == pytest.approx(share, abs=0.02)


def test_one_kind_over_another_is_the_inverse_of_the_other_over_the_one() -> None:
    found = fit_binary(DATA)
    ours, theirs = found.odds_ratio("full", "none"), found.odds_ratio("none", "full")
    assert ours.value * theirs.value == pytest.approx(1)
    assert (ours.low, ours.high) == pytest.approx((1 / theirs.high, 1 / theirs.low))
    assert ours.p_value == pytest.approx(theirs.p_value)


def test_a_kind_after_which_everybody_is_right_is_left_out_and_named() -> None:
    data = DATA.assign(right=DATA["right"] | (DATA["kind"] == "full"))
    found = fit_binary(data)
    assert found.left_out == ("kind=full: all of 80 yes",)
    assert found.kinds == ("none", "subgoals")
    with pytest.raises(Undefined, match="full is not in the model"):
        found.odds_ratio("full", "none")
    with pytest.raises(Undefined, match="full is not in the model"):
        found.probability("full")


def test_to_leave_a_constant_level_out_is_the_limit_of_the_likelihood() -> None:
    nearly = DATA.assign(right=DATA["right"] | (DATA["layout"] == "c"))
    without = fit_binary(nearly)
    assert without.left_out == ("layout=c: all of 80 yes",)
    only = DATA[DATA["layout"] != "c"].reset_index(drop=True)
    assert without.fit.coefficients == pytest.approx(fit_binary(only).fit.coefficients)


@given(ROWS)
@settings(max_examples=60, deadline=None)
def test_any_small_frame_gives_finite_numbers_or_a_reason(rows: list[tuple[str, str, str, int, bool]]) -> None:
    try:
        found = fit_binary(frame_of(rows))
    except Undefined:
        return
    for first in found.kinds:
        assert all(np.isfinite(found.probability(first)))
        for second in found.kinds:
            if first == second:
                continue
            try:
                ratio = found.odds_ratio(first, second)
            except Undefined:
                continue
            assert 0 < ratio.low <= ratio.value <= ratio.high < np.inf
            assert 0 <= ratio.p_value <= 1


def test_effects_that_others_determine_are_left_out_with_kinds_first() -> None:
    frame = frame_of([("p", "full", "a", 1, True), ("p", "none", "b", 2, False), ("p", "full", "a", 1, False)])
    found = columns_of(frame, ("kind", "layout", "trial"), ())
    assert (found.names, found.aliased) == (("kind=none",), ("layout=b", "trial=2"))


@given(ROWS)
def test_columns_can_always_be_told_apart(rows: list[tuple[str, str, str, int, bool]]) -> None:
    frame = frame_of(rows)
    found = columns_of(frame, ("kind", "layout", "trial"), ())
    with_constant = np.column_stack([np.ones(len(frame)), found.x])
    assert np.linalg.matrix_rank(with_constant) == (with_constant.shape[1] if rows else 0)


def test_only_levels_without_any_yes_are_left_out_on_demand() -> None:
    frame = frame_of([("p", "full", "a", 1, True), ("p", "none", "a", 1, False), ("q", "full", "a", 1, True)])
    kept, left_out = without_constant_levels(frame, ("kind",), only_none=True)
    assert (len(kept), left_out) == (2, ("kind=none: none of 1 yes",))


@pytest.mark.parametrize(("estimate", "error"), [(1.0, 0.0), (1.0, np.nan), (40.0, 1.0), (0.0, 100.0)])
def test_a_ratio_without_bound_is_none(estimate: float, error: float) -> None:
    with pytest.raises(Undefined, match="without bound"):
        Ratio.of(estimate, error, 20)


def test_a_ratio_is_held_to_students_t() -> None:
    found = Ratio.of(1.0, 0.5, 10)
    assert (found.t, found.df) == (2.0, 10)
    assert found.p_value == pytest.approx(2 * stats.t.sf(2, 10))
    assert np.log(found.high) == pytest.approx(1 + 0.5 * stats.t.ppf(0.975, 10))


def test_what_compares_people_has_as_many_degrees_of_freedom_as_people_allow() -> None:
    own = DATA.groupby("participant").ngroup()
    data = DATA.assign(age=own % 7, mood=np.arange(len(DATA)) % 5)
    found = fit_binary(data, ("layout",), ("age", "mood"))
    num_people, num_effects = DATA["participant"].nunique(), len(found.columns.names)
    assert found.effect("age").df == num_people - 2
    assert found.effect("mood").df == len(DATA) - num_people - num_effects


def test_an_effect_that_is_not_there_is_said() -> None:
    with pytest.raises(Undefined, match="within is not in the model"):
        fit_binary(DATA).effect("within")
