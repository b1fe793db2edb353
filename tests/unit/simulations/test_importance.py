import io
import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.mdps import oracle_of
from webapp.explainer.importance import PROBABILITY_KINDS
from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import parse_layout
from webapp.simulations.importance import SETTINGS, ImportanceSettings, run, summarise
from webapp.simulations.importance_claims import claims_about

GOLDEN: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "golden" / "method-numbers.json").read_text(encoding="utf-8")
)["simulation"]
CORRIDOR = "#######\n#K<.DG#\n#######\n"
COLUMNS = [
    *("importance", "estimator", "policy", "step", "state", "action"),
    *("value", "standard_error", "low", "high", "threshold", "is_subgoal"),
]
SIMULATION = replace(SETTINGS["paper"], learned=False)
TWO_ROOMS = ImportanceSettings(CORRIDOR, "corridor", num_trials=2000, random_steps=3, learned=False)


@cache
def rows_of(settings: ImportanceSettings) -> pd.DataFrame:
    with TemporaryDirectory() as folder:
        return run(settings, Path(folder), lambda *_: None)


def series(rows: pd.DataFrame, kind: str, estimator: str) -> pd.DataFrame:
    return rows[(rows["importance"] == kind) & (rows["estimator"] == estimator)]


def verdicts(settings: ImportanceSettings, rows: pd.DataFrame, estimator: str) -> dict[str, str]:
    claims = claims_about(settings, rows)
    own = claims[(claims["estimator"] == estimator) & (claims["importance"] == "return_probability")]
    return dict(zip(own["claim"], own["verdict"], strict=True))


def changed(rows: pd.DataFrame, estimator: str, step: int, **columns: float) -> pd.DataFrame:
    """Return the rows with other numbers at one step of the return probability."""
    place = (rows["importance"] == "return_probability") & (rows["estimator"] == estimator) & (rows["step"] == step)
    assert place.sum() == 1
    return rows.assign(**{name: rows[name].mask(place, value) for name, value in columns.items()})


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_the_exact_values_are_those_that_another_implementation_computed(kind: str) -> None:
    found, known = series(rows_of(SIMULATION), kind, "exact"), GOLDEN[kind]["10"]
    np.testing.assert_allclose(found["value"], known["importance"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found["threshold"], known["threshold"], rtol=0, atol=1e-9)
    assert found.loc[found["is_subgoal"], "step"].tolist() == known["subgoal_steps"]
    assert found["action"].tolist()[:-1] == GOLDEN["actions"]


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_on_another_map_the_exact_values_are_those_of_enumerating_all_random_actions(kind: str) -> None:
    mdp = tabulate(parse_layout(CORRIDOR))
    policy = plan(mdp)
    slow = oracle_of(mdp, policy)
    expected = [float(getattr(slow, kind)(state, 3)) for state in follow(mdp, policy).states[:-1]]
    np.testing.assert_allclose(series(rows_of(TWO_ROOMS), kind, "exact")["value"], [*expected, 0.0], atol=1e-12)


@pytest.mark.parametrize("settings", [SIMULATION, TWO_ROOMS], ids=["simulation", "corridor"])
@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_sampled_values_lie_within_five_standard_errors_of_the_exact_ones(
    kind: str, settings: ImportanceSettings
) -> None:
    exact, sampled = (series(rows_of(settings), kind, name) for name in ("exact", "sampled"))
    apart = np.abs(sampled["value"].to_numpy() - exact["value"].to_numpy())
    assert np.all(apart <= 5 * np.maximum(sampled["standard_error"].to_numpy(), 0.5 / settings.num_trials))


def test_there_is_one_row_per_importance_estimator_and_step() -> None:
    rows = rows_of(SIMULATION)
    assert rows.columns.tolist() == COLUMNS
    counts = rows.groupby(["importance", "estimator"])["step"].apply(list)
    assert set(counts.index) == {(kind, name) for kind in PROBABILITY_KINDS for name in ("exact", "sampled")}
    assert all(steps == list(range(1, 22)) for steps in counts)


def test_what_is_exact_has_no_error_and_what_is_sampled_has_one() -> None:
    rows = rows_of(SIMULATION)
    uncertain = rows[["standard_error", "low", "high"]]
    assert uncertain[rows["estimator"] == "exact"].isna().all(axis=None)
    assert uncertain[rows["estimator"] == "sampled"].notna().all(axis=None)


def test_the_target_has_no_action_and_no_doubt() -> None:
    targets = rows_of(SIMULATION).query("step == 21")
    assert targets["action"].isna().all()
    assert (targets["value"] == 0).all()
    assert targets.query("estimator == 'sampled'")[["standard_error", "low", "high"]].eq(0).all(axis=None)


def test_a_probabilitys_limits_are_the_chances_from_which_it_lies_1_96_standard_errors_away() -> None:
    sampled = series(rows_of(SIMULATION), "return_probability", "sampled")[:-1]
    for value, *limits in sampled[["value", "low", "high"]].itertuples(index=False):
        for limit in limits:
            error = math.sqrt(limit * (1 - limit) / SIMULATION.num_trials)
            assert abs(value - limit) == pytest.approx(1.959964 * error, abs=1e-6)


def test_a_differences_limits_lie_1_96_standard_errors_to_either_side_within_its_range() -> None:
    for row in series(rows_of(SIMULATION), "ace", "sampled").itertuples():
        margin = 1.959964 * float(row.standard_error)
        assert row.low == pytest.approx(max(row.value - margin, -1), abs=1e-6)
        assert row.high == pytest.approx(min(row.value + margin, 1), abs=1e-6)


def test_states_are_said_in_words() -> None:
    states = series(rows_of(TWO_ROOMS), "ace", "exact")["state"].tolist()
    assert states[0] == "(2, 1) facing left, no key, door shut"
    assert states[-1] == "(5, 1) facing right, key, door open"


def test_equal_settings_give_equal_rows_and_another_seed_gives_others(tmp_path: Path) -> None:
    pd.testing.assert_frame_equal(run(TWO_ROOMS, tmp_path, lambda *_: None), rows_of(TWO_ROOMS))
    other = run(replace(TWO_ROOMS, seed=1), tmp_path, lambda *_: None)
    assert not other["value"].equals(rows_of(TWO_ROOMS)["value"])


def test_what_is_being_estimated_is_reported_from_nothing_to_all(tmp_path: Path) -> None:
    told: list[tuple[str, float]] = []
    run(TWO_ROOMS, tmp_path, lambda stage, share: told.append((stage, share)))
    assert told[0] == ("return_probability, exact", 0.0)
    assert told[-1] == ("all estimated", 1.0)
    assert [share for _, share in told] == sorted(share for _, share in told)


def test_every_statement_of_the_paper_holds_exactly_for_both_importances() -> None:
    claims = claims_about(SIMULATION, rows_of(SIMULATION)).query("estimator == 'exact'")
    assert (claims["verdict"] == "holds").all()
    assert claims["importance"].value_counts().to_dict() == {"return_probability": 8, "ace": 8}
    assert claims["found"].str.contains("get key: 7; pass through door: 14, 15, 16; reach goal: 20").sum() == 1
    assert claims["found"].value_counts()["key points pass through door (16), reach goal (20)"] == 2
    assert claims["found"].value_counts()["explanation pass through door (16)"] == 2


def test_a_sampled_statement_is_undecided_where_an_interval_holds_the_mean() -> None:
    rows = changed(rows_of(SIMULATION), "sampled", 7, low=0.1)
    found = verdicts(SIMULATION, rows, "sampled")
    undecided = {claim for claim, verdict in found.items() if verdict == "undecided"}
    assert undecided == {
        "The importance is above the mean where the key is taken.",
        "The subgoals are get key, pass through door and reach goal.",
    }
    # The questioner takes the key, too, so that it is no key point whatever its importance.
    assert found["For the misunderstood door the explanation is pass through door."] == "holds"


def test_an_open_side_that_cannot_change_a_subgoal_leaves_the_verdict_alone() -> None:
    # Step 13 lies before the door: whether it is above the mean or not, the subgoal is where importance falls.
    rows = changed(rows_of(SIMULATION), "sampled", 13, low=0.1)
    assert (
        verdicts(SIMULATION, rows, "sampled")["The subgoals are get key, pass through door and reach goal."] == "holds"
    )


def test_what_is_surely_otherwise_does_not_hold() -> None:
    rows = changed(rows_of(SIMULATION), "sampled", 7, value=0.02, low=0.01, high=0.03)
    found = verdicts(SIMULATION, rows, "sampled")
    assert found["The importance is above the mean where the key is taken."] == "does not hold"
    assert found["The subgoals are get key, pass through door and reach goal."] == "does not hold"


def test_a_peak_elsewhere_is_noticed_and_one_that_may_be_elsewhere_is_undecided() -> None:
    claim = "The highest importance of all lies at one of the steps that the paper names."
    assert verdicts(SIMULATION, changed(rows_of(SIMULATION), "exact", 3, value=0.9), "exact")[claim] == "does not hold"
    assert verdicts(SIMULATION, changed(rows_of(SIMULATION), "sampled", 3, high=0.9), "sampled")[claim] == "undecided"


def test_another_question_is_not_held_against_the_papers() -> None:
    unasked = replace(SIMULATION, believed_layout=None)
    elsewhere = replace(SIMULATION, believed_layout=str(parse_layout(SIMULATION.layout).with_door_at((4, 3))))
    for settings in (unasked, elsewhere):
        claims = claims_about(settings, rows_of(SIMULATION))
        assert not claims["claim"].str.contains("misunderstood").any()
        assert claims["claim"].str.contains("subgoals").any()


def test_on_another_map_nothing_is_compared_and_the_files_say_so() -> None:
    files = summarise(TWO_ROOMS, rows_of(TWO_ROOMS))
    claims = pd.read_csv(io.BytesIO(files["claims.csv"]))
    assert claims["claim"].tolist() == ["None: what the paper says is about its own map only."]
    assert claims["verdict"].isna().all()
    assert "None: what the paper says is about its own map only." in files["summary.md"].decode()


def test_the_papers_map_is_known_by_its_cells_and_not_by_its_name() -> None:
    assert replace(SIMULATION, layout_name="mine").is_the_papers_question
    assert not replace(TWO_ROOMS, layout_name="simulation").is_the_papers_map


def test_the_summary_holds_every_claim_every_figure_and_every_step() -> None:
    files = summarise(SIMULATION, rows_of(SIMULATION))
    text = files["summary.md"].decode()
    claims = pd.read_csv(io.BytesIO(files["claims.csv"]))
    for claim in claims["claim"]:
        assert f"| {claim} " in text
    for name in ("importance.svg", "derivation.svg", "conceptual.svg"):
        assert f"]({name})" in text
        assert {name, name.replace("svg", "png")} <= set(files)
    for state in rows_of(SIMULATION)["state"]:
        assert f"| {state} " in text
    assert "ours" in text
    assert "Largest difference between *sampled* and *exact*" in text


def test_what_does_not_hold_is_told_with_its_numbers() -> None:
    rows = changed(rows_of(SIMULATION), "sampled", 7, low=0.1)
    text = summarise(SIMULATION, rows)["summary.md"].decode()
    line = next(
        line for line in text.splitlines() if "undecided" in line and "steps whose interval holds it: 7" in line
    )
    assert "subgoals get key (7), pass through door (16), reach goal (20)" in line


def test_rows_read_back_from_a_file_give_the_same_files() -> None:
    rows = rows_of(SIMULATION)
    stored = pd.read_csv(io.StringIO(rows.to_csv(index=False)))
    assert summarise(SIMULATION, stored) == summarise(SIMULATION, rows)


@pytest.mark.parametrize("name", SETTINGS)
def test_the_presets_misplace_the_papers_door_and_can_be_written_down(name: str) -> None:
    settings = SETTINGS[name]
    assert settings.is_the_papers_question
    written = json.loads(json.dumps(settings.to_dict()))
    assert ImportanceSettings(**written | {"importances": tuple(written["importances"])}) == settings
    names = [parse_layout(settings.layout), parse_layout(str(settings.believed_layout))]
    assert [layout.door for layout in names] == [(4, 4), (4, 2)]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"seed": -1}, "seed must be 0 or larger, not -1"),
        ({"random_steps": -2}, "random_steps must be 0 or larger, not -2"),
        ({"num_trials": 0}, "from 1 to 1,000,000, not 0"),
        ({"importances": ()}, "one or more different importances"),
        ({"importances": ("ace", "ace")}, "one or more different importances"),
        ({"importances": ("reward_importance",)}, "'reward_importance' is nothing that can be sampled"),
        ({"layout": "#######\n#K<#DG#\n#######"}, "corridor, line 2, column 6: the goal cannot be reached"),
        ({"believed_layout": "######\n#K<DG#\n######"}, "6 cells wide"),
    ],
)
def test_settings_that_make_no_sense_are_refused_before_anything_is_learned(
    wrong: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        replace(TWO_ROOMS, **wrong)


@pytest.mark.slow
def test_the_learned_world_gives_the_rules_values_and_the_agents_own_path_arrives(tmp_path: Path) -> None:
    settings = replace(SETTINGS["quick"], num_trials=400, learned=True)
    rows = run(settings, tmp_path, lambda *_: None)
    for kind in PROBABILITY_KINDS:
        exact, learned, sampled, own = (
            series(rows, kind, name) for name in ("exact", "learned exact", "learned sampled", "agent exact")
        )
        # The stop test asks the learned table to be right wherever the agent can be, so this is equality.
        np.testing.assert_allclose(learned["value"], exact["value"], rtol=0, atol=1e-12)
        apart = np.abs(sampled["value"].to_numpy() - exact["value"].to_numpy())
        assert np.all(apart <= 5 * np.maximum(sampled["standard_error"].to_numpy(), 0.5 / settings.num_trials))
        assert set(own["policy"]) == {"dqn"}
        assert own["state"].iloc[-1].startswith("(6, 6)")
    text = summarise(settings, rows)["summary.md"].decode()
    assert "Largest difference between *learned exact* and *exact*: 0." in text
    assert "agent exact" in text
