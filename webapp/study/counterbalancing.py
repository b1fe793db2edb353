"""Which kind of explanation goes with which layout, and in which order the layouts come, for whom.

"Each environment's explanation method was determined randomly" (Sakai et al. 2021, section 6.1), made precise for any
number of kinds and of layouts, each experiment by itself. An arrangement gives the kinds to the layouts, a layout order
says which layout comes when. In either list every entry stands at every place equally often, and a participant gets
what was used least: chance decides only between what serves the balance equally well.

Small designs use every possibility, larger ones the rows of a Williams square: E. J. Williams (1949), Experimental
designs balanced for the estimation of residual effects of treatments, Australian Journal of Scientific Research A 2,
149-168.
"""

import itertools
from collections.abc import Mapping, Sequence
from functools import lru_cache
from math import comb, factorial
from typing import Literal, Protocol, TypeVar

from webapp.study.protocol import Kind

MOST_LISTED = 24
"""Up to this many possibilities, the permutations of four, every one is used."""

_Option = TypeVar("_Option")
_Patterns = tuple[tuple[int, ...], ...]


class Design(Protocol):
    """What counterbalancing reads of an experiment: distinct kinds and layouts, at least one of each."""

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """The kinds to compare."""

    @property
    def layouts(self) -> tuple[str, ...]:
        """The layouts, each of which a participant sees once."""

    @property
    def layout_order(self) -> Literal["fixed", "counterbalanced"]:
        """Whether everyone sees the layouts in the order in which they are declared."""


class Chooser(Protocol):
    """What `random.Random` and `random.SystemRandom` have in common here."""

    def choice(self, seq: Sequence[_Option], /) -> _Option:
        """Return one of the options, all equally likely."""


def arrangements(experiment: Design) -> tuple[tuple[Kind, ...], ...]:
    """Return the ways of giving the kinds to the layouts that are used, in an order that never changes.

    Within an arrangement, two kinds' numbers of layouts differ by at most one; over all of them, each kind meets each
    layout equally often. If at most `MOST_LISTED` arrangements are that even, they are all there, in the order in which
    `itertools.product` lists indices into `experiment.kinds`; that is the order of `itertools.permutations` where no
    kind comes twice. Otherwise they are the rows of the Williams square of the kinds, cut after the last layout where
    there are fewer layouts than kinds, and begun again where there are more; layouts as far apart as there are kinds
    then share their kind.

    In the layouts' declared order, each kind directly follows each other one equally often (Williams's balance of
    first-order carry-over) if there are as many kinds as layouts or all even arrangements are used. In a cut or
    repeated square it need not; but there no kind follows itself.

    Returns:
        Arrangements `[arrangement][layout]`: entry `i` of one is the kind shown with `experiment.layouts[i]`.
    """
    kinds = experiment.kinds
    return tuple(tuple(kinds[index] for index in pattern) for pattern in _patterns(len(kinds), len(experiment.layouts)))


def layout_orders(experiment: Design) -> tuple[tuple[int, ...], ...]:
    """Return the orders of the layouts that are used, in an order that never changes.

    A fixed layout order (Sakai et al. 2021, section 6.1) leaves the declared one. Counterbalanced, there are all
    permutations of up to four layouts, as `itertools.permutations` lists them, and the rows of their Williams square if
    there are more. Over the orders, each layout comes at each position equally often and directly follows each other
    one equally often.

    An arrangement belongs to the layouts, whatever their order. So balanced means, over all pairs of an arrangement and
    an order, that kinds, layouts and positions are fully crossed: each kind meets each layout at each position equally
    often. Each kind then also follows each other one equally often, under the conditions of `arrangements`.

    Returns:
        Orders `[order][position]`: entry `p` of one is the index into `experiment.layouts` of what comes at position
        `p`, both from 0.
    """
    num_layouts = len(experiment.layouts)
    if experiment.layout_order == "fixed":
        return (tuple(range(num_layouts)),)
    return _patterns(num_layouts, num_layouts)


def choose_least_used(counts: Sequence[int], chooser: Chooser) -> int:
    """Choose an arrangement for the next participant: one of the least used, all of these equally likely.

    Args:
        counts: How often each arrangement has been given out. The caller reads them and stores the choice in one
            transaction; then the largest and the smallest count never differ by more than one.
        chooser: The source of randomness.

    Returns:
        An index into `counts`.

    Raises:
        ValueError: There is nothing to choose from.
    """
    if not counts:
        raise ValueError("there are no arrangements to choose from")
    least = min(counts)
    return chooser.choice([index for index, count in enumerate(counts) if count == least])


def choose_cell(
    uses: Mapping[tuple[int, int], int], num_arrangements: int, num_orders: int, chooser: Chooser
) -> tuple[int, int]:
    """Choose an arrangement and a layout order for the next participant.

    The arrangement is one of the least used, the order is one of the least used, and the pair is a least used one of
    such; what is left is equally likely. If every participant's pair came from here, read and stored in one
    transaction, then

    - the uses of any two arrangements never differ by more than one, nor do those of any two orders;
    - before the first arrival, each pair is equally likely for each participant;
    - the uses of any two pairs never differ by more than one where there are at most two arrangements or at most two
      orders, and after each `num_arrangements * num_orders` participants they are equal.

    With more of both, evenness of pairs yields to that of arrangements and orders: the last participants of a round
    may be left with a pair that was used before. No bound is proven for every size. Over all possible histories, two
    pairs differ by at most 2 in a 3 x 3 design and by at most 3 in a 4 x 4 design; in simulations of 10,000
    participants in designs of up to 24 x 24 they differed by 2 or 3, rarely 4, without drifting apart. Kinds meet
    positions through the pairs, and are crossed with them as evenly as these are used.

    Whatever was used before, an arrangement or order that lags behind is chosen until it has caught up.

    Args:
        uses: How often each pair of an arrangement and an order was given out; pairs never given out may be missing.
        num_arrangements: How many arrangements there are.
        num_orders: How many layout orders there are.
        chooser: The source of randomness.

    Returns:
        Indices into `arrangements(experiment)` and `layout_orders(experiment)`.

    Raises:
        ValueError: There is nothing to choose from, or a pair was used that does not exist.
    """
    if num_arrangements < 1 or num_orders < 1:
        raise ValueError(f"there must be arrangements and orders, not {num_arrangements} and {num_orders}")
    by_arrangement, by_order = [0] * num_arrangements, [0] * num_orders
    for (arrangement, order), count in uses.items():
        if not (0 <= arrangement < num_arrangements and 0 <= order < num_orders):
            raise ValueError(f"there is no pair {(arrangement, order)} of {num_arrangements} x {num_orders}, from 0")
        by_arrangement[arrangement] += count
        by_order[order] += count
    least = min(by_arrangement), min(by_order)
    cells = [
        (arrangement, order)
        for arrangement, order in itertools.product(range(num_arrangements), range(num_orders))
        if (by_arrangement[arrangement], by_order[order]) == least
    ]
    return cells[choose_least_used([uses.get(cell, 0) for cell in cells], chooser)]


@lru_cache(maxsize=64)
def _patterns(num_things: int, num_places: int) -> _Patterns:
    """Return sequences of things, from 0, in which all come equally often, up to one; over all, so at each place."""
    if _num_even_sequences(num_things, num_places) <= MOST_LISTED:
        every = itertools.product(range(num_things), repeat=num_places)
        return tuple(sequence for sequence in every if _is_even(sequence, num_things))
    return tuple(tuple(row[place % num_things] for place in range(num_places)) for row in _williams_square(num_things))


def _num_even_sequences(num_things: int, num_places: int) -> int:
    """Choose the things that come once more than the others, then divide the places among all."""
    fewest, num_more = divmod(num_places, num_things)
    interchangeable: int = factorial(fewest + 1) ** num_more * factorial(fewest) ** (num_things - num_more)
    return comb(num_things, num_more) * factorial(num_places) // interchangeable


def _is_even(sequence: Sequence[int], num_things: int) -> bool:
    counts = [sequence.count(thing) for thing in range(num_things)]
    return max(counts) - min(counts) <= 1


def _williams_square(num_things: int) -> _Patterns:
    """Return the row 0, 1, -1, 2, -2 ..., modulo the number of things, and what adding 1, 2 ... makes of it.

    The steps +1, -2, +3 ... are all different modulo an even number. Modulo an odd one each comes twice or not at all,
    and the other half of them are those of the rows read backwards, which follow.
    """
    zigzag = [(place + 1) // 2 * (1 if place % 2 else -1) for place in range(num_things)]
    rows = tuple(tuple((start + offset) % num_things for offset in zigzag) for start in range(num_things))
    return rows if num_things % 2 == 0 else rows + tuple(row[::-1] for row in rows)
