"""The rows of the importance experiment: how they are made of explanations, and read back as series.

Data generated, one row per importance, estimator and step:

- importance: `return_probability` or `ace`.
- estimator: one of `ESTIMATORS`.
- policy: `planner`, or `dqn` for the agent's own path.
- step: from 1 to T + 1, the target.
- state: in words.
- action: its name; missing at the target.
- value: the importance; 0 at the target by definition.
- standard_error, low, high: the standard error and the 95 % interval; missing where the value is exact.
- threshold: the mean of all T + 1 values of the estimator.
- is_subgoal: whether the value lies above the threshold and the next one below it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from webapp.explainer.explanation import Explanation
from webapp.explainer.importance import Importance, ProbabilityKind
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.requests import EstimatorKind
from webapp.explainer.stability import Count
from webapp.explainer.subjects import PolicyKind, WorldKind
from webapp.explainer.worlds.key_door import KeyDoorState, key_door_state

Estimator = Literal["exact", "sampled", "learned exact", "learned sampled", "agent exact"]
ESTIMATORS: Mapping[Estimator, tuple[WorldKind, PolicyKind, EstimatorKind]] = {
    "exact": ("exact", "planner", "exact"),
    "sampled": ("exact", "planner", "monte-carlo"),
    "learned exact": ("learned", "planner", "exact"),
    "learned sampled": ("learned", "planner", "monte-carlo"),
    "agent exact": ("learned", "dqn", "exact"),
}
"""In which world, for whose path, and how. All but the last explain the planner's path, so that their steps line up."""

_HEADINGS = ("right", "down", "left", "up")
_CONFIDENCE = 1.959963984540054
"""So many standard errors to either side hold a value in 95 of 100 cases."""


def rows_of(
    found: Explanation, mdp: DeterministicMDP, kind: ProbabilityKind, estimator: Estimator, num_trials: int
) -> pd.DataFrame:
    """Return what one estimator found, one row per step.

    Args:
        found: The explanation of a path in the world.
        mdp: The world, whose labels are `KeyDoorState`s.
        kind: Which importance.
        estimator: What found it.
        num_trials: Rollouts per state and probability; of no use where the importance is exact.
    """
    path, importance = found.path, found.importance
    low, high = _interval(importance, kind, num_trials)
    missing = np.full(len(path.states), np.nan)
    return pd.DataFrame(
        {
            "importance": kind,
            "estimator": estimator,
            "policy": ESTIMATORS[estimator][1],
            "step": range(1, len(path.states) + 1),
            "state": [describe(key_door_state(mdp, state)) for state in path.states],
            "action": [*(mdp.actions[action] for action in path.actions), None],
            "value": importance.values,
            "standard_error": missing if importance.standard_errors is None else importance.standard_errors,
            "low": low,
            "high": high,
            "threshold": found.threshold,
            "is_subgoal": [step in found.subgoals for step in range(1, len(path.states) + 1)],
        }
    )


def describe(state: KeyDoorState) -> str:
    """Say a state in words."""
    key, door = "key" if state.has_key else "no key", "door open" if state.door_open else "door shut"
    return f"({state.x}, {state.y}) facing {_HEADINGS[state.heading]}, {key}, {door}"


def _interval(
    importance: Importance, kind: ProbabilityKind, num_trials: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the 95 % limits, each `[T + 1]`: Wilson's for a probability, the normal ones for a difference of two.

    Where all trials of both probabilities came out alike, a normal interval has no width; the true difference may then
    still be some 4 / num_trials away. The target's importance is no estimate, and its interval is the value itself.
    """
    values, errors = importance.values, importance.standard_errors
    if errors is None:
        return np.full(len(values), np.nan), np.full(len(values), np.nan)
    if kind == "ace":
        margins = _CONFIDENCE * errors
        return np.clip(values - margins, -1.0, 1.0), np.clip(values + margins, -1.0, 1.0)
    pairs = [Count(round(value * num_trials), num_trials).interval for value in values[:-1].tolist()]
    limits = np.array([*pairs, (0.0, 0.0)])
    return limits[:, 0], limits[:, 1]


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """The rows of one importance and one estimator.

    Attributes:
        importance: Which importance.
        estimator: What estimated it.
        states: `[T + 1]`, in words.
        actions: `[T]` names.
        values: `[T + 1]`.
        standard_errors: `[T + 1]`, or None where the values are exact.
        low: `[T + 1]`: the lower limits, or the values where they are exact.
        high: `[T + 1]`: the upper limits, or the values where they are exact.
        threshold: The mean.
        subgoals: Steps from 1, ascending.
    """

    importance: str
    estimator: str
    states: tuple[str, ...]
    actions: tuple[str, ...]
    values: NDArray[np.float64]
    standard_errors: NDArray[np.float64] | None
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    threshold: float
    subgoals: tuple[int, ...]

    @property
    def steps(self) -> range:
        """The steps, from 1 to T + 1."""
        return range(1, len(self.values) + 1)

    def side(self, step: int) -> int:
        """Return 1 where the importance is surely above the threshold, -1 where surely not, and 0 where that is open.

        It is open where the interval holds the threshold. That the threshold is itself an estimate is left out: its
        error is about a fifth of one state's on a path of 20 steps.
        """
        if self.standard_errors is None:
            return 1 if self.values[step - 1] > self.threshold else -1
        return int(self.low[step - 1] > self.threshold) - int(self.high[step - 1] < self.threshold)

    def subgoal_side(self, step: int) -> int:
        """Return 1 where a step, from 1 to T, is surely a subgoal, -1 where surely none, and 0 where that is open."""
        if self.standard_errors is None:
            return 1 if step in self.subgoals else -1
        return min(self.side(step), -self.side(step + 1))


def every_series(rows: pd.DataFrame) -> Iterator[Series]:
    """Yield the series of some rows, in the rows' order; rows read back from a file serve as well."""
    for (importance, estimator), group in rows.groupby(["importance", "estimator"], sort=False):
        yield _series(str(importance), str(estimator), group.sort_values("step"))


def find_series(rows: pd.DataFrame, importance: str, estimator: Estimator) -> Series | None:
    """Return the series of one importance and one estimator, if the rows have it."""
    wanted = (importance, estimator)
    return next((found for found in every_series(rows) if (found.importance, found.estimator) == wanted), None)


def exact_series(rows: pd.DataFrame, importance: str) -> Series:
    """Return the exact series of one importance, which every run has.

    Raises:
        ValueError: The rows have none.
    """
    found = find_series(rows, importance, "exact")
    if found is None:
        raise ValueError(f"there are no exact values of {importance} among the rows; give those of the same run")
    return found


def _series(importance: str, estimator: str, group: pd.DataFrame) -> Series:
    values = group["value"].to_numpy(dtype=np.float64)
    errors = group["standard_error"].to_numpy(dtype=np.float64)
    exact = bool(np.isnan(errors).all())
    return Series(
        importance,
        estimator,
        states=tuple(map(str, group["state"])),
        actions=tuple(map(str, group["action"].iloc[:-1])),
        values=values,
        standard_errors=None if exact else errors,
        low=values if exact else group["low"].to_numpy(dtype=np.float64),
        high=values if exact else group["high"].to_numpy(dtype=np.float64),
        threshold=float(group["threshold"].iloc[0]),
        subgoals=tuple(int(step) for step in group.loc[group["is_subgoal"], "step"]),
    )
