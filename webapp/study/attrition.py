"""Differential drop-out: whether participants leave during one kind of explanation more often than during another.

If they do, those who are left to be compared are no longer alike (H. Zhou and A. Fishbach 2016, The pitfall of
experimenting on the web, JPSP 111, 493-504), so the test stands on the dashboard while data come in.

Participants see several kinds, and each drops out at most once. So the unit is not the person but the trial that
somebody started: each is an occasion to drop out, given that it did not happen before, as in a discrete-time hazard
model. A drop-out is put down to the trial in which it happened, whatever was seen earlier; people who were screened out
or left before the first trial count nowhere. Trials of one person are no independent draws in the strict sense, since
the last one alone can be a drop-out; conditional on having got there they are, as long as people are alike. Where some
people are readier to leave than others, counterbalancing gives each kind the same mix of them, and the test errs on the
cautious side.
"""

import math
import random
import sys
from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from typing import Literal

LEAST_EXPECTED = 5
"""Where an expected count is below this, the chi-square distribution is not trusted (Cochran's rule)."""

NUM_PERMUTATIONS = 9_999

_ROUNDING = 1e-9

_LEAST_P = sys.float_info.min


@dataclass(frozen=True, slots=True)
class DropOutTest:
    """A test of whether arms differ in their share of drop-outs.

    Attributes:
        statistic: Pearson's chi-square of the table arms x (dropped, not dropped).
        df: The number of arms with started trials - 1.
        p_value: In (0, 1]; what is too small for a float is given as the smallest one of full precision, 2.2e-308.
        method: `chi_square`, or `permutation` where an expected count is below `LEAST_EXPECTED`.
        standard_error: Of a p-value by permutation, for the draws that were made; None where it is exact.
    """

    statistic: float
    df: int
    p_value: float
    method: Literal["chi_square", "permutation"]
    standard_error: float | None


def compare_drop_out(started: Sequence[int], dropped: Sequence[int], seed: int) -> DropOutTest | None:
    """Compare arms.

    Args:
        started: By arm, how many trials were started.
        dropped: By arm, in how many of them somebody dropped out.
        seed: Of the permutations, where they are needed; the same numbers then give the same p-value.

    Returns:
        The test over the arms with started trials; None where there is nothing to compare: fewer than two such arms,
        or everybody or nobody dropped out.

    Raises:
        ValueError: The two have different lengths, or an arm has more drop-outs than trials.
    """
    if any(not 0 <= lost <= begun for begun, lost in zip(started, dropped, strict=True)):
        raise ValueError(f"drop-outs must be from 0 to the started trials, and {dropped} are not of {started}")
    arms = [(begun, lost) for begun, lost in zip(started, dropped, strict=True) if begun]
    num_lost, num_begun = sum(lost for _, lost in arms), sum(begun for begun, _ in arms)
    if len(arms) < 2 or num_lost in (0, num_begun):  # noqa: PLR2004 - one arm has no other
        return None
    sizes, losses = tuple(begun for begun, _ in arms), tuple(lost for _, lost in arms)
    statistic = _pearson(sizes, losses)
    if min(sizes) * min(num_lost, num_begun - num_lost) / num_begun >= LEAST_EXPECTED:
        p_value = max(chi_square_survival(statistic, len(arms) - 1), _LEAST_P)
        return DropOutTest(statistic, len(arms) - 1, p_value, "chi_square", None)
    p_value = _permuted(sizes, losses, seed)
    error = math.sqrt(p_value * (1 - p_value) / (NUM_PERMUTATIONS + 1))
    return DropOutTest(statistic, len(arms) - 1, p_value, "permutation", error)


def chi_square_survival(statistic: float, df: int) -> float:
    """Return the chance that a chi-square variable exceeds a value, by the finite sum that holds for whole df.

    Raises:
        ValueError: The statistic is negative, or there is no degree of freedom.
    """
    if statistic < 0 or df < 1:
        raise ValueError(f"a chi-square is at least 0 and has a degree of freedom, not {statistic} with {df}")
    half = statistic / 2
    if half == 0:
        return 1.0
    tail = math.erfc(math.sqrt(half)) if df % 2 else 0.0
    powers = (power / 2 for power in range(df % 2, df, 2))
    # The sum is of the terms of a Poisson distribution, at whole places or half-way between.
    return min(1.0, tail + sum(math.exp(power * math.log(half) - half - math.lgamma(power + 1)) for power in powers))


def _pearson(sizes: Sequence[int], losses: Sequence[int]) -> float:
    share = sum(losses) / sum(sizes)
    squares = sum((lost - share * begun) ** 2 / begun for begun, lost in zip(sizes, losses, strict=True))
    return squares / (share * (1 - share))


@lru_cache(maxsize=256)
def _permuted(sizes: tuple[int, ...], losses: tuple[int, ...], seed: int) -> float:
    """Return the share of permutations that are as uneven as what was seen, which counts as one of them.

    Dealing the drop-outs out to trials anew is drawing each arm's number of them, one arm after the other, from a
    hypergeometric distribution; so a draw costs one number per arm, not one per trial.
    """
    chooser = random.Random(seed)  # noqa: S311 - a permutation test needs no secrecy
    dealt = Counter(_deal(sizes, sum(losses), chooser) for _ in range(NUM_PERMUTATIONS))
    limit = _pearson(sizes, losses) - _ROUNDING
    as_uneven = sum(times for drawn, times in dealt.items() if _pearson(sizes, drawn) >= limit)
    return (as_uneven + 1) / (NUM_PERMUTATIONS + 1)


def _deal(sizes: tuple[int, ...], num_lost: int, chooser: random.Random) -> tuple[int, ...]:
    drawn, rest = [], sum(sizes)
    for size in sizes[:-1]:
        least, chances = _hypergeometric(size, num_lost, rest)
        lost = least + bisect_right(chances, chooser.random() * chances[-1])
        drawn.append(lost)
        num_lost, rest = num_lost - lost, rest - size
    return (*drawn, num_lost)


@lru_cache(maxsize=4096)
def _hypergeometric(size: int, num_lost: int, rest: int) -> tuple[int, tuple[float, ...]]:
    """Return the least number of the lost that an arm of `size` out of `rest` can get, and the summed chances from it.

    The chances are told relative to the largest one: what they sum up to is the last entry, not 1.
    """
    least, most = max(0, num_lost - (rest - size)), min(size, num_lost)
    logs = [_log_choose(size, lost) + _log_choose(rest - size, num_lost - lost) for lost in range(least, most + 1)]
    largest = max(logs)
    return least, tuple(accumulate(math.exp(log - largest) for log in logs))


def _log_choose(n: int, k: int) -> float:
    return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
