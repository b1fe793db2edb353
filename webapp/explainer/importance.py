"""Importance of the states of a path (Sakai et al. 2021, sections 4.2.1 and 7.3): what it is, and its exact solvers.

For a state `s_f` of the path: take `r` random actions from it, then follow the policy.

- `return_probability`: the probability that the policy leads back to `s_f`.
- `ace`, the average causal effect of being allowed to take the optimal action in `s_f`: the probability of reaching
  the goal, minus the same with that action forbidden in `s_f`, in both phases.
- `reward_importance`: the expected discounted reward from `s_f`, minus the same with the optimal action forbidden in
  `s_f`, where the other action that is worth most while the prohibition lasts is taken instead, at every visit. That
  is the one with the policy's highest `Q(s_f, a)` wherever `s_f` is not met again. It has no random phase.

The target's importance is 0 by definition. `sampling` estimates the first two instead.
"""

from dataclasses import dataclass
from numbers import Integral
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from webapp.explainer import importance_deterministic
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.shortest_paths import takes_shortest_paths
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import AnyPolicy, World, action_probabilities

ProbabilityKind = Literal["return_probability", "ace"]
ImportanceKind = Literal["return_probability", "ace", "reward_importance"]
PROBABILITY_KINDS: tuple[ProbabilityKind, ...] = get_args(ProbabilityKind)
"""Those that are chances or differences of chances, and can be estimated by rollouts."""
IMPORTANCE_KINDS: tuple[ImportanceKind, ...] = get_args(ImportanceKind)


@dataclass(frozen=True, slots=True, eq=False)
class Importance:
    """The importance of each state of a path, and how far to trust it.

    Attributes:
        values: `[T + 1]`, finite; the target's entry, the last, is 0. A return probability lies in [0, 1], an `ace` in
            [-1, 1], below 0 only where the policy's own action keeps it from the goal.
        standard_errors: `[T + 1]`, 0 or larger, or None from an exact solver.
        error_bound: How far an exact value may lie from the true one because of the linear systems behind it; 0 where
            there was none. The rounding of the sums, some 1e-15 of the largest summand, is not in it.

    Raises:
        ValueError: A value is not as described, or the shapes differ.

    Example:
        >>> import numpy as np
        >>> from webapp.explainer import Importance
        >>> Importance(np.array([0.5, 0.25, 0.0])).error_bound
        0.0
    """

    values: NDArray[np.float64]
    standard_errors: NDArray[np.float64] | None = None
    error_bound: float = 0.0

    def __post_init__(self) -> None:
        if self.values.ndim != 1 or not len(self.values):
            raise ValueError(f"importance must have shape [T + 1], not {self.values.shape}")
        if not np.all(np.isfinite(self.values)):
            raise ValueError(f"importance must be finite numbers, and this is not: {self.values}")
        if self.values[-1] != 0:
            raise ValueError(f"the target's importance is 0 by definition, not {self.values[-1]}")
        if not self.error_bound >= 0:
            raise ValueError(f"an error bound is 0 or larger, not {self.error_bound}")
        if self.standard_errors is None:
            return
        if self.standard_errors.shape != self.values.shape:
            raise ValueError(f"{self.values.shape} values need as many errors, not {self.standard_errors.shape}")
        if not np.all(self.standard_errors >= 0):
            raise ValueError(f"a standard error is 0 or larger, and these are not: {self.standard_errors}")


def exact_importance(
    kind: ImportanceKind,
    world: World,
    policy: AnyPolicy,
    path: Trajectory,
    random_steps: int = 10,
    discount: float = 0.99,
) -> Importance:
    r"""Compute the importance of every state of a path without sampling.

    In a deterministic world the first two kinds need no linear system under a policy that is deterministic or random
    only between shortest paths, nor does the third under a deterministic one if only the goal pays. All else is a
    sparse reachability problem, for which SciPy is loaded.

    Args:
        kind: Which of the definitions.
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities. Where it never reaches a goal it neither returns nor arrives.
        path: A way to a goal that the policy may take.
        random_steps: r, at least 0; `reward_importance` has no use for it.
        discount: Of rewards, from 0 up to, not including, 1; only `reward_importance` has a use for it.

    Raises:
        ValueError: There is no such definition, a number is out of range, the policy does not fit the world, or the
            path does not follow it to a goal.
        NotSolved: A linear system's answer cannot be trusted.

    Example:
        >>> from webapp.explainer import exact_importance, follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> exact_importance("return_probability", world, policy, path, 2).values.round(3).tolist()
        [0.333, 0.0, 0.0, 0.333, 0.333, 0.417, 0.5, 0.0]
    """
    _refuse_nonsense(kind, world, policy, random_steps)
    if isinstance(world, DeterministicMDP) and _needs_no_linear_system(kind, world, policy):
        return Importance(np.append(_solved_directly(kind, world, policy, path, random_steps, discount), 0.0))
    from webapp.explainer import importance_stochastic  # noqa: PLC0415 - loads SciPy.

    if kind == "reward_importance":
        values, bound = importance_stochastic.reward_importance(world, policy, path, discount)
    elif kind == "ace":
        values, bound = importance_stochastic.ace(world, policy, path, random_steps)
    else:
        values, bound = importance_stochastic.return_probability(world, policy, path, random_steps)
    return Importance(np.append(values, 0.0), error_bound=bound)


def _refuse_nonsense(kind: ImportanceKind, world: World, policy: AnyPolicy, random_steps: int) -> None:
    if kind not in IMPORTANCE_KINDS:
        raise ValueError(f"{kind!r} is not an importance; use {', '.join(IMPORTANCE_KINDS)}")
    shape = (world.num_states, world.num_actions)
    if policy.shape not in (shape[:1], shape):
        raise ValueError(f"a policy must have shape {shape[:1]} or {shape}, not {policy.shape}")
    if kind in PROBABILITY_KINDS and not isinstance(random_steps, Integral):
        raise ValueError(f"the number of random actions must be a whole number, not {random_steps!r}")


def _needs_no_linear_system(kind: ImportanceKind, world: DeterministicMDP, policy: AnyPolicy) -> bool:
    if kind == "reward_importance":
        return policy.ndim == 1 and world.reward is None
    return policy.ndim == 1 or takes_shortest_paths(world, action_probabilities(world, policy))


def _solved_directly(
    kind: ImportanceKind,
    world: DeterministicMDP,
    policy: AnyPolicy,
    path: Trajectory,
    random_steps: int,
    discount: float,
) -> NDArray[np.float64]:
    """`[T]`, with the rounding that leaves the range of a probability cut off."""
    if kind == "reward_importance":
        return importance_deterministic.reward_importance(world, cast("Policy", policy), path, discount)
    if kind == "ace":
        return importance_deterministic.ace(world, policy, path, random_steps).clip(-1.0, 1.0)
    return importance_deterministic.return_probability(world, policy, path, random_steps).clip(0.0, 1.0)
