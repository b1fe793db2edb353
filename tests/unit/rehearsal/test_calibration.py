from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.unit.power.designs import study_and_plan
from tests.unit.rehearsal.samples import PLAN, STUDY, effects, ratings
from webapp.bots.opinions import expected_rating
from webapp.rehearsal.calibration import NO_EFFECTS, Calibration, Promise, calibrate, generate_ratings
from webapp.rehearsal.tables import calibration_files, promise_table


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrate(STUDY, PLAN, effects(), num_people=60, num_studies=40, seed=3)


def test_the_planned_analysis_keeps_its_promises(calibration: Calibration) -> None:
    alarms, coverage, found, undetermined = calibration.promises
    assert alarms.low <= 0.05 <= alarms.high
    assert coverage.low <= 0.95 <= coverage.high
    assert alarms.total == 40
    assert coverage.total == 40 * 9
    assert found.share > 0.99
    assert undetermined.num == 0
    assert calibration.is_kept


def test_every_test_of_every_study_is_a_row(calibration: Calibration) -> None:
    assert len(calibration.rows) == 2 * 40 * PLAN.num_tests
    files = calibration_files(calibration)
    assert set(files) == {"calibration.csv", "tests.csv"}
    assert files["tests.csv"].count(b"\n") == len(calibration.rows) + 1
    assert len(promise_table(calibration).rows) == len(calibration.promises)


def test_the_same_seed_gives_the_same_numbers_and_another_seed_others() -> None:
    first, again, other = (calibrate(STUDY, PLAN, effects(), 12, 2, seed).rows for seed in (1, 1, 2))
    pd.testing.assert_frame_equal(first, again)
    assert not first["d"].equals(other["d"])


def test_an_analysis_without_correction_breaks_its_promise() -> None:
    """Nine tests at .05 each err in far more than one of twenty studies, and the calibration says so."""
    uncorrected = replace(PLAN, alpha=0.4)
    found = calibrate(STUDY, uncorrected, NO_EFFECTS, 20, 20, 3)
    alarms = found.promises[0]
    assert Promise(alarms.name, alarms.num, alarms.total, alarms.low, alarms.high, 0.05, is_most=True).word == "broken"


@pytest.mark.parametrize(
    ("low", "high", "is_most", "word"),
    [
        (0.03, 0.08, True, "kept"),
        (0.06, 0.10, True, "broken"),
        (0.01, 0.04, True, "cautious"),
        (0.01, 0.04, False, "broken"),
        (0.06, 0.10, False, "cautious"),
    ],
)
def test_a_promise_is_broken_on_one_side_alone(low: float, high: float, word: str, *, is_most: bool) -> None:
    assert Promise("errors", 1, 20, low, high, 0.05, is_most=is_most).word == word


def test_a_persons_level_is_shared_by_all_items_and_experiments() -> None:
    wide = ratings(effects("subgoals=0"), num_people=4_000).pivot_table(
        index="participant", columns=["experiment", "item", "trial"], values="rating"
    )
    correlations = np.corrcoef(wide.to_numpy().T)
    pairs = correlations[np.triu_indices(len(correlations), 1)]
    # 0.36 between latent ratings, a little less between rounded ones.
    assert pairs == pytest.approx(np.full(len(pairs), 0.33), abs=0.07)


def test_generated_ratings_have_the_means_of_the_bots() -> None:
    means = ratings(effects("subgoals.general=0.8"), num_people=6_000).groupby(["kind", "item"])["rating"].mean()
    assert means["subgoals", "general"] == pytest.approx(expected_rating(5, 0.8), abs=0.05)
    assert means["subgoals", "likeliness"] == pytest.approx(3, abs=0.05)
    assert means["full", "general"] == pytest.approx(3, abs=0.05)


def test_no_item_is_rated_after_a_kind_that_it_is_not_asked_about() -> None:
    study, plan = study_and_plan("understanding")
    rated = generate_ratings(study, plan, NO_EFFECTS, 24, np.random.default_rng(0))
    assert set(rated.loc[rated["kind"] == "none", "item"]) == {"foresee"}


def test_too_few_studies_are_refused() -> None:
    with pytest.raises(ValueError, match="calibrating needs 2 studies and a planned test, not 1 and 9"):
        calibrate(STUDY, PLAN, NO_EFFECTS, 60, 1, 0)
