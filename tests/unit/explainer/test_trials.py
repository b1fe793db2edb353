"""What counts say about a probability: shares, their errors, and limits that hold for every number of trials."""

from itertools import product
from math import comb, log

import numpy as np
import pytest

from webapp.explainer.trials import Tally, in_turns, upper_limit


def tally(num_trials: int, successes: list[int], truncated: list[int] | None = None) -> Tally:
    return Tally(num_trials, np.array(successes), np.array(truncated or [0] * len(successes)))


def lower_limit(successes: np.ndarray, trials: np.ndarray, error: float) -> np.ndarray:
    return 1 - upper_limit(trials - successes, trials, error)


def binomial(n: int, p: float) -> np.ndarray:
    return np.array([comb(n, k) * p**k * (1 - p) ** (n - k) for k in range(n + 1)])


def test_a_share_has_the_standard_error_of_a_share() -> None:
    values, errors = tally(100, [64, 50, 0, 100]).shares()
    assert values.tolist() == [0.64, 0.5, 0.0, 1.0]
    assert errors == pytest.approx([0.048, 0.05, 0.0, 0.0])


def test_two_series_of_trials_add_up() -> None:
    both = tally(10, [3, 4], [1, 0]).plus(tally(20, [5, 6], [0, 2]))
    assert both.num_trials == 30
    assert both.successes.tolist() == [8, 10]
    assert both.truncated.tolist() == [1, 2]


@pytest.mark.parametrize("error", [0.3, 0.05, 1e-4])
@pytest.mark.parametrize("n", [1, 7, 40])
def test_no_limit_misses_a_chance_more_often_than_it_may(n: int, error: float) -> None:
    counts, trials = np.arange(n + 1), np.full(n + 1, n)
    low, high = lower_limit(counts, trials, error), upper_limit(counts, trials, error)
    for p in np.linspace(0, 1, 201):
        chances = binomial(n, p)
        assert chances[low > p].sum() <= error
        assert chances[high < p].sum() <= error


def test_the_limits_hold_for_the_mean_of_chances_that_differ() -> None:
    chances, error = (0.05, 0.3, 0.3, 0.9, 1.0, 0.0, 0.5, 0.8), 0.1
    n = len(chances)
    spread = np.zeros(n + 1)
    for outcome in product((0, 1), repeat=n):
        spread[sum(outcome)] += np.prod([p if hit else 1 - p for p, hit in zip(chances, outcome, strict=True)])
    counts, trials = np.arange(n + 1), np.full(n + 1, n)
    mean = sum(chances) / n
    assert spread[lower_limit(counts, trials, error) > mean].sum() <= error
    assert spread[upper_limit(counts, trials, error) < mean].sum() <= error


def test_a_share_of_nothing_or_all_is_no_certainty() -> None:
    # With no success in n trials the inequality is (1 - q)^n >= error, which is also the exact limit.
    assert upper_limit(np.array([0]), np.array([50]), 0.01) == pytest.approx([1 - 0.01 ** (1 / 50)], abs=1e-9)
    assert lower_limit(np.array([50]), np.array([50]), 0.01) == pytest.approx([0.01 ** (1 / 50)], abs=1e-9)
    assert lower_limit(np.array([0]), np.array([50]), 0.01) == pytest.approx([0.0], abs=1e-9)


def test_a_limit_lies_where_the_relative_entropy_says() -> None:
    q = float(upper_limit(np.array([30]), np.array([100]), 0.01)[0])
    assert 100 * (0.3 * log(0.3 / q) + 0.7 * log(0.7 / (1 - q))) == pytest.approx(log(100), abs=1e-6)
    assert q > 0.3


def test_limits_end_with_the_mean_of_all_chances() -> None:
    low, high = tally(50, [10, 20, 30]).limits(0.1)
    assert low[3] == pytest.approx(lower_limit(np.array([60]), np.array([150]), 0.05)[0])
    assert high[3] == pytest.approx(upper_limit(np.array([60]), np.array([150]), 0.05)[0])
    assert high[3] - low[3] < high[1] - low[1]


def test_a_trial_that_was_broken_off_may_have_come_out_either_way() -> None:
    low, high = tally(50, [10], [5]).limits(0.1)
    assert low[0] == tally(50, [10]).limits(0.1)[0][0]
    assert high[0] == tally(50, [15]).limits(0.1)[1][0]


def test_trials_run_in_turns_that_are_no_larger_than_they_may_be() -> None:
    turns: list[int] = []

    def run(size: int) -> Tally:
        turns.append(size)
        return tally(size, [size, 0, 1])

    total = in_turns(run, num_chances=3, num_trials=10, most_walkers=14)
    assert turns == [4, 4, 2]
    assert total.successes.tolist() == [10, 0, 3]
    turns.clear()
    assert in_turns(run, num_chances=3, num_trials=2, most_walkers=1).num_trials == 2
    assert turns == [1, 1]
    assert in_turns(run, num_chances=0, num_trials=5, most_walkers=9).successes.tolist() == []


@pytest.mark.parametrize(
    ("num_trials", "successes", "truncated", "message"),
    [
        (5, [6], [0], "no count can be larger than the number of trials, 5"),
        (5, [3], [3], "no count can be larger than the number of trials, 5"),
        (5, [-1], [0], "a count must be 0 or larger"),
        (5, [1], [-1], "a count must be 0 or larger"),
        (5, [1, 2], [1], r"shape \[T\]"),
    ],
)
def test_a_tally_is_valid_from_birth(num_trials: int, successes: list[int], truncated: list[int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tally(num_trials, successes, truncated)
