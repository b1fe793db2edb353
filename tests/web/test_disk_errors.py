from pathlib import Path

import pytest

from tests.faults.disk_errors import PROBABILITY, fail_and_compare
from tests.faults.disk_full import fill_and_compare, limited

pytestmark = pytest.mark.sqlite_only(reason="the program itself writes SQLite's file")


def test_errors_of_the_disk_lose_and_double_nothing_and_are_told_as_a_wait(tmp_path: Path) -> None:
    outcome = fail_and_compare(tmp_path / "instance", 150, PROBABILITY)
    assert outcome.is_clean, outcome


def test_a_server_that_acknowledges_what_it_could_not_store_is_found_out(tmp_path: Path) -> None:
    outcome = fill_and_compare(tmp_path / "instance", 1, limited, mutant="careless", patience_s=1)
    assert outcome.verdict.lost > 0
