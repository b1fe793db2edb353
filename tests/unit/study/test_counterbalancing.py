import itertools
import math
import random
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Literal, TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.counterbalancing import arrangements, choose_cell, choose_least_used, layout_orders
from webapp.study.experiments import BUILT_IN_KINDS
from webapp.study.protocol import Experiment, Kind, parse_study

STUDY = parse_study((Path(__file__).parents[3] / "webapp/studies/sakai2021/study.toml").read_text(encoding="utf-8"))
KINDS: tuple[Kind, ...] = BUILT_IN_KINDS

Option = TypeVar("Option")
Uses = dict[tuple[int, int], int]
Table = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Sketch:
    """As much of an experiment as counterbalancing reads."""

    kinds: tuple[Kind, ...]
    layouts: tuple[str, ...]
    layout_order: Literal["fixed", "counterbalanced"] = "counterbalanced"


@dataclass
class Turn:
    """A chooser that takes a given option and notes how many there were."""

    number: int
    num_options: int = 0

    def choice(self, seq: Sequence[Option], /) -> Option:
        self.num_options = len(seq)
        return seq[self.number]


def sketch(num_kinds: int, num_layouts: int) -> Sketch:
    return Sketch(KINDS[:num_kinds], tuple(f"layout-{number}" for number in range(num_layouts)))


sketches = st.builds(sketch, st.integers(1, 9), st.integers(1, 9))
square_sketches = st.integers(1, 9).map(lambda number: sketch(number, number))


def letters(experiment: Sketch) -> str:
    """Draw the arrangements with a letter for each kind."""
    name = dict(zip(experiment.kinds, "abcdefghijkl", strict=False))
    return " ".join("".join(name[kind] for kind in arrangement) for arrangement in arrangements(experiment))


def every_even_arrangement(experiment: Sketch) -> set[tuple[Kind, ...]]:
    """Take each kind floor(n / k) times, some once more, and shuffle in all ways."""
    fewest, num_more = divmod(len(experiment.layouts), len(experiment.kinds))
    return {
        shuffled
        for more in itertools.combinations(experiment.kinds, num_more)
        for shuffled in itertools.permutations(experiment.kinds * fewest + more)
    }


def successions(sequences: Sequence[Sequence[Option]]) -> Counter[tuple[Option, Option]]:
    return Counter(pair for sequence in sequences for pair in itertools.pairwise(sequence))


def shown_over_all_pairs(experiment: Sketch) -> list[list[Kind]]:
    """List the kinds as they come, for each pair of an arrangement and a layout order."""
    return [
        [arrangement[layout] for layout in order]
        for arrangement in arrangements(experiment)
        for order in layout_orders(experiment)
    ]


def is_carry_over_balanced(sequences: Sequence[Sequence[Option]], options: Sequence[Option]) -> bool:
    counts = successions(sequences)
    return len({counts[pair] for pair in itertools.permutations(options, 2)}) <= 1


@pytest.mark.parametrize("experiment", STUDY.experiments, ids=lambda experiment: experiment.id)
def test_the_arrangements_of_the_paper_are_every_bijection_of_kinds_and_layouts_once(experiment: Experiment) -> None:
    every = arrangements(experiment)
    assert len(every) == len(set(every)) == math.factorial(len(experiment.layouts))
    assert all(sorted(arrangement) == sorted(experiment.kinds) for arrangement in every)
    assert layout_orders(experiment) == (tuple(range(len(experiment.layouts))),)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_bijections_of_up_to_four_kinds_stay_in_the_order_in_which_stored_data_count_them(number: int) -> None:
    assert arrangements(sketch(number, number)) == tuple(itertools.permutations(KINDS[:number]))


@pytest.mark.parametrize(
    ("num_kinds", "num_layouts", "drawing"),
    [
        (1, 3, "aaa"),
        (2, 1, "a b"),
        (3, 2, "ab ac ba bc ca cb"),
        (2, 3, "aab aba abb baa bab bba"),
        (2, 4, "aabb abab abba baab baba bbaa"),
        (5, 5, "abecd bcade cdbea decab eadbc dceba edacb aebdc baced cbdae"),
        (6, 6, "abfced bcadfe cdbeaf decfba efdacb faebdc"),
        (6, 3, "abf bca cdb dec efd fae"),
        (3, 5, "abcab bcabc cabca cbacb acbac bacba"),
        (4, 6, "abdcab bcadbc cdbacd dacbda"),
        (2, 7, "abababa bababab"),
    ],
)
def test_the_arrangements_have_numbers_that_stored_data_rely_on(num_kinds: int, num_layouts: int, drawing: str) -> None:
    assert letters(sketch(num_kinds, num_layouts)) == drawing


@given(experiment=sketches)
def test_over_all_arrangements_each_kind_goes_with_each_layout_equally_often(experiment: Sketch) -> None:
    every = arrangements(experiment)
    assert len(every) == len(set(every))
    for position in range(len(experiment.layouts)):
        counts = Counter(arrangement[position] for arrangement in every)
        assert set(counts) == set(experiment.kinds)
        assert len(set(counts.values())) == 1


@given(experiment=sketches)
def test_within_a_participant_no_kind_comes_two_times_more_than_another(experiment: Sketch) -> None:
    for arrangement in arrangements(experiment):
        assert len(arrangement) == len(experiment.layouts)
        counts = [arrangement.count(kind) for kind in experiment.kinds]
        assert max(counts) - min(counts) <= 1


@given(experiment=st.builds(sketch, st.integers(1, 7), st.integers(1, 7)))
def test_all_even_arrangements_are_used_exactly_if_there_are_at_most_24(experiment: Sketch) -> None:
    used, possible = set(arrangements(experiment)), every_even_arrangement(experiment)
    assert used <= possible
    assert (used == possible) == (len(possible) <= 24)


@given(num_kinds=st.integers(1, 12), num_layouts=st.integers(1, 12))
def test_there_are_at_most_24_arrangements_or_as_many_as_rows_of_a_square(num_kinds: int, num_layouts: int) -> None:
    rows = num_kinds if num_kinds % 2 == 0 else 2 * num_kinds
    assert len(arrangements(sketch(num_kinds, num_layouts))) <= 24
    if num_kinds > 4 and num_layouts > 1:
        assert len(arrangements(sketch(num_kinds, num_layouts))) == (20 if (num_kinds, num_layouts) == (5, 2) else rows)


@given(experiment=square_sketches)
def test_with_as_many_kinds_as_layouts_each_kind_follows_each_other_one_equally_often(experiment: Sketch) -> None:
    every = arrangements(experiment)
    assert is_carry_over_balanced(every, experiment.kinds)
    assert sum(successions(every).values()) == len(every) * (len(experiment.layouts) - 1)
    assert not any(first == second for first, second in successions(every))


@pytest.mark.parametrize("size", [(2, 3), (2, 5), (2, 6), (3, 2), (4, 2), (5, 2), (4, 3)])
def test_carry_over_is_balanced_too_where_all_even_arrangements_are_used(size: tuple[int, int]) -> None:
    experiment = sketch(*size)
    assert set(arrangements(experiment)) == every_even_arrangement(experiment)
    assert is_carry_over_balanced(arrangements(experiment), experiment.kinds)
    assert is_carry_over_balanced(shown_over_all_pairs(experiment), experiment.kinds)


@given(num_kinds=st.integers(3, 9), num_layouts=st.integers(4, 9))
def test_no_kind_follows_itself_in_a_square_even_where_it_begins_again(num_kinds: int, num_layouts: int) -> None:
    assert not any(first == second for first, second in successions(arrangements(sketch(num_kinds, num_layouts))))


@given(experiment=sketches)
def test_a_fixed_layout_order_is_the_declared_one(experiment: Sketch) -> None:
    fixed = Sketch(experiment.kinds, experiment.layouts, "fixed")
    assert layout_orders(fixed) == (tuple(range(len(experiment.layouts))),)
    assert arrangements(fixed) == arrangements(experiment)


@pytest.mark.parametrize("num_layouts", range(1, 10))
def test_up_to_four_layouts_come_in_all_orders_and_more_in_those_of_a_square(num_layouts: int) -> None:
    orders = layout_orders(sketch(2, num_layouts))
    every = list(itertools.permutations(range(num_layouts)))
    if num_layouts <= 4:
        assert list(orders) == every
    else:
        assert len(orders) == len(set(orders)) == (num_layouts if num_layouts % 2 == 0 else 2 * num_layouts)
        assert set(orders) < set(every)


@given(num_layouts=st.integers(1, 9))
def test_over_all_orders_each_layout_comes_at_each_position_and_after_each_other_equally_often(
    num_layouts: int,
) -> None:
    orders = layout_orders(sketch(2, num_layouts))
    for position in range(num_layouts):
        assert Counter(order[position] for order in orders) == dict.fromkeys(
            range(num_layouts), len(orders) // num_layouts
        )
    assert is_carry_over_balanced(orders, range(num_layouts))


@given(experiment=sketches)
def test_over_all_pairs_each_kind_meets_each_layout_at_each_position_equally_often(experiment: Sketch) -> None:
    met = Counter(
        (arrangement[layout], layout, position)
        for arrangement in arrangements(experiment)
        for order in layout_orders(experiment)
        for position, layout in enumerate(order)
    )
    num_layouts = len(experiment.layouts)
    assert len(met) == len(experiment.kinds) * num_layouts * num_layouts
    assert len(set(met.values())) == 1


@given(experiment=square_sketches)
def test_over_all_pairs_each_kind_follows_each_other_one_equally_often(experiment: Sketch) -> None:
    assert is_carry_over_balanced(shown_over_all_pairs(experiment), experiment.kinds)


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


def arrivals(num_arrangements: int, num_orders: int, num_participants: int, seed: int) -> Iterator[Table]:
    """Yield how often each pair was used, after each arrival, as `[arrangement][order]`."""
    chooser = random.Random(seed)
    uses: Uses = {}
    for _ in range(num_participants):
        cell = choose_cell(uses, num_arrangements, num_orders, chooser)
        uses[cell] = uses.get(cell, 0) + 1
        yield tuple(
            tuple(uses.get((row, column), 0) for column in range(num_orders)) for row in range(num_arrangements)
        )


def spread(counts: Sequence[int]) -> int:
    return max(counts) - min(counts)


def spread_of_pairs(table: Table) -> int:
    return spread([count for row in table for count in row])


def following(table: Table) -> Iterator[Table]:
    """Yield the table after the next arrival, once for each outcome of the choice, all equally likely."""
    uses = {(row, column): count for row, counts in enumerate(table) for column, count in enumerate(counts)}
    number = 0
    turn = Turn(number, num_options=1)
    while number < turn.num_options:
        turn = Turn(number)
        cell = choose_cell(uses, len(table), len(table[0]), turn)
        yield tuple(
            tuple(count + ((row, column) == cell) for column, count in enumerate(counts))
            for row, counts in enumerate(table)
        )
        number += 1


def essence(table: Table) -> Table:
    """Forget what the choice does not see: how often all pairs were used, and for the most part their names."""
    least = min(count for row in table for count in row)
    rows = [tuple(count - least for count in row) for row in table]
    for _ in range(4):
        columns = sorted(zip(*sorted(rows), strict=True))
        rows = list(zip(*columns, strict=True))
    return tuple(rows)


@given(
    size=st.tuples(st.integers(1, 12), st.integers(1, 12)),
    num_participants=st.integers(0, 150),
    seed=st.integers(0, 2**32),
)
def test_whatever_the_arrivals_no_arrangement_and_no_order_is_used_two_times_more_than_another(
    size: tuple[int, int], num_participants: int, seed: int
) -> None:
    for table in arrivals(*size, num_participants, seed):
        assert spread([sum(row) for row in table]) <= 1
        assert spread([sum(column) for column in zip(*table, strict=True)]) <= 1


@given(few=st.integers(1, 2), many=st.integers(1, 12), swapped=st.booleans(), seed=st.integers(0, 2**32))
def test_pairs_too_are_used_equally_often_where_there_are_at_most_two_arrangements_or_orders(
    few: int, many: int, swapped: bool, seed: int
) -> None:
    size = (many, few) if swapped else (few, many)
    for number, table in enumerate(arrivals(*size, 4 * few * many, seed), start=1):
        assert spread_of_pairs(table) == (0 if number % (few * many) == 0 else 1)


@pytest.mark.parametrize(("size", "most"), [((2, 2), 1), ((2, 7), 1), ((3, 3), 2), ((3, 4), 1), ((4, 4), 3)])
def test_no_possible_history_takes_the_pairs_of_a_small_design_further_apart(size: tuple[int, int], most: int) -> None:
    start: Table = ((0,) * size[1],) * size[0]
    seen, fresh = {start}, [start]
    while fresh:
        fresh = list({essence(after) for table in fresh for after in following(table)} - seen)
        seen.update(fresh)
    assert max(spread_of_pairs(table) for table in seen) == most


@pytest.mark.parametrize("size", [(6, 6), (10, 10), (24, 6)])
def test_the_pairs_of_a_larger_design_do_not_drift_apart(size: tuple[int, int]) -> None:
    assert max(spread_of_pairs(table) for table in arrivals(*size, 10 * size[0] * size[1], seed=5)) <= 3


@pytest.mark.parametrize("size", [(2, 3), (3, 3)])
def test_before_anyone_arrives_each_pair_is_equally_likely_for_each_participant(size: tuple[int, int]) -> None:
    likely = {((0,) * size[1],) * size[0]: Fraction(1)}
    for num_participants in range(1, 6):
        later: defaultdict[Table, Fraction] = defaultdict(Fraction)
        for table, probability in likely.items():
            outcomes = list(following(table))
            for after in outcomes:
                later[after] += probability / len(outcomes)
        likely = dict(later)
        for row, column in itertools.product(range(size[0]), range(size[1])):
            expected = sum(table[row][column] * probability for table, probability in likely.items())
            assert expected == Fraction(num_participants, size[0] * size[1])


@given(
    size=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    counts=st.lists(st.integers(0, 9), min_size=25, max_size=25),
    seed=st.integers(0, 2**32),
)
def test_whatever_pairs_were_used_before_the_least_used_of_least_used_arrangements_and_orders_is_chosen(
    size: tuple[int, int], counts: list[int], seed: int
) -> None:
    cells = list(itertools.product(range(size[0]), range(size[1])))
    uses = {cell: count for cell, count in zip(cells, counts, strict=False) if count}

    def burden(cell: tuple[int, int]) -> tuple[int, int, int]:
        arrangement = sum(count for (row, _), count in uses.items() if row == cell[0])
        order = sum(count for (_, column), count in uses.items() if column == cell[1])
        return arrangement, order, uses.get(cell, 0)

    assert burden(choose_cell(uses, *size, random.Random(seed))) == min(burden(cell) for cell in cells)


@pytest.mark.parametrize("size", [(0, 1), (1, 0), (-1, 1)])
def test_there_must_be_an_arrangement_and_an_order_to_choose(size: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=f"must be arrangements and orders, not {size[0]} and {size[1]}"):
        choose_cell({}, *size, random.Random(0))


@pytest.mark.parametrize("cell", [(6, 0), (0, 2), (-1, 0), (0, -1)])
def test_pairs_that_do_not_exist_cannot_have_been_used(cell: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=r"no pair \(.*\) of 6 x 2"):
        choose_cell({cell: 1}, 6, 2, random.Random(0))
