"""When sampling a path's importance ends: every state's side of the threshold is settled, or the budget is spent."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.trials import Tally

MAX_TRIALS = 1_000_000


@dataclass(frozen=True, slots=True)
class StopRule:
    """How many trials each state gets, and when they are looked at.

    Every state gets as many trials as every other: none is sampled longer because of what was seen of it, so a share
    that spends its budget is unbiased. A run that may stop early tends to stop when the shares happen to lie far apart,
    which draws them apart by a fraction of their standard error.

    Attributes:
        budget: Trials per state and probability, from 1 to 1,000,000.
        early: Whether to stop as soon as every state's side of the threshold is settled; otherwise the budget is spent.
        first_look: After so many trials the first look is taken, at least 1.
        growth: After each look the trials grow to so many times as many, above 1.
        error: With at most this probability is any side that is called settled, in any look, the wrong one; above 0,
            below 1.

    Raises:
        ValueError: A number is out of range.

    Example:
        >>> from webapp.explainer import StopRule
        >>> StopRule(budget=1000, early=True).looks
        (100, 200, 400, 800, 1000)
    """

    budget: int = 1000
    early: bool = False
    first_look: int = 100
    growth: float = 2.0
    error: float = 0.05

    def __post_init__(self) -> None:
        if not 1 <= self.budget <= MAX_TRIALS or self.budget != int(self.budget):
            raise ValueError(f"the number of trials must be a whole number from 1 to {MAX_TRIALS:,}, not {self.budget}")
        if self.first_look < 1:
            raise ValueError(f"the first look must come after 1 trial or more, not {self.first_look}")
        if not 1 < self.growth < math.inf:
            raise ValueError(f"the trials must grow by a factor above 1, not {self.growth}")
        if not 0 < self.error < 1:
            raise ValueError(f"the probability of an error must lie between 0 and 1, not {self.error}")

    @property
    def looks(self) -> tuple[int, ...]:
        """The numbers of trials at which the shares are looked at, ascending; the last is the budget."""
        looks, trials = [], self.first_look
        while self.early and trials < self.budget:
            looks.append(trials)
            trials = max(trials + 1, math.ceil(trials * self.growth))
        return (*looks, self.budget)


class Sides:
    """What is known about the side of the threshold on which each state of a path lies.

    The threshold, the mean importance of all `T + 1` states, is itself estimated, from the trials of all. One interval
    for it and one for each state's importance decide: a state is settled when the two have nothing in common. All
    intervals of all looks hold at once with a probability of `1 - error`: each misses with an equal part of the error
    (Bonferroni; the looks are fixed beforehand). Each is an inversion of Hoeffding's (1963) inequality, so that this
    holds for any number of trials, and a share of 0 or 1 is no certainty. That of the mean needs no variance and no
    covariance, because the inequality holds for the mean of trials whose chances differ. Of an importance that is a
    difference, both parts have intervals. What one look has ruled out or settled stays so.

    Attributes:
        settled: `[T + 1]`: 1 where the importance lies above the threshold, -1 where below, 0 where that is open.
    """

    def __init__(self, num_steps: int, rule: StopRule) -> None:
        """Begin without knowledge.

        Args:
            num_steps: T, at least 1.
            rule: How often there will be a look, and how often that may go wrong.
        """
        self._num_steps, self._rule = num_steps, rule
        self._low, self._high = np.full(num_steps + 1, -np.inf), np.full(num_steps + 1, np.inf)
        self.settled = np.zeros(num_steps + 1, dtype=np.int64)

    def look(self, tallies: Sequence[Tally]) -> None:
        """Take one of the looks.

        Args:
            tallies: Of the chance that is the importance, or of the two whose difference it is.
        """
        error = self._rule.error / (len(self._rule.looks) * len(tallies) * (self._num_steps + 1))
        low, high = tallies[0].limits(error)
        for less in tallies[1:]:
            least, most = less.limits(error)
            low, high = low - most, high - least
        self._low, self._high = np.maximum(self._low, low), np.minimum(self._high, high)
        self.settled = np.where(self.settled == 0, self._apart(), self.settled)

    def _apart(self) -> NDArray[np.int64]:
        """Return `[T + 1]`: on which side of the threshold's interval each importance's lies; the target's is 0."""
        # The limits end with those of the mean of T chances; the target, a zero, makes it the mean of T + 1.
        part = self._num_steps / (self._num_steps + 1)
        low, high = np.append(self._low[:-1], 0.0), np.append(self._high[:-1], 0.0)
        above, below = low > self._high[-1] * part, high < self._low[-1] * part
        sides: NDArray[np.int64] = above.astype(np.int64) - below.astype(np.int64)
        return sides

    @property
    def unsettled(self) -> tuple[int, ...]:
        """The steps, from 1 to T + 1, whose side is not settled."""
        return tuple(int(step) + 1 for step in np.flatnonzero(self.settled == 0))
