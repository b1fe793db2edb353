from pathlib import Path

import pytest

from tests.faults.kills import kill_and_compare, read_arguments

pytestmark = pytest.mark.sqlite_only(reason="it reads SQLite's file while the server is killed")


def test_a_server_killed_again_and_again_loses_doubles_and_changes_nothing(tmp_path: Path) -> None:
    outcome = kill_and_compare(tmp_path / "instance", num_kills=8, num_ratings=0)
    assert outcome.is_clean, outcome
    assert outcome.num_kills == 8
    assert outcome.num_pages > 40


def test_a_server_that_acknowledges_before_it_commits_is_found_out(tmp_path: Path) -> None:
    tries = (kill_and_compare(tmp_path / f"instance-{number}", 3, 0, mutant="hasty") for number in range(5))
    assert any(outcome.verdict.lost > 0 for outcome in tries), "a kill has to fall between an answer and its commit"


def test_a_server_that_inserts_whatever_comes_is_found_out(tmp_path: Path) -> None:
    tries = (kill_and_compare(tmp_path / f"instance-{number}", 3, 0, mutant="naive") for number in range(12))
    assert any(outcome.verdict.doubled > 0 for outcome in tries), "a kill has to fall between a commit and its answer"


@pytest.mark.parametrize(
    ("said", "wanted"),
    [
        ("", (8, 200, 1)),
        ("--full", (50, 10_000, 1)),
        ("--long --seed 7", (1000, 100_000, 7)),
        ("--full --long", (1000, 100_000, 1)),
        ("--kills 3 --ratings 20", (3, 20, 1)),
    ],
)
def test_how_much_is_tried_is_what_was_said(said: str, wanted: tuple[int, int, int]) -> None:
    given = read_arguments(said.split(), "Kill.", "kills", few=8, full=(50, 10_000), long=(1000, 100_000))
    assert given == wanted
