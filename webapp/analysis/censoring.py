"""How many episodes runs needed, where some were stopped before they got there (right-censoring at the budget).

Of a run that was stopped, only this is known: it needs more episodes than it was given. It may therefore count as slow,
never as fast, and it may not be left out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Undefined(ValueError):
    """A statistic that the runs at hand do not determine; the message says why."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """What N independent runs needed, in no particular order.

    Attributes:
        values: `[N]`, above 0: the episodes that each run needed, or was given where it was stopped.
        observed: `[N]`, False where the run was stopped, so that the true value is larger than the number.

    Raises:
        ValueError: There is no run, the arrays do not fit together, or a value is not above 0 and finite.
    """

    values: NDArray[np.float64]
    observed: NDArray[np.bool_]

    def __post_init__(self) -> None:
        if self.values.ndim != 1 or self.values.size < 1:
            raise ValueError(f"a sample must be one row of one run or more, not of shape {self.values.shape}")
        if self.observed.shape != self.values.shape:
            raise ValueError(f"observed must have the values' shape {self.values.shape}, not {self.observed.shape}")
        if self.values.dtype != np.float64 or self.observed.dtype != np.bool_:
            found = f"{self.values.dtype} and {self.observed.dtype}"
            raise ValueError(f"values and observed must be float64 and bool, not {found}")
        wrong = ~(np.isfinite(self.values) & (self.values > 0))
        if wrong.any():
            raise ValueError(f"a run's episodes must be finite and above 0, not {self.values[wrong][0]}")

    @classmethod
    def of(cls, values: ArrayLike, observed: ArrayLike | None = None) -> "Sample":
        """Build a sample from copies of any sequences.

        Args:
            values: `[N]` numbers above 0.
            observed: `[N]` booleans; left out, no run was stopped.

        Raises:
            ValueError: As for the class; numbers do not pass as booleans.

        Example:
            >>> stopped = Sample.of([120, 340, 500], [True, True, False])
            >>> stopped.size, stopped.num_censored
            (3, 1)
        """
        numbers = np.array(values, dtype=np.float64)
        return cls(numbers, np.ones(numbers.shape, dtype=np.bool_) if observed is None else np.array(observed))

    @property
    def size(self) -> int:
        """The number of runs, N."""
        return self.values.size

    @property
    def num_censored(self) -> int:
        """How many of the runs were stopped."""
        return int(np.count_nonzero(~self.observed))

    @property
    def ranked(self) -> NDArray[np.float64]:
        """`[N]`, ascending: the observed values, then infinity for each run that was stopped.

        Under one budget a stopped run needs more episodes than any observed one, even one that took the whole budget,
        and stopped runs tie with each other. Infinity has just this order.
        """
        ranked: NDArray[np.float64] = np.sort(np.where(self.observed, self.values, np.inf))
        return ranked


def kaplan_meier(sample: Sample) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimate the share of runs that are still without the optimum, over time (Kaplan and Meier 1958).

    It is a step function: a share holds from its time up to the next. Runs may have been stopped at several budgets.
    A run that got there at the moment at which another was stopped got there first.

    Args:
        sample: The runs.

    Returns:
        Times `[K + 1]`, 0 and then all distinct values, ascending; and the share after each, `[K + 1]` in [0, 1],
        never rising. At a time at which runs were only stopped the share stays.

    Example:
        >>> times, share = kaplan_meier(Sample.of([10, 20, 20, 30], [True, True, True, False]))
        >>> times.tolist(), share.tolist()
        ([0.0, 10.0, 20.0, 30.0], [1.0, 0.75, 0.25, 0.25])
    """
    times, which = np.unique(sample.values, return_inverse=True)
    leaving = np.bincount(which)
    at_risk = sample.size - np.cumsum(leaving) + leaving
    arriving = np.bincount(which[sample.observed], minlength=times.size)
    share = np.cumprod(1 - arriving / at_risk)
    return np.concatenate(([0.0], times)), np.concatenate(([1.0], share))


def check_one_budget(*samples: Sample) -> None:
    """Refuse runs that cannot be put in order because they were not all given the same budget.

    Raises:
        ValueError: Runs were stopped at different values, or a run got there later than others were stopped.
    """
    values = np.concatenate([sample.values for sample in samples])
    observed = np.concatenate([sample.observed for sample in samples])
    budgets = np.unique(values[~observed])
    if budgets.size > 1:
        raise ValueError(f"all runs must share one budget, but they were stopped at {budgets[0]} and at {budgets[-1]}")
    if budgets.size and observed.any() and (latest := values[observed].max()) > budgets[0]:
        raise ValueError(f"all runs must share one budget, but one took {latest} and one was stopped at {budgets[0]}")
