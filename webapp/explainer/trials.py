"""Counting trials: what is asked of each, how they came out, and what that says about a probability."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Question = Literal["returns", "arrives", "arrives_denied"]
"""Does the policy lead back to `s_f`, does it reach the goal, does it with its action forbidden in `s_f`?"""

_HALVINGS = 32
"""So often the place of a limit is halved. It is then known to some 1e-10, and always erred on the wide side."""


@dataclass(frozen=True, slots=True, eq=False)
class Tally:
    """How the trials of `T` chances came out, as many for each chance.

    Attributes:
        num_trials: Of each chance, at least 0.
        successes: `[T]` counts.
        truncated: `[T]` counts of trials that were broken off before they were decided. They are no successes.

    Raises:
        ValueError: A count is negative, or there are more of them than trials.
    """

    num_trials: int
    successes: NDArray[np.int64]
    truncated: NDArray[np.int64]

    def __post_init__(self) -> None:
        if self.successes.shape != self.truncated.shape or self.successes.ndim != 1:
            raise ValueError(f"counts must have shape [T], not {self.successes.shape} and {self.truncated.shape}")
        if min(self.successes.min(initial=0), self.truncated.min(initial=0)) < 0:
            raise ValueError("a count must be 0 or larger")
        if (self.successes + self.truncated).max(initial=0) > self.num_trials:
            raise ValueError(f"no count can be larger than the number of trials, {self.num_trials}")

    @classmethod
    def of_none(cls, num_chances: int) -> "Tally":
        """Return what is known before the first trial."""
        return cls(0, np.zeros(num_chances, dtype=np.int64), np.zeros(num_chances, dtype=np.int64))

    def plus(self, other: "Tally") -> "Tally":
        """Return both series of trials as one."""
        return Tally(
            self.num_trials + other.num_trials, self.successes + other.successes, self.truncated + other.truncated
        )

    def shares(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return `[T]` the share of each chance and `[T]` its standard error `sqrt(p (1 - p) / num_trials)`.

        There must have been trials.
        """
        values = self.successes / self.num_trials
        return values, np.sqrt(values * (1 - values) / self.num_trials)

    def limits(self, error: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return `[T + 1]` lower and upper limits of each chance and, last, of the mean of the `T` chances.

        Each interval misses its value with a probability of at most `error`. A trial that was broken off counts as a
        failure in the lower limit and as a success in the upper one.
        """
        trials = np.full(len(self.successes) + 1, self.num_trials)
        trials[-1] *= len(self.successes)
        most = self.successes + self.truncated
        failures = self.num_trials - self.successes
        counts = np.concatenate((most, [most.sum()], failures, [failures.sum()]))
        # The least that a chance can be leaves the most for its opposite; one search finds both.
        high, most_failures = np.split(upper_limit(counts, np.tile(trials, 2), error / 2), 2)
        return 1 - most_failures, high


def in_turns(run: Callable[[int], Tally], num_chances: int, num_trials: int, most_walkers: int) -> Tally:
    """Run trials in turns, so that their number costs time and not memory.

    Args:
        run: Runs so many trials of each chance at once.
        num_chances: T.
        num_trials: Of each chance, at least 0.
        most_walkers: So many trials run at once, or one for each chance if that is more.
    """
    if not num_chances or not num_trials:
        return Tally.of_none(num_chances)
    at_once = max(1, most_walkers // num_chances)
    tally = run(min(at_once, num_trials))
    while tally.num_trials < num_trials:
        tally = tally.plus(run(min(at_once, num_trials - tally.num_trials)))
    return tally


def upper_limit(successes: NDArray[np.int64], trials: NDArray[np.int64], error: float) -> NDArray[np.float64]:
    """Return what the mean chance of independent trials exceeds with a probability of at most `error`.

    The limit is the largest `q` with `n kl(k / n, q) <= log(1 / error)`, where `kl` is the relative entropy of two
    coins: the inversion of Hoeffding (1963), Theorem 1, inequality 2.1. It holds for every number of trials, also
    where the chances of the trials differ, and a share of 0 or 1 has an interval like any other. Normal approximations
    do not hold that far out, and least of all for small counts.

    Args:
        successes: `[N]` counts.
        trials: `[N]` counts, at least 1.
        error: Above 0, below 1.
    """
    found = successes / trials
    low, high = found.copy(), np.ones_like(found)
    with np.errstate(divide="ignore", invalid="ignore"):
        # With 0 log 0 = 0, `kl` is what both coins share, less the surprise of the supposed one.
        shared = np.nan_to_num(found * np.log(found)) + np.nan_to_num((1 - found) * np.log1p(-found))
        least_surprise = shared - math.log(1 / error) / trials
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            beyond = found * np.log(middle) + (1 - found) * np.log1p(-middle) < least_surprise
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return high
