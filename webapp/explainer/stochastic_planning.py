"""Planning where actions have chances: the best policy, the most probable outcomes, and the most probable way.

What is maximised is the expected discounted goal indicator: `discount` to the power of the number of actions until a
goal is reached, 0 if none ever is. In a deterministic world that makes shortest paths best, which is what the planner
there takes, so deterministic worlds are handed on to it and load no SciPy.
"""

import heapq
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan, tie_averaged_policy
from webapp.explainer.stochastic import (
    AnyPolicy,
    StochasticMDP,
    StochasticPolicy,
    World,
    action_probabilities,
    from_deterministic,
)

TIE_TOLERANCE = 1e-9
"""Actions whose values lie apart by no more than this part of the better one are equally good. Ways count as equally
probable when the logarithms of their chances, rounded to this, are equal."""

LARGEST_DISCOUNT = 0.999999
"""Nearer to 1, waiting would be as good as acting within the tolerance."""

_MAX_IMPROVEMENTS = 1000
_NUM_SWEEPS = 1000
_SETTLED = 1e-6
_ROUNDING = 1e-12
"""A smaller part of a value than this is no improvement."""
_SMALLEST_VALUE = 1e-250


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The best that can be done.

    Attributes:
        values: `[S]` in [0, 1]: the expected discounted goal indicator; 1 in goals.
        action_values: `[S, A]`: the same if the first action is this one.
        optimal: `[S, A]`: the actions that are best within `TIE_TOLERANCE`; all of them where no goal can be reached.
        error_bound: No value is further than this from the exact one.
    """

    values: NDArray[np.float64]
    action_values: NDArray[np.float64]
    optimal: NDArray[np.bool_]
    error_bound: float


def plan_world(world: World, discount: float = 0.99) -> Policy:
    r"""Return the policy that reaches a goal soonest and surest, ties broken by the lowest action index.

    Args:
        world: The world.
        discount: Above 0, at most `LARGEST_DISCOUNT`. The nearer to 1, the more a sure way counts against a short one;
            deterministic worlds have no use for it.

    Returns:
        `[S]`. Where no goal can be reached every action is as good as any other, so the tie-break gives action 0.

    Raises:
        ValueError: The discount is out of range, or so small that a goal in reach is worth nothing.
        NotSolved: The numbers cannot be trusted.

    Example:
        >>> from webapp.explainer import follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> [world.actions[action] for action in follow(world, plan_world(world)).actions]
        ['pickup', 'left', 'left', 'forward', 'toggle', 'forward', 'forward']
    """
    _check_discount(discount)
    if isinstance(world, DeterministicMDP):
        return plan(world)
    policy: Policy = np.argmax(best_plan(world, discount).optimal, axis=1).astype(np.int32)
    return policy


def tie_averaged_plan(world: World, discount: float = 0.99) -> StochasticPolicy:
    r"""Return the policy that is uniform over all optimal actions; see `plan_world`.

    Returns:
        `[S, A]` probabilities.

    Raises:
        ValueError: The discount is out of range, or so small that a goal in reach is worth nothing.
        NotSolved: The numbers cannot be trusted.

    Example:
        >>> from webapp.explainer import parse_layout, tabulate, tie_averaged_plan
        >>> world = tabulate(parse_layout("#######\n#K>.DG#\n#######"))
        >>> tie_averaged_plan(world)[world.start].tolist()
        [0.0, 0.5, 0.5, 0.0, 0.0]
    """
    _check_discount(discount)
    if isinstance(world, DeterministicMDP):
        return tie_averaged_policy(world)
    optimal = best_plan(world, discount).optimal
    chances: StochasticPolicy = optimal / optimal.sum(axis=1, keepdims=True)
    return chances


def best_plan(world: StochasticMDP, discount: float = 0.99) -> Plan:
    """Improve a policy until no action is better than its own (Howard 1960, policy iteration), solving exactly.

    Which actions are optimal is then read from the values alone, so it does not depend on the policies on the way.

    Raises:
        ValueError: The discount is out of range, or so small that a goal in reach is worth nothing.
        NotSolved: The numbers cannot be trusted.
    """
    from webapp.explainer.transient_systems import NotSolved  # noqa: PLC0415 - loads SciPy.

    _check_discount(discount)
    policy, hopeful = _first_guess(world, discount)
    before = np.zeros(world.num_states)
    for _ in range(_MAX_IMPROVEMENTS):
        values, error_bound = _evaluate(world, policy, hopeful, discount)
        action_values = _look_ahead(world, values, discount)
        best = action_values.max(axis=1)
        better = best > action_values[np.arange(world.num_states), policy] * (1 + _ROUNDING)
        if not np.any(better) or not np.any(values > before * (1 + _ROUNDING)):
            break
        policy[better] = action_values[better].argmax(axis=1)
        before = values
    else:
        raise NotSolved(f"no best policy was found within {_MAX_IMPROVEMENTS} improvements")
    _check_worth(world, values, hopeful, discount)
    return Plan(values, action_values, action_values >= best[:, None] * (1 - TIE_TOLERANCE), error_bound)


def most_probable(world: World) -> DeterministicMDP:
    """Return the world in which each action has its most probable outcome, for sure.

    Outcomes whose probabilities lie apart by no more than `TIE_TOLERANCE` tie; the lowest state index is taken.
    """
    if isinstance(world, DeterministicMDP):
        return world
    first, sizes = world.row_start[:-1], np.diff(world.row_start)
    largest = np.repeat(np.maximum.reduceat(world.probability, first), sizes)
    taken = np.where(world.probability >= largest - TIE_TOLERANCE, world.next_state, world.num_states)
    return DeterministicMDP(
        states=world.states,
        actions=world.actions,
        next_state=np.minimum.reduceat(taken, first).reshape(world.num_states, world.num_actions).astype(np.int32),
        terminal=world.terminal,
        goal=world.goal,
        start=world.start,
    )


def most_probable_path(world: World, policy: AnyPolicy) -> Trajectory:
    """Return the most probable way from the start to a goal under a policy (Dijkstra 1959, on minus the log chances).

    Of equally probable ways the one with fewer actions is taken, then the one through the lower state indices. Where a
    policy may take several actions, each step's chance is that of the action and its outcome together.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.

    Raises:
        NeverArrives: The policy never reaches a goal from the start.
        ValueError: The policy does not fit the world.

    Example:
        >>> from webapp.explainer import enumerate_world, most_probable_path, plan_world, world_of
        >>> world = enumerate_world(world_of("FrozenLake-v1"))
        >>> most_probable_path(world, plan_world(world)).num_steps
        6
    """
    if isinstance(world, DeterministicMDP):
        if policy.ndim == 1:
            return follow(world, policy.astype(np.int32))
        world = from_deterministic(world)
    chances = action_probabilities(world, policy)
    before: dict[int, tuple[int, int]] = {}
    best = {world.start: (0, 0)}
    settled = set()
    queue = [(0, 0, world.start, 0.0)]
    while queue:
        _, num_steps, state, cost = heapq.heappop(queue)
        if state in settled:
            continue
        settled.add(state)
        if world.goal[state]:
            return _way_back(before, state)
        for step_cost, action, after in _edges(world, chances, state):
            reached = (round((cost + step_cost) / TIE_TOLERANCE), num_steps + 1)
            if after not in best or reached < best[after]:
                best[after], before[after] = reached, (state, action)
                heapq.heappush(queue, (*reached, after, cost + step_cost))
    raise NeverArrives(f"the policy never reaches a goal from the start {world.states[world.start]!r}")


def _check_discount(discount: float) -> None:
    if not 0 < discount <= LARGEST_DISCOUNT:
        raise ValueError(f"the discount must be above 0 and at most {LARGEST_DISCOUNT}, not {discount}")


def _first_guess(world: StochasticMDP, discount: float) -> tuple[Policy, NDArray[np.bool_]]:
    """Return a policy that is nearly best, by value iteration, and `[S]`: whether a goal may be reached at all.

    The values begin as if every action had its most welcome outcome, so they are never too small.
    """
    from webapp.explainer.reachability import markov_chain, steps_towards  # noqa: PLC0415 - loads SciPy.

    any_action = np.full((world.num_states, world.num_actions), 1 / world.num_actions)
    distance = steps_towards(markov_chain(world, any_action), world.goal)
    values = np.where(distance < 0, 0.0, discount ** distance.astype(np.float64))
    for _ in range(_NUM_SWEEPS):
        action_values = _look_ahead(world, values, discount)
        after = np.where(world.terminal, values, action_values.max(axis=1))
        settled = np.all(after >= values * (1 - _SETTLED))
        values = after
        if settled:
            break
    policy: Policy = _look_ahead(world, values, discount).argmax(axis=1).astype(np.int32)
    return policy, (distance >= 0) & ~world.terminal


def _evaluate(
    world: StochasticMDP, policy: Policy, hopeful: NDArray[np.bool_], discount: float
) -> tuple[NDArray[np.float64], float]:
    """`[S]`: the values of a policy, and their error bound. States without hope are worth 0 and take no part."""
    from webapp.explainer.reachability import markov_chain  # noqa: PLC0415 - loads SciPy.
    from webapp.explainer.transient_systems import TransientSystem  # noqa: PLC0415 - as above.

    values = world.goal.astype(np.float64)
    places = np.flatnonzero(hopeful)
    if not len(places):
        return values, 0.0
    chain = discount * markov_chain(world, policy)[places]
    solution = TransientSystem(chain[:, places]).solve(chain @ values)
    values[places] = np.clip(solution.values, 0.0, 1.0)
    return values, solution.error_bound


def _look_ahead(world: StochasticMDP, values: NDArray[np.float64], discount: float) -> NDArray[np.float64]:
    """`[S, A]`: what each action is worth if the states after it are worth these values."""
    worth = np.add.reduceat(world.probability * values[world.next_state], world.row_start[:-1])
    return discount * worth.reshape(world.num_states, world.num_actions)


def _check_worth(
    world: StochasticMDP, values: NDArray[np.float64], hopeful: NDArray[np.bool_], discount: float
) -> None:
    lost = hopeful & (values < _SMALLEST_VALUE)
    if np.any(lost):
        state = world.states[int(np.argmax(lost))]
        raise ValueError(
            f"a goal is so far from {state!r} that it is worth nothing at discount {discount}; take a larger"
        )


def _edges(world: StochasticMDP, chances: StochasticPolicy, state: int) -> list[tuple[float, int, int]]:
    """Return `(minus the log chance, action, next state)` of all that the policy may do."""
    edges = []
    for action in np.flatnonzero(chances[state]).tolist():
        row = state * world.num_actions + action
        for place in range(int(world.row_start[row]), int(world.row_start[row + 1])):
            chance = min(1.0, float(chances[state, action] * world.probability[place]))
            edges.append((-math.log(chance), action, int(world.next_state[place])))
    return edges


def _way_back(before: dict[int, tuple[int, int]], goal: int) -> Trajectory:
    states, actions = [goal], []
    while states[-1] in before:
        state, action = before[states[-1]]
        states.append(state)
        actions.append(action)
    return Trajectory(tuple(reversed(states)), tuple(reversed(actions)))
