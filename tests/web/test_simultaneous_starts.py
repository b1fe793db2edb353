import os
from pathlib import Path

import pytest

from tests.faults.assignment import start_at_once


@pytest.mark.parametrize(("num_cells", "rounds"), [(6, (64, 30)), (24, (64,))])
def test_everybody_who_agrees_at_once_gets_one_place_and_the_arms_stay_balanced(
    tmp_path: Path, num_cells: int, rounds: tuple[int, ...]
) -> None:
    outcome = start_at_once(tmp_path / "instance", num_cells, rounds, url=os.environ.get("DATABASE_URL"))
    assert outcome.is_clean, outcome
    assert outcome.num_participants == sum(rounds)


def test_a_draw_from_what_was_counted_before_is_found_out(tmp_path: Path) -> None:
    url = os.environ.get("DATABASE_URL")
    assert start_at_once(tmp_path / "instance", 6, (40, 40), mutant="unlocked", url=url).spread > 1
