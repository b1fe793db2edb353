"""The links of cumulative models: chances of intervals of the latent scale, with derivatives that survive far out."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, ndtr

Link = Literal["probit", "logit"]
Array = NDArray[np.float64]

RESIDUAL_SD: dict[Link, float] = {"probit": 1.0, "logit": float(np.pi / np.sqrt(3))}
"""The standard deviation of the latent rating within a person, in the unit of the model's coefficients."""

_LEAST = 1e-300
"""Keeps the logarithm finite where an interval has no chance in floating point."""


@dataclass(frozen=True, slots=True)
class IntervalChance:
    """The logarithm of `F(upper) - F(lower)`, and its derivatives in both ends; all of the ends' shape.

    Attributes:
        log: The logarithm, at most 0.
        by_upper: Its derivative in the upper end, at least 0; 0 where that is infinite.
        by_lower: Its derivative in the lower end, at most 0.
        upper_upper: Second derivative in the upper end.
        upper_lower: Mixed second derivative.
        lower_lower: Second derivative in the lower end.
    """

    log: Array
    by_upper: Array
    by_lower: Array
    upper_upper: Array
    upper_lower: Array
    lower_lower: Array

    @property
    def by_shift(self) -> Array:
        """The derivative when both ends move down together, that is by the latent mean."""
        return -(self.by_upper + self.by_lower)

    @property
    def by_shift_twice(self) -> Array:
        """The second derivative of the same; never positive, because both links are log-concave."""
        return self.upper_upper + 2 * self.upper_lower + self.lower_lower


def interval_chance(upper: Array, lower: Array, link: Link) -> IntervalChance:
    """Compute chances of intervals of the latent scale.

    Args:
        upper: Upper ends, `inf` allowed.
        lower: Lower ends, `-inf` allowed, each below its upper end.
        link: `probit` for a normal latent scale, `logit` for a logistic one.
    """
    if link == "probit":
        # Above the middle both tails are taken from the other side, where differences keep their digits.
        flipped = lower > 0
        chance = ndtr(np.where(flipped, -lower, upper)) - ndtr(np.where(flipped, -upper, lower))
        at_upper, at_lower = _normal_density(upper), _normal_density(lower)
        slope_upper, slope_lower = -_finite(upper) * at_upper, -_finite(lower) * at_lower
    else:
        below, above = expit(upper), expit(-lower)
        with np.errstate(over="ignore"):
            chance = below * above * -np.expm1(lower - upper)
        at_upper, at_lower = below * expit(-upper), above * expit(lower)
        slope_upper, slope_lower = at_upper * (1 - 2 * below), at_lower * (2 * above - 1)
    chance = np.maximum(chance, _LEAST)
    a, c = at_upper / chance, -at_lower / chance
    return IntervalChance(
        log=np.log(chance),
        by_upper=a,
        by_lower=c,
        upper_upper=slope_upper / chance - a * a,
        upper_lower=-a * c,
        lower_lower=-slope_lower / chance - c * c,
    )


def _normal_density(at: Array) -> Array:
    return np.asarray(np.exp(-0.5 * at * at) / np.sqrt(2 * np.pi))


def _finite(at: Array) -> Array:
    """Return the value, or 0 where it is infinite and meets a density of 0."""
    return np.where(np.isinf(at), 0.0, at)
