"""HIGHLIGHTS: show the states in which the choice of action matters most to the value (Amir & Amir 2018).

"HIGHLIGHTS: Summarizing Agent Behavior to People", AAMAS 2018. Its summary has a budget of k important states; the
states that are shown before and after each of them, its context, are not counted. Two important states must lie an
interval apart, or one event would be told k times. The published algorithm watches an agent and meets the states in
the order of time; here, as in later code of its authors, the path is known and the most important state comes first.
"""

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.selectors.ranking import Ready, check_count, check_finite
from webapp.explainer.solvers import Trajectory, steps_to_goal
from webapp.explainer.stochastic import AnyPolicy, StochasticMDP, World, from_deterministic

MIN_GAP = 2
"""Two neighbours are never both chosen."""

CONTEXT = 1
"""The state before and the state after are shown with each chosen one."""


def highlights(
    world: World, policy: AnyPolicy, path: Trajectory, discount: float = 0.99, min_gap: int = MIN_GAP
) -> Ready:
    r"""Choose steps by how much the best action of their state is worth more than the worst.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: The policy's path.
        discount: In (0, 1].
        min_gap: The least distance between two chosen steps, from 1.

    Returns:
        A selector; where a budget cannot be filled at the least distance, its `distance` is the smaller one in use.

    Raises:
        ValueError: The discount or the gap lies outside its range.
        NotSolved: A linear system's answer cannot be trusted.

    Example:
        >>> from webapp.explainer import follow, highlights, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> highlights(world, policy, path).choose(2)
        (5, 7)
    """
    gaps = q_gaps(world, policy, discount)
    return Ready(
        lambda count: highlights_steps(gaps, path, count, min_gap),
        lambda step: f"Q gap {gaps[path.states[step - 1]]:.3g}",
        distance=lambda count: _spaced(gaps, path, count, min_gap)[1],
    )


def q_gaps(world: World, policy: AnyPolicy, discount: float = 0.99) -> NDArray[np.float64]:
    """Return how much the best action of each state is worth more than the worst: its importance.

    `Q(s, a)` is the expected discounted reward of taking a and then following the policy, with reward 1 for reaching a
    goal and none for anything else. Compared are the actions that may change the state, those that may end the episode
    among them. Where the world or the policy is stochastic a sparse linear system is solved, and SciPy loaded; a value
    that may be off by more than 1e-6 is refused.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities. Where it never reaches a goal the value is 0.
        discount: In (0, 1].

    Returns:
        `[S]` in [0, 1]; 0 where fewer than two actions may change the state.

    Raises:
        ValueError: The discount lies outside its range.
        NotSolved: The linear system's answer cannot be trusted.
    """
    if not 0 < discount <= 1:
        raise ValueError(f"the discount must lie above 0 and be at most 1, not {discount}")
    if isinstance(world, DeterministicMDP) and policy.ndim == 1:
        worth = _worth_of_arriving(world, cast("Policy", policy), discount)
    else:
        worth = _expected_worth(_stochastic(world), policy, discount)
    q_values, changes = _q_values(world, worth)
    best = np.where(changes, q_values, -np.inf).max(axis=1)
    worst = np.where(changes, q_values, np.inf).min(axis=1)
    gaps = np.zeros(world.num_states)
    np.subtract(best, worst, out=gaps, where=changes.any(axis=1))
    return gaps


def highlights_steps(
    gaps: NDArray[np.float64], path: Trajectory, count: int, min_gap: int = MIN_GAP
) -> tuple[int, ...]:
    """Choose the steps with the largest gaps that lie far enough apart.

    The most important step comes first, the earlier of two equals; a step nearer than the minimum gap to one chosen
    before is passed over. Where a path is too short for the budget at this distance, the largest smaller one at which
    the budget can be filled is taken.

    Args:
        gaps: `[S]`: `q_gaps`.
        path: The policy's path.
        count: How many steps, from 0 to T.
        min_gap: The least distance between two chosen steps, from 1.

    Raises:
        ValueError: The path does not have so many steps, the minimum gap is not positive, or a Q gap is not finite.
    """
    return _spaced(gaps, path, count, min_gap)[0]


def _spaced(gaps: NDArray[np.float64], path: Trajectory, count: int, min_gap: int) -> tuple[tuple[int, ...], int]:
    """Return the chosen steps and the distance at which they were: the least one asked for, or smaller."""
    check_count(path.num_steps, count)
    if min_gap < 1:
        raise ValueError(f"the minimum gap must be 1 or larger, not {min_gap}")
    values = gaps[list(path.states[:-1])]
    check_finite(values)
    order = sorted(range(1, path.num_steps + 1), key=lambda step: (-values[step - 1], step))
    distance = min(min_gap, (path.num_steps - 1) // (count - 1)) if count > 1 else min_gap
    while len(chosen := _apart(order, count, distance)) < count:
        distance -= 1
    return chosen, distance


def _apart(order: Sequence[int], count: int, distance: int) -> tuple[int, ...]:
    """Take steps in an order, each unless it is too near to one taken before, until there are so many."""
    taken: list[int] = []
    free = bytearray(b"\1") * (len(order) + 1)
    for step in order:
        if len(taken) == count:
            break
        if free[step]:
            taken.append(step)
            near = slice(max(0, step - distance + 1), step + distance)
            free[near] = bytes(len(free[near]))
    return tuple(sorted(taken))


def context_frames(steps: tuple[int, ...], num_steps: int, context: int = CONTEXT) -> tuple[tuple[int, int], ...]:
    """Return which states of the path are shown with each chosen one.

    Args:
        steps: The chosen steps.
        num_steps: T.
        context: How many states before and how many after, at least 0.

    Returns:
        For each step the first and the last state shown, from 1 to T + 1, the target's number.

    Raises:
        ValueError: The context is negative.
    """
    if context < 0:
        raise ValueError(f"the context must be 0 states or more, not {context}")
    return tuple((max(1, step - context), min(num_steps + 1, step + context)) for step in steps)


def _stochastic(world: World) -> StochasticMDP:
    return from_deterministic(world) if isinstance(world, DeterministicMDP) else world


def _worth_of_arriving(mdp: DeterministicMDP, policy: Policy, discount: float) -> NDArray[np.float64]:
    """`[S]`: the reward 1 discounted once per action of the policy from the state to a goal; 0 if it never arrives."""
    steps = steps_to_goal(mdp, policy)
    worth: NDArray[np.float64] = np.where(np.isfinite(steps), discount**steps, 0.0)
    return worth


def _expected_worth(mdp: StochasticMDP, policy: AnyPolicy, discount: float) -> NDArray[np.float64]:
    """`[S]`: the same where the way to the goal, its length and whether it arrives are a matter of chance."""
    from webapp.explainer.reachability import markov_chain, may_reach  # noqa: PLC0415 - loads SciPy.
    from webapp.explainer.transient_systems import TransientSystem  # noqa: PLC0415 - loads SciPy.

    chain = markov_chain(mdp, policy)
    hopeful = np.flatnonzero(may_reach(chain, mdp.goal) & ~mdp.goal)
    moves = discount * chain[hopeful]
    arriving = TransientSystem(moves[:, hopeful]).solve(moves @ mdp.goal.astype(np.float64))
    worth = mdp.goal.astype(np.float64)
    worth[hopeful] = np.clip(arriving.values, 0.0, 1.0)
    return worth


def _q_values(world: World, worth: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """`[S, A]`: the mean worth of what follows each action, and whether the action may change the state."""
    shape = (world.num_states, world.num_actions)
    if isinstance(world, DeterministicMDP):
        return worth[world.next_state], world.next_state != np.arange(world.num_states)[:, None]
    rows = np.repeat(np.arange(world.num_states * world.num_actions), np.diff(world.row_start))
    q_values, changes = np.zeros(shape), np.zeros(shape, dtype=np.bool_)
    np.add.at(q_values.reshape(-1), rows, world.probability * worth[world.next_state])
    changes.reshape(-1)[rows[world.next_state != rows // world.num_actions]] = True
    return q_values, changes
