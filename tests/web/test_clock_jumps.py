from pathlib import Path

import pytest

from tests.faults.clock import JUMPS, jump_and_compare, signs_of_life_as_they_come


@pytest.mark.parametrize("name", JUMPS)
def test_a_clock_that_jumps_signs_nobody_out_and_changes_nothing(tmp_path: Path, name: str) -> None:
    outcome = jump_and_compare(tmp_path / "instance", JUMPS[name], 2)
    assert outcome.is_clean(JUMPS[name]), outcome


def test_places_of_people_whose_last_sign_seems_older_would_go_too_early(tmp_path: Path) -> None:
    with signs_of_life_as_they_come():
        outcome = jump_and_compare(tmp_path / "instance", JUMPS["ten minutes back, right again"], 2)
    assert outcome.num_places_lost == 2
