"""Which numbers of subgoals are compared, and what is claimed of them."""

from dataclasses import replace

import pytest

from webapp.simulations.count import SETTINGS, CountSettings, claims, conditions, subgoals_by_count
from webapp.simulations.tasks import read_task

PAPER = SETTINGS["paper"]


def test_the_least_important_subgoal_is_left_out_first_and_added_ones_halve_the_largest_gap() -> None:
    task = read_task(PAPER.layout, PAPER.layout_name)
    assert task.importance[16 - 1] > task.importance[7 - 1]
    assert list(subgoals_by_count(task, PAPER)) == [
        (16,),
        (7, 16),
        (7, 11, 16),
        (3, 7, 11, 16),
        (3, 7, 11, 13, 16),
    ]


def test_the_groups_count_from_none_to_five_with_both_ways_of_leaving_one_out() -> None:
    names = [group.name for group in conditions(PAPER) if group.variant in {"none", "repeatable"}]
    assert names == ["0", "1 (16)", "1 (7)", "2 (7 16)", "3 (7 11 16)", "4 (3 7 11 16)", "5 (3 7 11 13 16)"]


def test_the_shortest_path_stays_optimal_in_every_group() -> None:
    assert all(group.keeps_optimum for group in conditions(PAPER))


def test_consecutive_counts_are_compared_as_the_paper_does() -> None:
    made = [claim for claim in claims(conditions(PAPER)) if claim.variant == "repeatable"]
    paper = [(claim.second.name[0], claim.first.name[0], claim.expects) for claim in made if claim.source == "5.3"]
    assert paper == [
        ("0", "1", "fewer"),
        ("1", "2", "fewer"),
        ("2", "3", "no difference"),
        ("3", "4", "no difference"),
        ("4", "5", "no difference"),
    ]
    others = [(claim.second.name, claim.first.name) for claim in made if claim.source == "5.3, another left out"]
    assert others == [("0", "1 (7)"), ("1 (7)", "2 (7 16)")]


def test_fewer_subgoals_than_are_derived_can_be_asked_for() -> None:
    settings = replace(PAPER, most_subgoals=1)
    assert [group.name for group in conditions(settings) if group.variant == "once"] == ["1 (16)", "1 (7)"]
    assert all(claim.expects == "fewer" for claim in claims(conditions(settings)))


@pytest.mark.parametrize("number", [0, 11])
def test_a_number_of_subgoals_out_of_range_is_refused(number: int) -> None:
    with pytest.raises(ValueError, match=f"most_subgoals must be from 1 to 10, not {number}"):
        CountSettings(most_subgoals=number)


def test_a_map_without_a_subgoal_beside_the_goal_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="corridor has no subgoal beside the goal"):
        conditions(replace(PAPER, layout="######\n#>KDG#\n######\n", layout_name="corridor"))
