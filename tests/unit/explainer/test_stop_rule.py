"""Sampling stops when every side of the threshold is settled, and hardly ever settles a wrong one."""

import numpy as np
import pytest

from webapp.explainer.stop_rule import Sides, StopRule
from webapp.explainer.trials import Tally

NUM_RUNS = 100
TOO_MANY = 15
"""So many wrong runs of 100 come with a chance of 1e-4 if each is wrong with 5 %."""


def side_of(chances: list[float]) -> np.ndarray:
    """1 above the mean of these and a target's 0, -1 below it, 0 on it."""
    values = np.array([*chances, 0.0])
    sides: np.ndarray = np.sign(np.round(values - values.mean(), 12)).astype(np.int64)
    return sides


def sample(chances: list[float], num_trials: int, rng: np.random.Generator) -> Tally:
    return Tally(num_trials, rng.binomial(num_trials, chances), np.zeros(len(chances), dtype=np.int64))


def settled_in_one_run(
    parts: list[list[float]], rule: StopRule, rng: np.random.Generator
) -> list[tuple[int, np.ndarray]]:
    """Return what each look has settled, up to the last that was taken."""
    sides, looks = Sides(len(parts[0]), rule), []
    tallies = [Tally.of_none(len(part)) for part in parts]
    for total in rule.looks:
        more = [sample(part, total - tally.num_trials, rng) for part, tally in zip(parts, tallies, strict=True)]
        tallies = [tally.plus(new) for tally, new in zip(tallies, more, strict=True)]
        sides.look(tallies)
        looks.append((total, sides.settled))
        if not sides.unsettled:
            break
    return looks


def wrong(settled: np.ndarray, truth: np.ndarray) -> bool:
    return bool(np.any((settled != 0) & (settled != truth)))


@pytest.mark.parametrize(
    "chances",
    [
        [0.6, 0.3, 0.3],  # Two of them lie on the threshold, so whatever is said of their side is wrong.
        [0.02, 0.01, 0.01],
        [0.99, 0.96, 0.93, 0.72, 0.72],
        [0.5, 0.26, 0.24],
        [0.0, 0.0, 0.0],  # All of them lie on it, and so does the target.
    ],
)
def test_at_most_one_run_in_twenty_settles_any_side_wrongly_in_any_look(chances: list[float]) -> None:
    rng, rule, truth = np.random.default_rng(1), StopRule(1600, early=True, first_look=25), side_of(chances)
    runs = [settled_in_one_run([chances], rule, rng) for _ in range(NUM_RUNS)]
    assert sum(any(wrong(settled, truth) for _, settled in run) for run in runs) < TOO_MANY


def test_the_same_holds_for_the_difference_of_two_chances() -> None:
    allowed, denied = [0.9, 0.8, 0.4], [0.3, 0.5, 0.1]
    truth = side_of([a - d for a, d in zip(allowed, denied, strict=True)])
    assert truth.tolist() == [1, 0, 0, -1]
    rng, rule = np.random.default_rng(2), StopRule(1600, early=True, first_look=25)
    runs = [settled_in_one_run([allowed, denied], rule, rng) for _ in range(NUM_RUNS)]
    assert sum(any(wrong(settled, truth) for _, settled in run) for run in runs) < TOO_MANY
    assert all(run[-1][1][0] == 1 and run[-1][1][3] == -1 for run in runs)


def test_looking_often_with_plain_standard_errors_would_be_wrong_far_more_often() -> None:
    chances, rng, rule = [0.6, 0.3, 0.3], np.random.default_rng(1), StopRule(1600, early=True, first_look=25)
    num_wrong = 0
    for _ in range(NUM_RUNS):
        tally, ever = Tally.of_none(3), False
        for total in rule.looks:
            tally = tally.plus(sample(chances, total - tally.num_trials, rng))
            shares, errors = tally.shares()
            apart = np.abs(shares - shares.sum() / 4) > 1.96 * errors
            ever |= bool(apart[1:].any())
        num_wrong += ever
    assert num_wrong > TOO_MANY


def test_the_error_is_shared_by_looks_states_and_chances_so_more_of_them_settle_less() -> None:
    none = np.zeros(2, dtype=np.int64)
    once, often = StopRule(1000), StopRule(1000, early=True, first_look=1, growth=1.01)
    widths = []
    for rule, tallies in (
        (once, [Tally(1000, np.array([400, 116]), none)]),
        (often, [Tally(1000, np.array([400, 116]), none)]),
        (once, [Tally(1000, np.array([400, 116]), none), Tally(1000, none, none)]),
    ):
        sides = Sides(2, rule)
        sides.look(tallies)
        widths.append(sides.unsettled)
    assert widths == [(), (2,), (2,)]


def test_sides_that_differ_are_settled_and_all_of_them() -> None:
    rule = StopRule(1_000_000, early=True)
    looks = settled_in_one_run([[0.5, 0.1, 0.3]], rule, np.random.default_rng(3))
    assert looks[-1][1].tolist() == [1, -1, 1, -1]
    assert looks[-1][0] < 10_000


def test_what_lies_on_the_threshold_stays_open_and_is_named() -> None:
    rule = StopRule(100_000, early=True)
    sides = Sides(3, rule)
    for total in rule.looks:
        sides.look([Tally(total, np.array([0.6, 0.3, 0.3] * np.array(total)).astype(int), np.zeros(3, dtype=int))])
    assert sides.unsettled == (2, 3)
    assert sides.settled.tolist() == [1, 0, 0, -1]


def test_a_share_of_nothing_or_all_settles_no_side_by_itself() -> None:
    # Two trials say hardly anything, although both shares have a standard error of 0.
    sides = Sides(2, StopRule(2))
    sides.look([Tally(2, np.array([2, 0]), np.array([0, 0]))])
    assert sides.unsettled == (1, 2)
    sides = Sides(2, StopRule(200))
    sides.look([Tally(200, np.array([200, 0]), np.array([0, 0]))])
    assert sides.unsettled == ()


def test_trials_that_were_broken_off_keep_a_side_open() -> None:
    for truncated, unsettled in ((0, ()), (150, (2,))):
        sides = Sides(2, StopRule(1000))
        sides.look([Tally(1000, np.array([700, 100]), np.array([0, truncated * 4]))])
        assert sides.unsettled == unsettled


def test_what_was_ruled_out_once_stays_ruled_out() -> None:
    sides = Sides(2, StopRule(1000, early=True, first_look=500))
    none = np.zeros(2, dtype=np.int64)
    sides.look([Tally(500, np.array([400, 50]), none)])
    first = sides.settled.tolist()
    sides.look([Tally(1000, np.array([450, 450]), none)])
    assert first == sides.settled.tolist() == [1, -1, -1]


def test_the_looks_grow_and_end_with_the_budget() -> None:
    assert StopRule(1000).looks == (1000,)
    assert StopRule(1000, early=True).looks == (100, 200, 400, 800, 1000)
    assert StopRule(800, early=True).looks == (100, 200, 400, 800)
    assert StopRule(50, early=True).looks == (50,)
    assert StopRule(5, early=True, first_look=1, growth=1.1).looks == (1, 2, 3, 4, 5)
    assert len(StopRule(1_000_000, early=True).looks) == 15


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"budget": 0}, "trials must be a whole number from 1 to 1,000,000, not 0"),
        ({"budget": 1_000_001}, "trials must be a whole number from 1 to 1,000,000, not 1000001"),
        ({"budget": 10.5}, "trials must be a whole number from 1 to 1,000,000, not 10.5"),
        ({"budget": float("nan")}, "trials must be a whole number from 1 to 1,000,000, not nan"),
        ({"first_look": 0}, "the first look must come after 1 trial or more, not 0"),
        ({"growth": 1.0}, "the trials must grow by a factor above 1, not 1.0"),
        ({"growth": float("nan")}, "the trials must grow by a factor above 1, not nan"),
        ({"error": 0.0}, "the probability of an error must lie between 0 and 1, not 0.0"),
        ({"error": 1.0}, "the probability of an error must lie between 0 and 1, not 1.0"),
    ],
)
def test_a_stop_rule_is_valid_from_birth(settings: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        StopRule(**settings)  # type: ignore[arg-type]
