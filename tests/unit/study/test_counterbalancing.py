import math
import random
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.counterbalancing import arrangements, choose_least_used
from webapp.study.protocol import Experiment, parse_study

STUDY = parse_study((Path(__file__).parents[3] / "webapp/studies/sakai2021/study.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("experiment", STUDY.experiments, ids=lambda experiment: experiment.id)
def test_the_arrangements_are_every_bijection_of_kinds_and_layouts_once(experiment: Experiment) -> None:
    every = arrangements(experiment)
    assert len(every) == len(set(every)) == math.factorial(len(experiment.layouts))
    assert all(sorted(arrangement) == sorted(experiment.kinds) for arrangement in every)


@pytest.mark.parametrize("experiment", STUDY.experiments, ids=lambda experiment: experiment.id)
def test_over_all_arrangements_each_kind_goes_with_each_layout_equally_often(experiment: Experiment) -> None:
    every = arrangements(experiment)
    for position in range(len(experiment.layouts)):
        counts = Counter(arrangement[position] for arrangement in every)
        assert set(counts) == set(experiment.kinds)
        assert len(set(counts.values())) == 1


@given(num_arrangements=st.integers(1, 24), num_participants=st.integers(0, 200), seed=st.integers(0, 2**32))
def test_no_arrangement_is_ever_used_two_times_more_than_another(
    num_arrangements: int, num_participants: int, seed: int
) -> None:
    chooser = random.Random(seed)
    counts = [0] * num_arrangements
    for _ in range(num_participants):
        counts[choose_least_used(counts, chooser)] += 1
        assert max(counts) - min(counts) <= 1


@given(counts=st.lists(st.integers(0, 50), min_size=1, max_size=24), seed=st.integers(0, 2**32))
def test_whatever_was_used_before_one_of_the_least_used_is_chosen(counts: list[int], seed: int) -> None:
    assert counts[choose_least_used(counts, random.Random(seed))] == min(counts)


def test_the_choice_among_the_least_used_is_left_to_chance() -> None:
    chooser = random.Random(3)
    chosen = Counter(choose_least_used([1, 0, 0, 2, 0], chooser) for _ in range(3000))
    assert set(chosen) == {1, 2, 4}
    assert all(850 < count < 1150 for count in chosen.values())


def test_there_must_be_something_to_choose_from() -> None:
    with pytest.raises(ValueError, match="no arrangements"):
        choose_least_used([], random.Random(0))
