from pathlib import Path

import pytest

from tests.faults.restarts import restart_and_compare

pytestmark = pytest.mark.sqlite_only(reason="it starts a server on SQLite's file; `make soak` has PostgreSQL's")


def test_a_restart_while_people_take_part_fails_nobody_and_signs_nobody_out(tmp_path: Path) -> None:
    outcome = restart_and_compare(tmp_path / "instance", num_restarts=2, num_people=8, think_s=0.1, pause_s=0.5)
    assert outcome.is_clean, outcome
    assert outcome.num_people >= 8
    assert outcome.num_again > 0


def test_a_server_with_a_key_for_each_start_is_found_out(tmp_path: Path) -> None:
    outcome = restart_and_compare(tmp_path / "instance", 1, 2, mutant="own_key", think_s=0.1, pause_s=0.3)
    assert outcome.num_signed_out > 0
    assert outcome.num_researchers_signed_out > 0
