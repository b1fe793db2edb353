"""How far an explanation's steps alone lead to the goal, exactly: equation 1 of Sakai et al. 2021 as a number.

The paper asks for the smallest explanation E with `P(reach the target | E) > alpha`, and says that this probability is
hard to define. Ours: the policy is followed in the states of E; in every other state the action is drawn uniformly
from those that may change the state, those that may end the episode among them; and the goal must be reached within
twice as many actions as the path has. The converse, randomising just the chosen states and measuring the loss, follows
the fidelity score of StateMask (Cheng et al. 2023, NeurIPS). Nothing is sampled, in stochastic worlds neither: the
probability within one action more is the mean of the probability over what that action leads to.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import Trajectory, check_step
from webapp.explainer.stochastic import (
    AnyPolicy,
    StochasticMDP,
    StochasticPolicy,
    World,
    action_probabilities,
    from_deterministic,
)

Selection = Sequence[int]
"""Steps of a path, from 1 to T."""

_Mean = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Takes `[S, N]` numbers and returns the mean of them over what follows each of some states."""

_MAX_NUMBERS = 200_000
"""So many probabilities are worked out at once; further selections are taken in turns, to stay in the cache."""

_ROUNDING = 1e-12
"""What is left of the difference of two probabilities that should be equal is below this share of them."""


def fidelities(
    world: World, policy: AnyPolicy, path: Trajectory, selections: Sequence[Selection]
) -> NDArray[np.float64]:
    r"""Compute `P(reach | E)` for some explanations: the policy in the chosen states, random actions elsewhere.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: A way to a goal that the policy may take, of T steps.
        selections: N explanations, each as steps of the path. Equal ones are worked out once.

    Returns:
        `[N]` in [0, 1].

    Raises:
        ValueError: A step does not exist, or the policy does not fit the world.

    Example:
        >>> from webapp.explainer import fidelities, follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> fidelities(world, policy, path, [(), (1, 7), range(1, 8)]).round(3).tolist()
        [0.011, 0.058, 1.0]
    """
    mdp = _stochastic(world)
    obedient, at_random = action_probabilities(mdp, policy), random_policy(mdp)
    return _along_path(mdp, path, selections, base=at_random, changed=obedient)


def drops(world: World, policy: AnyPolicy, path: Trajectory, selections: Sequence[Selection]) -> NDArray[np.float64]:
    r"""Compute how much the probability of reaching the goal falls when just the chosen states act at random.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: A way to a goal that the policy may take, of T steps.
        selections: N explanations, each as steps of the path. Equal ones are worked out once.

    Returns:
        `[N]` in [-1, 1]; below 0 only where the policy does worse than random actions. It falls from
        `policy_fidelity`.

    Raises:
        ValueError: A step does not exist, or the policy does not fit the world.

    Example:
        >>> from webapp.explainer import drops, follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> drops(world, policy, path, [(), (1, 7), range(1, 8)]).round(3).tolist()
        [0.0, 0.461, 0.957]
    """
    mdp = _stochastic(world)
    obedient, at_random = action_probabilities(mdp, policy), random_policy(mdp)
    reached = _along_path(mdp, path, [(), *selections], base=obedient, changed=at_random)
    lost = reached[0] - reached[1:]
    drop: NDArray[np.float64] = np.where(np.abs(lost) > _ROUNDING * reached[0], lost, 0.0)
    return drop


def policy_fidelity(world: World, policy: AnyPolicy, path: Trajectory) -> float:
    """Compute the probability that the policy, followed everywhere, reaches the goal within twice the path's length.

    It is 1 where world and policy are deterministic, because the path arrives.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: A way to a goal that the policy may take.

    Raises:
        ValueError: The policy does not fit the world.
    """
    mdp = _stochastic(world)
    chances = action_probabilities(mdp, policy)
    return float(_along_path(mdp, path, [()], base=chances, changed=chances)[0])


def random_policy(world: World) -> StochasticPolicy:
    """Return `[S, A]`: uniform over the actions that may change the state; where there is none, over all."""
    mdp = _stochastic(world)
    rows = np.repeat(np.arange(mdp.num_states * mdp.num_actions), np.diff(mdp.row_start))
    moves = np.zeros((mdp.num_states, mdp.num_actions), dtype=np.bool_)
    moves.flat[rows[mdp.next_state != rows // mdp.num_actions]] = True
    moves[~moves.any(axis=1)] = True
    chances: StochasticPolicy = moves / moves.sum(axis=1, keepdims=True)
    return chances


def smallest_sufficient(curve: Sequence[float] | NDArray[np.float64], alpha: float) -> int | None:
    """Return the smallest k whose `P(reach | E_k)` exceeds alpha (Sakai et al. 2021, equation 1).

    Args:
        curve: `P(reach | E_k)` for k = 0, 1, 2 and so on. It need not rise everywhere.
        alpha: In [0, 1).

    Returns:
        k, or None if none exceeds it.

    Raises:
        ValueError: Alpha lies outside its range.

    Example:
        >>> from webapp.explainer import smallest_sufficient
        >>> smallest_sufficient([0.1, 0.3, 0.7, 1.0], alpha=0.5)
        2
    """
    check_alpha(alpha)
    return next((k for k, probability in enumerate(curve) if probability > alpha), None)


def check_alpha(alpha: float) -> None:
    """Refuse a level of comprehension that the paper does not allow.

    Raises:
        ValueError: Alpha is not in [0, 1).
    """
    if not 0 <= alpha < 1:
        raise ValueError(f"alpha must be 0 or larger and below 1, not {alpha}")


def _stochastic(world: World) -> StochasticMDP:
    return from_deterministic(world) if isinstance(world, DeterministicMDP) else world


def _along_path(
    mdp: StochasticMDP,
    path: Trajectory,
    selections: Sequence[Selection],
    *,
    base: StochasticPolicy,
    changed: StochasticPolicy,
) -> NDArray[np.float64]:
    """`[N]`: the probability of arriving in time under a policy that each selection changes in its states."""
    states, places = np.unique(path.states[:-1], return_inverse=True)
    chosen = np.zeros((len(selections), len(states)), dtype=np.bool_)
    for row, selection in zip(chosen, selections, strict=True):
        for step in selection:
            check_step(path, step)
            row[places[step - 1]] = True
    distinct, which = np.unique(chosen, axis=0, return_inverse=True)
    return _reach(mdp, path.states[0], base, changed, states, distinct, 2 * path.num_steps)[which.ravel()]


def _reach(
    mdp: StochasticMDP,
    start: int,
    base: StochasticPolicy,
    changed: StochasticPolicy,
    states: NDArray[np.int64],
    switched: NDArray[np.bool_],
    horizon: int,
) -> NDArray[np.float64]:
    """`[N]`: the probability of arriving in time under a policy, changed where `[N, len(states)]` says so."""
    from webapp.explainer.reachability import markov_chain  # noqa: PLC0415 - loads SciPy.

    chain, other = markov_chain(mdp, base), markov_chain(mdp, changed)[states]
    size = max(1, _MAX_NUMBERS // mdp.num_states)
    turns = [switched[first : first + size] for first in range(0, len(switched), size)]
    everywhere: _Mean = lambda arrives: chain @ arrives
    instead: _Mean = lambda arrives: other @ arrives
    reached = [_arriving(everywhere, instead, states, turn, mdp.goal, horizon)[start] for turn in turns]
    return np.clip(np.concatenate(reached), 0.0, 1.0) if reached else np.zeros(0)


def _arriving(
    everywhere: _Mean,
    instead: _Mean,
    states: NDArray[np.int64],
    switched: NDArray[np.bool_],
    goal: NDArray[np.bool_],
    horizon: int,
) -> NDArray[np.float64]:
    """`[S, N]`: from the probability of arriving within no action, work out that within one, two and so on.

    That gives the same as pushing a distribution forward, but all states come at the cost of one.
    """
    goals = np.flatnonzero(goal)
    takes_other = switched.T
    arrives = np.repeat(goal[:, None].astype(np.float64), len(switched), axis=1)
    for _ in range(horizon):
        within = everywhere(arrives)
        within[states] = np.where(takes_other, instead(arrives), within[states])
        within[goals] = 1.0
        arrives = within
    return arrives
