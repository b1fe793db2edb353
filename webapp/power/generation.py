"""Ratings of people who do not exist: the same latent normal as that of the bots, at the level of the data.

A rating of an item with K points is clip(round(m + d + u + e), 1, K), where m = (K + 1) / 2 is the middle of the scale,
d the effect of the kind, u ~ N(0, between^2) the person's own level and e ~ N(0, within^2), drawn for each rating. The
two variances sum to 1, so that d is a standardised difference of latent ratings between people, the thresholds lie one
standard deviation apart, and a cumulative probit model with a random intercept per person is the true one.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from webapp.power.design import Questions, Trials
from webapp.study.experiments import Kind

BETWEEN_SD = 0.6
"""As of the bots: a person's own level makes up 36 % of the variance."""


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """All that chance decides about ratings of an item.

    Attributes:
        people: `[N]`, each person's own level u.
        ratings: `[N, T]`, what is new in each rating, e.
    """

    people: NDArray[np.float64]
    ratings: NDArray[np.float64]


def draw_noise(rng: np.random.Generator, num_people: int, num_trials: int, between_sd: float = BETWEEN_SD) -> Noise:
    """Draw the noise of an item; the variances sum to 1.

    Args:
        rng: Where it comes from.
        num_people: N.
        num_trials: T.
        between_sd: The standard deviation of people's own levels, from 0 to below 1.

    Raises:
        ValueError: It is not.
    """
    drawn = rng.standard_normal((num_people, 1 + num_trials))  # By person, so that more leave the first as they are.
    return Noise(between_sd * drawn[:, 0], within_sd(between_sd) * drawn[:, 1:])


def within_sd(between_sd: float) -> float:
    """Return the standard deviation of e that makes up for 1, given that of u.

    Raises:
        ValueError: It leaves nothing, or is negative.
    """
    if not 0 <= between_sd < 1:
        raise ValueError(f"the standard deviation between people is from 0 to below 1, not {between_sd:g}")
    return math.sqrt(1 - between_sd**2)


def rate(questions: Questions, trials: Trials, noise: Noise, shifts: Mapping[Kind, float]) -> NDArray[np.int64]:
    """Return `[N, T]` ratings from 1 to the item's points.

    Args:
        questions: What is asked.
        trials: Of the N people.
        noise: Of as many people and trials.
        shifts: The effect d by kind; what is not there is 0.
    """
    of_kind = np.array([shifts.get(kind, 0.0) for kind in questions.experiment.kinds])
    latent = (questions.points + 1) / 2 + of_kind[trials.kinds] + noise.people[:, None] + noise.ratings
    rounded: NDArray[np.int64] = np.clip(np.floor(latent + 0.5), 1, questions.points).astype(np.int64)
    return rounded


def rated_frame(questions: Questions, trials: Trials, ratings: NDArray[np.int64], num_people: int) -> pd.DataFrame:
    """Return the ratings of the first people as the planned model takes them.

    Returns:
        Columns `participant`, `kind`, `layout`, `trial` (from 1) and `rating`, sorted by participant and trial. Trials
        of a kind after which the item is not asked are left out.
    """
    kinds = np.array(questions.experiment.kinds, dtype=object)[trials.kinds[:num_people]]
    num_trials = kinds.shape[1]
    names = np.array([f"p{number:06d}" for number in range(num_people)], dtype=object)
    frame = pd.DataFrame(
        {
            "participant": np.repeat(names, num_trials),
            "kind": kinds.ravel(),
            "layout": np.array(questions.experiment.layouts, dtype=object)[trials.layouts[:num_people]].ravel(),
            "trial": np.tile(np.arange(1, num_trials + 1), num_people),
            "rating": ratings[:num_people].ravel(),
        }
    )
    if len(questions.kinds) == len(questions.experiment.kinds):
        return frame
    return frame[frame["kind"].isin(questions.kinds)].reset_index(drop=True)
