from pathlib import Path

import pandas as pd
import pytest

from tests.unit.power.designs import questions_of
from webapp.power.required import power_table
from webapp.power.settings import PowerSettings
from webapp.power.simulation import Levels, Unit, run_unit, simulate
from webapp.runs.run_folders import open_run

LEVELS = Levels(0.05 / 9, 0.05)
SETTINGS = PowerSettings(effects=(0.5, 2.0), participants=(10, 30), num_studies=22, seed=5)
BOTH = questions_of()
SECOND = BOTH[1:]


def simulated(folder: Path, settings: PowerSettings = SETTINGS, workers: int = 1) -> pd.DataFrame:
    with open_run(folder, {"settings": settings.to_dict()}) as run:
        return simulate(SECOND, settings, LEVELS, run, workers, lambda *_: None)


@pytest.fixture(scope="module")
def counts(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return simulated(tmp_path_factory.mktemp("power") / "run")


def test_the_number_of_workers_changes_nothing(counts: pd.DataFrame, tmp_path: Path) -> None:
    pd.testing.assert_frame_equal(counts, simulated(tmp_path / "run", workers=2))


def test_a_run_that_was_interrupted_goes_on_to_the_same_counts(counts: pd.DataFrame, tmp_path: Path) -> None:
    class Stop(Exception):
        pass

    def stop(done: int, _total: int) -> None:
        if done == 1:
            raise Stop

    with pytest.raises(Stop), open_run(tmp_path / "run", {"settings": SETTINGS.to_dict()}) as run:
        simulate(SECOND, SETTINGS, LEVELS, run, 1, stop)
    pd.testing.assert_frame_equal(counts, simulated(tmp_path / "run"))


def test_other_effects_and_numbers_leave_a_cell_as_it_is(counts: pd.DataFrame, tmp_path: Path) -> None:
    alone = PowerSettings(effects=(0.5,), participants=(10,), num_studies=22, seed=5)
    kept = counts[counts["effect"].isin([0, 0.5]) & (counts["participants"] == 10)].reset_index(drop=True)
    pd.testing.assert_frame_equal(kept, simulated(tmp_path / "run", alone))


def test_every_study_is_counted_once_and_large_effects_are_found(counts: pd.DataFrame) -> None:
    assert counts["num_studies"].eq(22).all()
    large = counts[(counts["effect"] == 2) & (counts["participants"] == 30)]
    assert large["num_significant_first_step"].item() >= 20
    assert (counts["num_significant_first_step"] <= counts["num_significant_last_step"]).all()
    estimates = power_table(counts, SECOND, SETTINGS, LEVELS).set_index(["effect", "participants"])["mean_estimate"]
    assert estimates[2.0, 30] == pytest.approx(2, abs=0.25)
    assert estimates[0.0, 30] == pytest.approx(0, abs=0.25)


def test_what_the_ratings_do_not_determine_is_counted_and_not_significant() -> None:
    settings = PowerSettings(effects=(5.0,), participants=(2,), num_studies=3)
    rows = pd.DataFrame(run_unit(Unit(SECOND[0], 0, 3), settings, LEVELS))
    assert rows["num_undefined"].sum() > 0
    undetermined = rows[rows["num_undefined"] == rows["num_studies"]]
    assert undetermined["num_significant_last_step"].eq(0).all()
    power = power_table(undetermined, SECOND, settings, LEVELS)
    assert power["power_last_step"].eq(0).all()
    assert power["mean_estimate"].isna().all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"effects": (0.0,)}, "effects must lie from 0.01 to 5, not at 0"),
        ({"effects": ()}, "effects must be at least one number"),
        ({"participants": (20, 10)}, "ascending"),
        ({"participants": (1, 10)}, "participants must lie from 2"),
        ({"num_studies": 1}, "num_studies must be 2 or larger, not 1"),
        ({"seed": -1}, "seed must be 0 or larger, not -1"),
        ({"power": 1.0}, "the power must lie between 0 and 1, not at 1"),
        ({"between_sd": 1.0}, "from 0 to below 1, not 1"),
    ],
)
def test_settings_out_of_range_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PowerSettings(**changes)  # type: ignore[arg-type]
