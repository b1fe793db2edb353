"""How a terminal and a log show a sweep, and what is printed of the claims."""

import re
from io import StringIO

import pandas as pd
import pytest
from rich.console import Console
from rich.progress import Progress

from webapp.simulations.console import claims_table, shown_runs, time_left


def test_a_log_gets_a_line_for_each_stack_with_the_time_left() -> None:
    log = StringIO()
    with shown_runs(Console(file=log, width=100)) as report:
        report(0, 96)
        report(32, 96)
        report(96, 96)
    lines = log.getvalue().splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("32 of 96 runs are done, left: ")
    assert lines[1].startswith("96 of 96 runs are done, left: 0:00:00")


def test_a_terminal_shows_a_bar_with_runs_and_times() -> None:
    screen = StringIO()
    with shown_runs(Console(file=screen, width=100, force_terminal=True)) as report:
        report(0, 96)
        report(48, 96)
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())
    assert re.search(r"48/96 +runs, elapsed 0:00:\d\d left 0:00:\d\d", shown)


def test_a_run_that_goes_on_counts_only_what_this_session_did() -> None:
    now = [100.0]
    bars = Progress(get_time=lambda: now[0], disable=True)
    bars.add_task("learning", total=None, at_first=None)
    (task,) = bars.tasks
    assert time_left(task) == "?"
    bars.update(task.id, total=100, completed=60, at_first=60)
    now[0] += 30
    assert time_left(task) == "?"  # Whatever was done before says nothing of the speed.
    bars.update(task.id, completed=80)
    assert time_left(task) == "0:00:30"  # 20 runs took 30 seconds, and 20 are left.


def test_claims_on_several_estimators_are_summed_up() -> None:
    claims = pd.DataFrame(
        {
            "claim": ["a", "a", "b", "b"],
            "importance": ["ace"] * 4,
            "estimator": ["exact", "sampled"] * 2,
            "verdict": ["holds", "undecided", "holds", "holds"],
        }
    )
    screen = StringIO()
    Console(file=screen, width=80).print(claims_table(claims))
    lines = [line.split() for line in screen.getvalue().splitlines() if line.strip()]
    assert lines[-2:] == [["a", "ace", "1", "of", "2", "undecided"], ["b", "ace", "2", "of", "2", "holds"]]


@pytest.mark.parametrize("width", [60, 80, 120])
def test_no_line_is_wider_than_the_terminal(width: int) -> None:
    counts = {"paper_tests": [4], "paper_test_agrees": [1], "holds": [0], "does_not_hold": [3], "undecided": [1]}
    told = {"statement": ["a long claim " * 8], "source": ["5.3, another left out"], "verdict": ["does not hold"]}
    claims = pd.DataFrame({**told, **counts})
    screen = StringIO()
    Console(file=screen, width=width).print(claims_table(claims))
    assert max(map(len, screen.getvalue().splitlines())) <= width
    assert "1 of 4" in screen.getvalue()
    assert "0/3/1" in screen.getvalue()
