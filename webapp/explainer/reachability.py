"""Exact answers where the world or the policy is stochastic: the chance of getting somewhere, and the random phase.

A policy turns a world into a Markov chain. Which states reach a set surely, and which never, is a matter of its graph
alone; only the states between need numbers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from webapp.explainer.breadth_first import levels_from, reached, reversed_edges
from webapp.explainer.mdp import StateAction
from webapp.explainer.policy_sweeps import policy_graph, without_diagonal
from webapp.explainer.stochastic import AnyPolicy, StochasticMDP, action_probabilities
from webapp.explainer.transient_systems import DIRECT_LIMIT, PRECISION, TransientSystem


@dataclass(frozen=True, slots=True, eq=False)
class Reachability:
    """The chance of reaching a set from every state.

    Attributes:
        values: `[S]` in [0, 1]; exactly 0 or 1 where the graph of the chain alone decides.
        error_bound: No value is further than this from the exact one; 0 where the graph decides everywhere.
    """

    values: NDArray[np.float64]
    error_bound: float


def markov_chain(mdp: StochasticMDP, policy: AnyPolicy) -> csr_array:
    """Return the chain that a policy makes of a world.

    Args:
        mdp: The world.
        policy: `[S]` actions or `[S, A]` probabilities.

    Returns:
        `[S, S]`, sparse: the probability of the next state. The rows of terminal states are empty.

    Raises:
        ValueError: The policy does not fit the world.
    """
    chances = action_probabilities(mdp, policy)
    states, actions = np.nonzero(chances)
    rows = states * mdp.num_actions + actions
    choice = csr_array((chances[states, actions], (states, rows)), shape=(mdp.num_states, chances.size))
    outcomes = csr_array((mdp.probability, mdp.next_state, mdp.row_start), shape=(chances.size, mdp.num_states))
    return choice @ outcomes


def reach_probability(
    mdp: StochasticMDP,
    policy: AnyPolicy,
    targets: NDArray[np.bool_],
    *,
    direct_limit: int = DIRECT_LIMIT,
    precision: float = PRECISION,
) -> Reachability:
    """Compute the probability that a policy ever reaches a set of states.

    Args:
        mdp: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        targets: `[S]`, the set. It is reached from its own states at once.
        direct_limit: Up to so many undecided states the system is factorised, beyond it is solved by iteration.
        precision: The error bound to aim at.

    Raises:
        ValueError: The policy or the set does not fit the world.
        NotSolved: The numbers cannot be trusted.

    Example:
        >>> from webapp.explainer import enumerate_world, plan_world, reach_probability, world_of
        >>> lake = enumerate_world(world_of("FrozenLake-v1"))
        >>> round(float(reach_probability(lake, plan_world(lake), lake.goal).values[lake.start]), 4)
        0.8235
    """
    chain = markov_chain(mdp, policy)
    return chain_reach_probability(chain, targets, direct_limit=direct_limit, precision=precision)


def chain_reach_probability(
    chain: csr_array, targets: NDArray[np.bool_], *, direct_limit: int = DIRECT_LIMIT, precision: float = PRECISION
) -> Reachability:
    """Compute the probability that a chain ever reaches a set of states.

    Takes memory in proportion to the transitions.

    Args:
        chain: `[S, S]`: the probability of the next state. A row is empty, or sums to 1.
        targets: `[S]`, the set. It is reached from its own states at once.
        direct_limit: Up to so many undecided states the system is factorised, beyond it is solved by iteration.
        precision: The error bound to aim at.

    Raises:
        ValueError: The set does not fit the chain.
        NotSolved: The numbers cannot be trusted.
    """
    num_states = chain.shape[0]
    if targets.shape != (num_states,) or targets.dtype != np.bool_:
        raise ValueError(f"the set must be [{num_states}] booleans, not {targets.shape} of {targets.dtype}")
    ended = (np.diff(chain.indptr) == 0) & ~targets
    alive = ~ended & ~targets
    if np.count_nonzero(alive) > direct_limit:
        moves = without_diagonal(chain)
        passing = policy_graph(moves, alive, ended)
        if len(passing.levels.order) == np.count_nonzero(alive):
            system = TransientSystem(moves, alive, graph=passing, precision=precision)
            return _of_passing(moves, targets, ended, system)
    able, surely = _decided(chain, targets)
    values = surely.astype(np.float64)
    between = able & ~surely
    graph = policy_graph(chain, between, ~able) if np.count_nonzero(between) > direct_limit else None
    system = TransientSystem(chain, between, graph=graph, direct_limit=direct_limit, precision=precision)
    solution = system.solve((chain @ values)[between])
    values[between] = np.clip(solution.values, 0.0, 1.0)
    return Reachability(values, solution.error_bound)


def _of_passing(
    chain: csr_array, targets: NDArray[np.bool_], ended: NDArray[np.bool_], system: TransientSystem
) -> Reachability:
    """Solve where the chain ends surely, but not in the set; then search the graph only where it may decide."""
    alive = ~ended & ~targets
    solution = system.solve((chain @ targets.astype(np.float64))[alive])
    values = targets.astype(np.float64)
    values[alive] = np.clip(solution.values, 0.0, 1.0)
    able = _joined(chain, targets | (values > solution.error_bound), ended)
    values[~able] = 0.0
    unsure = _joined(chain, ~able | (values < 1 - solution.error_bound), targets)
    values[~unsure] = 1.0
    return Reachability(values, solution.error_bound)


def steps_towards(chain: csr_array, targets: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return `[S]`: the least steps in which a chain `[S, S]` may reach a set `[S]`; -1 where it cannot."""
    levels = levels_from(reversed_edges(chain), targets)
    distance = np.full(len(targets), -1, dtype=np.int64)
    distance[levels.order] = np.repeat(np.arange(len(levels.widths)), levels.widths)
    return distance


def may_reach(chain: csr_array, targets: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return `[S]`: True where a chain `[S, S]` may ever reach a set `[S]`."""
    return reached(reversed_edges(chain), targets)


def _decided(chain: csr_array, targets: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where a chain may reach a set at all, and where it surely does."""
    edges = reversed_edges(chain)
    able = reached(edges, targets)
    # What happens after the set is reached does not matter: the moves out of it are turned into loops.
    out = np.flatnonzero(targets[edges.indices])
    edges.indices[out] = np.searchsorted(edges.indptr, out, side="right") - 1
    return able, ~reached(edges, ~able)


def _joined(chain: csr_array, known: NDArray[np.bool_], barred: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the known states and those from which a chain may reach them without passing the barred ones."""
    rest = np.flatnonzero(~known & ~barred)
    if not len(rest):
        return known
    entries = _entries(chain.indptr, rest)
    origin = np.repeat(np.arange(len(rest)), np.diff(chain.indptr)[rest])
    after = chain.indices[entries]
    place = np.full(len(known), -1, dtype=np.int32)
    place[rest] = np.arange(len(rest))
    at_once = np.zeros(len(rest), dtype=np.bool_)
    at_once[origin[known[after]]] = True
    among = place[after] >= 0
    back = (np.ones(np.count_nonzero(among)), (place[after[among]], origin[among]))
    joined = known.copy()
    joined[rest] = reached(csr_array(back, shape=(len(rest), len(rest))), at_once)
    return joined


def random_phase(
    mdp: StochasticMDP, start: int, num_steps: int, *, forbidden: tuple[StateAction, ...] = ()
) -> NDArray[np.float64]:
    """Return where random actions lead, exactly (Sakai et al. 2021, section 4.2.1).

    The distribution is pushed forward step by step, so the work grows with the states within reach and not with S.

    Args:
        mdp: The world.
        start: The index of the first state.
        num_steps: How many random actions, each uniform over the selectable ones; where there is none the state stays.
        forbidden: States with actions that are not selectable there (`do(allow = 0)`).

    Returns:
        `[S]`: the probability of each state after the last action. It sums to 1.

    Raises:
        ValueError: The number of actions is negative, or there is no such state.
    """
    if num_steps < 0:
        raise ValueError(f"the number of random actions must be 0 or larger, not {num_steps}")
    if not 0 <= start < mdp.num_states:
        raise ValueError(f"the first state must be an index from 0 to {mdp.num_states - 1}, not {start}")
    states, mass = np.array([start]), np.array([1.0])
    for _ in range(num_steps):
        allowed = mdp.selectable[states]
        for state, action in forbidden:
            allowed[states == state, action] = False
        num_allowed = allowed.sum(axis=1)
        origins, actions = np.nonzero(allowed)
        rows = states[origins] * mdp.num_actions + actions
        entries = _entries(mdp.row_start, rows)
        shares = np.repeat(mass[origins] / num_allowed[origins], np.diff(mdp.row_start)[rows])
        stuck = num_allowed == 0
        after = np.concatenate((mdp.next_state[entries], states[stuck]))
        states, places = np.unique(after, return_inverse=True)
        mass = np.bincount(places, weights=np.concatenate((shares * mdp.probability[entries], mass[stuck])))
    distribution = np.zeros(mdp.num_states)
    distribution[states] = mass
    return distribution


def _entries(starts: NDArray[np.integer], rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return where the entries of the rows lie in a compressed sparse array, row after row."""
    first = starts[rows].astype(np.int64)
    counts = starts[rows + 1].astype(np.int64) - first
    offsets = np.repeat(first - np.concatenate(([0], np.cumsum(counts)[:-1])), counts)
    return offsets + np.arange(len(offsets))
