"""Importance of the states of a path (Sakai et al. 2021, section 4.2.1 and Algorithm 1).

For a state `s_f` of the path: take `r` random actions from it, then follow the policy.

`return_probability` is the probability that the policy leads back to `s_f`. `ace`, the average causal effect of being
allowed to take the optimal action in `s_f`, is the probability of reaching the goal minus the same with that action
forbidden in `s_f`, in both phases. The target's importance is 0 by definition.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy, StateAction
from webapp.explainer.rollouts import States, arrivals, returns, walk_randomly
from webapp.explainer.solvers import PolicyForest, Trajectory, policy_forest, random_phase

if TYPE_CHECKING:
    from webapp.explainer.batched_rollouts import RecurrentWorldModel, Walkers

ImportanceKind = Literal["return_probability", "ace"]
IMPORTANCE_KINDS: tuple[ImportanceKind, ...] = ("return_probability", "ace")

Run = Callable[[NDArray[np.int64], list[StateAction]], NDArray[np.bool_]]
"""Runs one rollout from each of `[N]` states, told the optimal action there, and says which `[N]` succeed."""

_MAX_WALKERS = 10_000
"""So many rollouts run at once; more are run in turns, so that their number costs time and not memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Importance:
    """The importance of each state of a path, with the standard error that says how far to trust it.

    Attributes:
        values: `[T + 1]` in [-1, 1]; the target's entry, the last, is 0. A probability is never below 0; an `ace` only
            where the policy's own action keeps it from the goal.
        standard_errors: `[T + 1]`, 0 or larger, or None from an exact solver.

    Raises:
        ValueError: A value lies outside its range, or the shapes differ.
    """

    values: NDArray[np.float64]
    standard_errors: NDArray[np.float64] | None

    def __post_init__(self) -> None:
        if self.values.ndim != 1 or not len(self.values):
            raise ValueError(f"importance must have shape [T + 1], not {self.values.shape}")
        if not np.all(np.abs(self.values) <= 1 + 1e-9):
            raise ValueError(f"importance must lie between -1 and 1, and this does not: {self.values}")
        if self.values[-1] != 0:
            raise ValueError(f"the target's importance is 0 by definition, not {self.values[-1]}")
        if self.standard_errors is None:
            return
        if self.standard_errors.shape != self.values.shape:
            raise ValueError(f"{self.values.shape} values need as many errors, not {self.standard_errors.shape}")
        if not np.all(self.standard_errors >= 0):
            raise ValueError(f"a standard error is 0 or larger, and these are not: {self.standard_errors}")


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number with its standard error."""

    value: float
    standard_error: float

    def minus(self, other: "Estimate") -> "Estimate":
        """Return the difference of two independent estimates."""
        return Estimate(self.value - other.value, float(np.hypot(self.standard_error, other.standard_error)))


def share(num_successes: int, num_trials: int) -> Estimate:
    """Estimate a probability `p` by a share, with the standard error `sqrt(p (1 - p) / num_trials)` of that share."""
    value = num_successes / num_trials
    return Estimate(value, float(np.sqrt(value * (1 - value) / num_trials)))


def exact_importance(
    kind: ImportanceKind, mdp: DeterministicMDP, policy: Policy, path: Trajectory, random_steps: int
) -> Importance:
    """Compute the importance of every state of a path without sampling.

    Args:
        kind: Which of the two definitions.
        mdp: The world.
        policy: `[S]`. Where it never reaches a goal it neither returns nor arrives.
        path: The policy's path to the goal.
        random_steps: r, at least 0.

    Raises:
        ValueError: The number of random actions is negative, or the path does not follow the policy to a goal.
    """
    _check_path(mdp, policy, path)
    forest = policy_forest(mdp, policy)
    solve = {"return_probability": _exact_return_probability, "ace": _exact_ace}[kind]
    values = [solve(mdp, forest, featured, random_steps) for featured in path.pairs]
    return Importance(np.clip([*values, 0.0], -1.0, 1.0), standard_errors=None)


def sampled_importance(
    kind: ImportanceKind,
    mdp: DeterministicMDP,
    policy: Policy,
    path: Trajectory,
    random_steps: int,
    num_trials: int,
    rng: np.random.Generator,
) -> Importance:
    """Estimate the importance of every state of a path by rollouts on the table (Algorithm 1).

    For `ace` both probabilities are estimated, each from `num_trials` rollouts of its own.

    Args:
        kind: Which of the two definitions.
        mdp: The world.
        policy: `[S]`. A rollout in which it loops neither returns nor arrives.
        path: The policy's path to the goal.
        random_steps: r, at least 0.
        num_trials: Rollouts per state and probability, at least 1.
        rng: The stream of the draws.

    Raises:
        ValueError: A number is too small, or the path does not follow the policy to a goal.
    """
    _check_path(mdp, policy, path)

    def walk(starts: States, forbidden: list[StateAction] | None = None) -> States:
        return walk_randomly(mdp, starts, random_steps, rng, forbidden=forbidden)

    if kind == "return_probability":
        return _estimate(path, num_trials, lambda starts, _: returns(mdp, policy, walk(starts), starts))
    return _estimate(
        path,
        num_trials,
        lambda starts, _: arrivals(mdp, policy, walk(starts)),
        lambda starts, pairs: arrivals(mdp, policy, walk(starts, pairs), blocked=starts),
    )


def recurrent_importance(
    kind: ImportanceKind,
    model: "RecurrentWorldModel",
    mdp: DeterministicMDP,
    policy: Policy,
    path: Trajectory,
    random_steps: int,
    num_trials: int,
    seed: int,
) -> Importance:
    """Estimate the importance of every state of a path by rollouts through a recurrent world model (Algorithm 1).

    The model's own predictions lead each rollout, its hidden state carried along from the path's state on.

    Args:
        kind: Which of the two definitions.
        model: The world model.
        mdp: The model's table: what its states are called, and where the policy's path runs.
        policy: `[S]` on that table.
        path: The policy's path to the goal.
        random_steps: r, at least 0.
        num_trials: Rollouts per state and probability, at least 1.
        seed: Of the draws, at least 0.

    Raises:
        ValueError: A number is too small, or the path does not follow the policy to a goal.
    """
    from webapp.explainer.batched_rollouts import RecurrentRollouts, seeded  # noqa: PLC0415 - loads torch.

    _check_path(mdp, policy, path)
    rollouts, generator = RecurrentRollouts(model, mdp, policy), seeded(seed)

    def walk(starts: NDArray[np.int64], forbidden: list[StateAction] | None = None) -> "Walkers":
        return rollouts.walk_randomly(rollouts.start(starts), random_steps, generator, forbidden=forbidden)

    if kind == "return_probability":
        return _estimate(path, num_trials, lambda starts, _: rollouts.returns(walk(starts), starts))
    return _estimate(
        path,
        num_trials,
        lambda starts, _: rollouts.arrivals(walk(starts)),
        lambda starts, pairs: rollouts.arrivals(walk(starts, pairs), blocked=starts),
    )


def _exact_return_probability(
    mdp: DeterministicMDP, forest: PolicyForest, featured: StateAction, random_steps: int
) -> float:
    """The mass of the random phase on the proper subtree of the state: those that pass through it, not itself."""
    state, _ = featured
    returning = forest.passes_through(state)
    returning[state] = False
    return float(random_phase(mdp, state, random_steps)[returning].sum())


def _exact_ace(mdp: DeterministicMDP, forest: PolicyForest, featured: StateAction, random_steps: int) -> float:
    """The mass that arrives when all is allowed, minus the mass that arrives without passing through the state."""
    state, _ = featured
    allowed = random_phase(mdp, state, random_steps)
    denied = random_phase(mdp, state, random_steps, forbidden=featured)
    return float(allowed[forest.arrives].sum() - denied[forest.arrives & ~forest.passes_through(state)].sum())


def _estimate(path: Trajectory, num_trials: int, run: Run, minus: Run | None = None) -> Importance:
    """Estimate a chance, or the difference of two, for each of a path's `T` states; the target's 0 is certain."""
    estimates = _shares(path, num_trials, run)
    if minus is not None:
        others = _shares(path, num_trials, minus)
        estimates = [estimate.minus(other) for estimate, other in zip(estimates, others, strict=True)]
    values = [estimate.value for estimate in estimates]
    errors = [estimate.standard_error for estimate in estimates]
    return Importance(np.array([*values, 0.0]), np.array([*errors, 0.0]))


def _shares(path: Trajectory, num_trials: int, run: Run) -> list[Estimate]:
    """Start as many walkers in each of a path's `T` states, and count those that come where they should."""
    if num_trials < 1:
        raise ValueError(f"the number of trials must be 1 or larger, not {num_trials}")
    if not path.num_steps:
        return []
    num_successes = np.zeros(path.num_steps, dtype=np.int64)
    most = max(1, _MAX_WALKERS // path.num_steps)
    for first in range(0, num_trials, most):
        size = min(most, num_trials - first)
        pairs = [pair for pair in path.pairs for _ in range(size)]
        successes = run(np.array(path.states[:-1], dtype=np.int64).repeat(size), pairs)
        num_successes += successes.reshape(path.num_steps, size).sum(axis=1)
    return [share(int(count), num_trials) for count in num_successes]


def _check_path(mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> None:
    for (state, action), after in zip(path.pairs, path.states[1:], strict=True):
        if policy[state] != action or mdp.next_state[state, action] != after:
            raise ValueError(f"the path leaves the policy in {mdp.states[state]!r}")
    if not mdp.goal[path.states[-1]]:
        raise ValueError(f"the path must end in a goal, not in {mdp.states[path.states[-1]]!r}")
