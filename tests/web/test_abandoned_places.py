from pathlib import Path

import pytest

from tests.faults.abandoned import abandon_and_refill, never_freed, never_taken_again


@pytest.mark.parametrize("has_quota", [False, True])
def test_places_of_those_who_stopped_are_filled_and_those_who_come_late_keep_theirs(
    tmp_path: Path, has_quota: bool
) -> None:
    outcome = abandon_and_refill(tmp_path / "instance", 6, 24, seed=1, has_quota=has_quota)
    assert outcome.is_clean, outcome
    assert outcome.is_complete or has_quota, outcome
    assert outcome.num_late > 0
    assert (outcome.num_refused > 0) == has_quota


@pytest.mark.sqlite_only(reason="each try has a database of its own")
def test_a_program_that_keeps_all_places_is_found_out(tmp_path: Path) -> None:
    with never_freed():
        tries = (abandon_and_refill(tmp_path / str(seed), 6, 24, seed, has_quota=False) for seed in range(8))
        assert any(outcome.refilled_spread > 1 for outcome in tries)


@pytest.mark.sqlite_only(reason="each try has a database of its own")
def test_a_program_that_forgets_who_came_late_is_found_out(tmp_path: Path) -> None:
    with never_taken_again():
        tries = (abandon_and_refill(tmp_path / str(seed), 6, 24, seed, has_quota=False) for seed in range(8))
        assert any(outcome.final_spread > 1 for outcome in tries)
