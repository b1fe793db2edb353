"""The map of an experiment and what the method derives from it."""

import pytest

from webapp.explainer.worlds.layout import LayoutError
from webapp.simulations.tasks import packaged_layout, read_task


def test_the_paper_s_map_has_the_paper_s_steps() -> None:
    task = read_task(packaged_layout(), "simulation")
    assert task.path.num_steps == 20
    assert task.subgoals == (7, 16)  # The goal's own step, 20, is left out.
    assert task.max_steps == 640
    assert list(task.inner_steps) == list(range(1, 20))
    assert task.pairs((7, 16)) == (task.path.pairs[6], task.path.pairs[15])


def test_a_map_without_a_way_is_refused_by_name() -> None:
    with pytest.raises(LayoutError, match="blocked, line 2, column 4: the goal cannot be reached"):
        read_task("######\n#>#GK#\n#D####\n######\n", "blocked")
