from pathlib import Path

import pytest

from tests.faults.power_cut import Setting, controls, cut_power, settings

pytestmark = pytest.mark.sqlite_only(reason="a power cut of SQLite's file")


@pytest.mark.parametrize("setting", settings(), ids=lambda setting: setting.name)
def test_a_power_cut_takes_nothing_that_was_acknowledged(setting: Setting, tmp_path: Path) -> None:
    outcome = cut_power(setting, range(10), tmp_path)
    assert outcome.is_clean, outcome
    assert outcome.num_acknowledged > 50


@pytest.mark.parametrize("control", controls(), ids=lambda control: control.name)
def test_who_syncs_less_or_acknowledges_too_early_loses_something(control: Setting, tmp_path: Path) -> None:
    """The simulation notices what it is there for; most of these lose something at the first cut."""
    assert any(not cut_power(control, [seed], tmp_path).is_clean for seed in range(40))
