from pathlib import Path

from tests import postgres
from tests.faults.postgres_faults import KINDS
from tests.faults.postgres_kills import kill_and_compare


def test_workers_and_a_database_that_are_killed_lose_double_and_change_nothing_and_are_back_at_once(
    tmp_path: Path, postgres_server: postgres.Server
) -> None:
    outcome = kill_and_compare(tmp_path / "instance", postgres_server, 1, 0)
    assert outcome.is_clean, outcome
    assert outcome.kills == dict.fromkeys(KINDS, 1)
    assert len(outcome.recoveries_s) == 3
    assert outcome.num_pages > 40


def test_workers_that_store_whatever_comes_are_found_out(tmp_path: Path, postgres_server: postgres.Server) -> None:
    tries = (
        kill_and_compare(tmp_path / f"instance-{number}", postgres_server, 1, 0, kinds=["all_workers"], mutant="naive")
        for number in range(5)
    )
    assert any(outcome.verdict.doubled > 0 for outcome in tries), "a kill has to fall between a commit and its answer"
