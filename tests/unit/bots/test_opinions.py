import math
import random
from statistics import fmean, stdev

import pytest

from webapp.bots.opinions import BETWEEN_SD, WITHIN_SD, expected_rating, latent_rating, response_time_ms

NUM_BOTS = 400


def ratings(points: int, shift: float, seed: int) -> list[int]:
    """One rating by each of 400 bots."""
    rng = random.Random(seed)
    return [latent_rating(points, shift, rng.gauss(0, BETWEEN_SD), rng) for _ in range(NUM_BOTS)]


@pytest.mark.parametrize("points", [2, 5, 7, 11])
@pytest.mark.parametrize("shift", [-3.0, -0.5, 0.0, 0.5, 2.0])
def test_a_planted_effect_is_recovered_within_its_standard_error(points: int, shift: float) -> None:
    drawn = ratings(points, shift, seed=2021)
    assert set(drawn) <= set(range(1, points + 1))
    error = stdev(drawn) / math.sqrt(NUM_BOTS)
    assert abs(fmean(drawn) - expected_rating(points, shift)) <= 3 * max(error, 0.01)


def test_half_a_point_on_a_long_scale_is_half_a_standard_deviation() -> None:
    control, treated = ratings(11, 0, seed=1), ratings(11, 0.5, seed=2)
    difference = fmean(treated) - fmean(control)
    error = math.sqrt((stdev(treated) ** 2 + stdev(control) ** 2) / NUM_BOTS)
    assert abs(difference - 0.5) < 2 * error
    # Rounding adds the variance of a uniform number between two points.
    assert math.isclose(stdev(control), math.sqrt(BETWEEN_SD**2 + WITHIN_SD**2 + 1 / 12), rel_tol=0.1)


def test_the_expected_rating_is_what_a_sum_over_a_fine_grid_gives() -> None:
    grid = [(step + 0.5) / 1000 for step in range(-8000, 8000)]
    weights = [math.exp(-(z**2) / 2) / math.sqrt(2 * math.pi) / 1000 for z in grid]
    by_grid = sum(weight * min(5, max(1, math.floor(3.7 + z + 0.5))) for z, weight in zip(grid, weights, strict=True))
    assert math.isclose(expected_rating(5, 0.7), by_grid, abs_tol=1e-3)


def test_without_an_effect_the_middle_of_the_scale_is_expected() -> None:
    assert [expected_rating(points, 0) for points in (2, 5, 7)] == pytest.approx([1.5, 3, 4])


def test_response_times_have_the_declared_mean_and_a_long_tail_to_the_right() -> None:
    rng = random.Random(7)
    times = sorted(response_time_ms(rng, 1000) for _ in range(4000))
    assert math.isclose(fmean(times), 1000, rel_tol=0.03)
    assert times[2000] < fmean(times)
    assert times[0] >= 1
