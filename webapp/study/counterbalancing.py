"""Which kind of explanation goes with which layout, for whom.

"Each environment's explanation method was determined randomly" (Sakai et al. 2021, section 6.1), made precise: every
bijection of kinds and layouts is used equally often, each experiment by itself.
"""

import itertools
from collections.abc import Sequence
from typing import Protocol, TypeVar

from webapp.study.protocol import Experiment, Kind

_Option = TypeVar("_Option")


class Chooser(Protocol):
    """What `random.Random` and `random.SystemRandom` have in common here."""

    def choice(self, seq: Sequence[_Option], /) -> _Option:
        """Return one of the options, all equally likely."""


def arrangements(experiment: Experiment) -> tuple[tuple[Kind, ...], ...]:
    """Return every way of giving the kinds to the layouts, in a fixed order.

    Returns:
        Arrangements `[n!][n]`: entry `i` of an arrangement is the kind shown with `experiment.layouts[i]`.
    """
    return tuple(itertools.permutations(experiment.kinds))


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
