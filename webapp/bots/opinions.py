"""Where numbers come from that a person would feel: ratings from a latent normal, times from an ex-Gaussian.

A bot's rating of an item with K points is

    rating = clip(round(m + u + d + e), 1, K),   m = (K + 1) / 2,   u ~ N(0, 0.6^2),   e ~ N(0, 0.8^2)

where u is drawn once per bot (a random intercept, shared by all its ratings), e for each rating, and d is the declared
effect of the kind on the item in points of the scale. Between bots the latent rating has the standard deviation
sqrt(0.6^2 + 0.8^2) = 1, so that d is also the standardised difference between bots (Cohen's d); within a bot, where u
cancels, it is d / (0.8 sqrt(2)) of the difference of two ratings. Two ratings of one bot correlate by 0.36. Rounding
and the ends of the scale take something off: `expected_rating` says exactly what is left.
"""

import math
import random

BETWEEN_SD = 0.6
WITHIN_SD = 0.8


def latent_rating(points: int, shift: float, intercept: float, rng: random.Random) -> int:
    """Draw a rating from 1 to `points`.

    Args:
        points: The scale's K.
        shift: The effect d, in points.
        intercept: The bot's u, in points.
        rng: Where e comes from.
    """
    latent = (points + 1) / 2 + intercept + shift + rng.gauss(0, WITHIN_SD)
    return min(points, max(1, math.floor(latent + 0.5)))


def expected_rating(points: int, shift: float) -> float:
    """Return the mean of `latent_rating` over bots and ratings."""
    middle, sd = (points + 1) / 2 + shift, math.hypot(BETWEEN_SD, WITHIN_SD)
    return 1 + sum(_normal_tail((threshold + 0.5 - middle) / sd) for threshold in range(1, points))


def response_time_ms(rng: random.Random, typical_ms: float) -> int:
    """Draw a response time: normal with mean 0.7 and SD 0.15, plus exponential with mean 0.3, times `typical_ms`.

    An ex-Gaussian is skewed to the right as people's times are; `typical_ms` is its mean. None is below 1 ms.
    """
    drawn = rng.gauss(0.7, 0.15) + rng.expovariate(1 / 0.3)
    return max(1, round(typical_ms * drawn))


def happens(probability: float, rng: random.Random) -> bool:
    """Tell whether something of this probability happens; below 0 never, above 1 always."""
    return rng.random() < probability


def _normal_tail(z: float) -> float:
    return 0.5 * math.erfc(z / math.sqrt(2))
