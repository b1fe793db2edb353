"""Bottlenecks: states that lie on many shortest paths between others (Simsek & Barto 2008)."""

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.selectors.ranking import Ready, most_important_steps
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import World
from webapp.explainer.support import Places, SupportGraph, once, support_graph, support_note

EXACT_LIMIT = 200_000_000
"""Up to so many visits of an edge, states times edges, betweenness is exact: some ten seconds."""

_MAX_PLACES = 400_000
"""So many states of all searches are held at once; further sources are taken in turns."""


def betweenness(
    graph: SupportGraph, sources: NDArray[np.int64] | None = None, *, max_places: int = _MAX_PLACES
) -> NDArray[np.float64]:
    """Compute the betweenness centrality of every state.

    For each ordered pair of other states the share of their shortest paths that pass through the state, added up, not
    normalised. Brandes 2001 ("A faster algorithm for betweenness centrality", J. Math. Sociol. 25), level by level and
    for many sources at once. Takes time proportional to sources times edges.

    Args:
        graph: Of a world; where actions have chances, all that may happen.
        sources: The states at which the paths begin. All if left out, and then the answer is exact; otherwise it is
            what these tell of all, scaled up (Brandes & Pich 2007, "Centrality estimation in large networks",
            Int. J. Bifurcation and Chaos 17).
        max_places: How large a table of states and sources may be, which changes the memory and nothing else.

    Returns:
        `[S]`, 0 or larger.
    """
    origins = np.arange(graph.num_states) if sources is None else sources
    size = max(1, max_places // graph.num_states)
    total = np.zeros(graph.num_states)
    for begin in range(0, len(origins), size):
        total += _dependencies(graph, origins[begin : begin + size])
    return total * (graph.num_states / max(1, len(origins)))


def local_maxima(centrality: NDArray[np.float64], graph: SupportGraph, path: Trajectory) -> tuple[int, ...]:
    """Return the steps of a path whose state has no neighbour in the graph, before or after it, above it.

    Args:
        centrality: `[S]`: `betweenness`.
        graph: The graph that it was computed on.
        path: A path to a goal.
    """
    tails, heads = graph.edges_from(np.arange(graph.num_states))
    highest = centrality.copy()
    np.maximum.at(highest, tails, centrality[heads])
    np.maximum.at(highest, heads, centrality[tails])
    return tuple(step for step, state in enumerate(path.states[:-1], 1) if centrality[state] == highest[state])


def bottlenecks(world: World, path: Trajectory, rng: np.random.Generator, *, exact_limit: int = EXACT_LIMIT) -> Ready:
    r"""Choose steps by the betweenness of their states.

    Simsek & Barto 2008 ("Skill characterization based on betweenness", NIPS) take the local maxima as subgoals. The
    path's local maxima come first, the largest ahead, then its other states, the largest ahead; of equals the earlier.

    Args:
        world: The world. Where actions have chances, its graph holds all that may happen.
        path: The path to choose from.
        rng: Draws the sources where there are too many for an exact answer.
        exact_limit: The largest product of states and edges for which betweenness is exact.

    Returns:
        A selector; its note says so where betweenness is an estimate.

    Example:
        >>> import numpy as np
        >>> from webapp.explainer import bottlenecks, follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> bottlenecks(world, path, np.random.default_rng(0)).choose(2)
        (2, 6)
    """
    graph = support_graph(world)
    sources = _sources(graph, rng, exact_limit)
    centrality = betweenness(graph, sources)
    maxima = local_maxima(centrality, graph, path)
    of_path = centrality[list(path.states[:-1])]
    estimated = "" if sources is None else f"betweenness estimated from {len(sources)} of {graph.num_states} states"
    note = "; ".join(part for part in (support_note(world), estimated) if part)

    def reason(step: int) -> str:
        return f"betweenness {of_path[step - 1]:.6g}{', a local maximum' if step in maxima else ''}"

    return Ready(lambda count: most_important_steps(of_path, maxima, count), reason, maxima, note, fills_up=True)


def _sources(graph: SupportGraph, rng: np.random.Generator, exact_limit: int) -> NDArray[np.int64] | None:
    """Draw as many sources as the limit allows, or return None where it allows all."""
    num_sources = max(1, exact_limit // max(1, len(graph.heads)))
    if num_sources >= graph.num_states:
        return None
    return np.sort(rng.choice(graph.num_states, size=num_sources, replace=False)).astype(np.int64)


def _dependencies(graph: SupportGraph, sources: NDArray[np.int64]) -> NDArray[np.float64]:
    """`[S]`: what the shortest paths from some sources add to each state's betweenness."""
    num_places = len(sources) * graph.num_states
    origins = np.arange(len(sources)) * graph.num_states + sources
    num_paths = np.zeros(num_places)
    num_paths[origins] = 1.0
    levels = _levels(graph, origins, num_paths)
    share = 1 / np.maximum(num_paths, 1.0)
    dependency = np.zeros(num_places)
    for tails, heads in reversed(levels):
        np.add.at(dependency, tails, num_paths[tails] * (share[heads] * (1 + dependency[heads])))
    dependency[origins] = 0.0
    total: NDArray[np.float64] = dependency.reshape(-1, graph.num_states).sum(axis=0)
    return total


def _levels(graph: SupportGraph, origins: Places, num_paths: NDArray[np.float64]) -> list[tuple[Places, Places]]:
    """Return the edges of all shortest paths, nearest first, and count the paths to each place."""
    reached = num_paths > 0
    scratch = np.empty(len(num_paths), dtype=np.int64)
    levels: list[tuple[Places, Places]] = []
    frontier = origins
    while len(frontier):
        tails, heads = graph.edges_from(frontier)
        fresh = ~reached[heads]
        tails, heads = tails[fresh], heads[fresh]
        np.add.at(num_paths, heads, num_paths[tails])
        frontier = once(heads, scratch)
        reached[frontier] = True
        levels.append((tails, heads))
    return levels
