"""What a fitted cumulative link mixed model says: estimates, errors, linear combinations, standardized effects."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from webapp.analysis.links import RESIDUAL_SD, Array, Link


@dataclass(frozen=True, slots=True)
class OrdinalFit:
    """A fitted cumulative link mixed model with T thresholds and P coefficients.

    Attributes:
        link: Its link.
        names: `[P]`, of the covariates.
        categories: `[T + 1]`, the ratings that occur, in order; others play no part.
        thresholds: `[T]` (nominal effects: those of one group after the other).
        coefficients: `[P]`; positive ones raise ratings.
        sd: Of the random intercepts, at least 0, in the unit of the coefficients.
        covariance: `[K, K]` of thresholds, coefficients and `sd`, from the observed information.
        log_likelihood: At the maximum, by quadrature.
        intercepts: `[N]`, each person's most probable intercept, in the unit of the coefficients; people as sorted.
        num_ratings: n.
        num_people: N.
        has_person_effect: Whether there is a random intercept. Without repeated ratings there is none.
        num_nodes: Of the quadrature: at first as asked for, then twice as many until it was fine enough.
    """

    link: Link
    names: tuple[str, ...]
    categories: tuple[int, ...]
    thresholds: Array
    coefficients: Array
    sd: float
    covariance: Array
    log_likelihood: float
    intercepts: Array
    num_ratings: int
    num_people: int
    has_person_effect: bool
    num_nodes: int

    @property
    def latent_sd(self) -> float:
        """The standard deviation of the latent rating over people and within them, in the unit of the coefficients."""
        return float(np.hypot(RESIDUAL_SD[self.link], self.sd))

    @property
    def num_parameters(self) -> int:
        """K, or K - 1 without a random intercept."""
        return len(self.thresholds) + len(self.coefficients) + self.has_person_effect

    @property
    def standard_errors(self) -> Array:
        """`[K]` of thresholds, coefficients and `sd`."""
        return np.sqrt(np.diag(self.covariance))

    def estimate(self, weights: ArrayLike) -> tuple[float, float]:
        """Return a linear combination of the coefficients and its standard error; `weights` is `[P]`."""
        full = self._full(weights)
        return float(np.asarray(weights, dtype=float) @ self.coefficients), float(
            np.sqrt(full @ self.covariance @ full)
        )

    def standardized(self, weights: ArrayLike) -> tuple[float, float]:
        """Return the same in standard deviations of the latent rating, with its error by the delta method.

        The latent rating varies over people and within them, so this is a difference in the manner of Cohen's d.
        """
        value, _ = self.estimate(weights)
        gradient = self._full(weights) / self.latent_sd
        gradient[-1] = -value * self.sd / self.latent_sd**3
        return value / self.latent_sd, float(np.sqrt(gradient @ self.covariance @ gradient))

    def _full(self, weights: ArrayLike) -> Array:
        return np.concatenate([np.zeros(len(self.thresholds)), np.asarray(weights, dtype=float), [0.0]])
