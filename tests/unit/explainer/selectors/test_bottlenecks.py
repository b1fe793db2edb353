from collections import deque
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.mdps import mdps, planned_path
from tests.stochastic_mdps import as_mdp, fraction_worlds
from tests.worlds import lay_out
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.seeding import stream
from webapp.explainer.selectors import betweenness, bottlenecks, local_maxima
from webapp.explainer.solvers import follow, plan
from webapp.explainer.stochastic import World
from webapp.explainer.support import support_graph
from webapp.explainer.worlds.key_door import tabulate

WORLDS = st.one_of(mdps(max_states=6), fraction_worlds().map(as_mdp))


def successors(world: World) -> list[set[int]]:
    """Read off what may follow each state, itself left out."""
    if isinstance(world, DeterministicMDP):
        return [set(world.next_state[state].tolist()) - {state} for state in range(world.num_states)]
    rows = [set(part.tolist()) for part in np.split(world.next_state, world.row_start[1:-1])]
    num_actions = world.num_actions
    return [set().union(*rows[s * num_actions : (s + 1) * num_actions]) - {s} for s in range(world.num_states)]


def shortest_paths(after: list[set[int]], origin: int, target: int) -> list[tuple[int, ...]]:
    """Grow every path by one edge at a time, until some arrive."""
    paths: list[tuple[int, ...]] = [(origin,)]
    for _ in after:
        arrived = [path for path in paths if path[-1] == target]
        if arrived:
            return arrived
        paths = [(*path, state) for path in paths for state in after[path[-1]] if state not in path]
    return [path for path in paths if path[-1] == target]


def counted(world: World) -> list[Fraction]:
    after = successors(world)
    total = [Fraction(0)] * world.num_states
    for origin in range(world.num_states):
        for target in set(range(world.num_states)) - {origin}:
            paths = shortest_paths(after, origin, target)
            for path in paths:
                for state in path[1:-1]:
                    total[state] += Fraction(1, len(paths))
    return total


@settings(max_examples=60)
@given(WORLDS)
def test_betweenness_is_the_share_of_shortest_paths_counted_one_by_one(world: World) -> None:
    assert betweenness(support_graph(world)) == pytest.approx([float(value) for value in counted(world)], abs=1e-9)


def test_sources_taken_in_turns_give_the_same() -> None:
    mdp = tabulate(lay_out("######", "#>KDG#", "######"))
    graph = support_graph(mdp)
    at_once = betweenness(graph)
    for num_sources in (0, 1, 3):
        assert betweenness(graph, max_places=num_sources * mdp.num_states) == pytest.approx(at_once)
    assert at_once.max() > 0


def test_the_mean_over_every_single_source_is_the_exact_answer() -> None:
    mdp = tabulate(lay_out("#######", "#>.D.G#", "#.K#..#", "#######"))
    graph = support_graph(mdp)
    from_each = [betweenness(graph, np.array([source])) for source in range(mdp.num_states)]
    assert np.mean(from_each, axis=0) == pytest.approx(betweenness(graph))


def test_beyond_the_limit_betweenness_is_estimated_and_says_so() -> None:
    mdp = tabulate(lay_out("#######", "#>.D.G#", "#.K#..#", "#######"))
    path = follow(mdp, plan(mdp))
    num_edges = len(support_graph(mdp).heads)
    exact = bottlenecks(mdp, path, stream(0), exact_limit=num_edges * mdp.num_states)
    rough = bottlenecks(mdp, path, stream(0), exact_limit=num_edges * 5)
    assert exact.note == ""
    assert rough.note == f"betweenness estimated from 5 of {mdp.num_states} states"
    assert len(rough.choose(3)) == 3


def test_the_total_is_what_the_distances_say() -> None:
    """Each pair of states at distance d has d - 1 states between them, whichever shortest path is taken."""
    mdp = tabulate(lay_out("#######", "#>.D.G#", "#.K#..#", "#######"))
    total = sum(distance - 1 for origin in range(mdp.num_states) for distance in distances(mdp, origin) if distance)
    assert betweenness(support_graph(mdp)).sum() == pytest.approx(total)


def distances(mdp: DeterministicMDP, origin: int) -> Iterator[int]:
    known = {origin: 0}
    waiting = deque([origin])
    while waiting:
        state = waiting.popleft()
        for after in mdp.next_state[state].tolist():
            if after not in known:
                known[after] = known[state] + 1
                waiting.append(after)
    yield from known.values()


@settings(max_examples=60)
@given(mdps(), st.data())
def test_local_maxima_of_the_path_come_first(mdp: DeterministicMDP, data: st.DataObject) -> None:
    _, path = planned_path(mdp)
    count = data.draw(st.integers(0, path.num_steps))
    centrality = betweenness(support_graph(mdp))
    linked = {
        state: {int(after) for after in mdp.next_state[state]}
        | {before for before in range(mdp.num_states) if state in mdp.next_state[before]}
        for state in path.states
    }
    maxima = {
        step
        for step, state in enumerate(path.states[:-1], start=1)
        if all(centrality[other] <= centrality[state] for other in linked[state])
    }
    ready = bottlenecks(mdp, path, stream(0))
    chosen = set(ready.choose(count))
    assert len(chosen) == count
    assert set(ready.own) == set(local_maxima(centrality, support_graph(mdp), path)) == maxima
    assert len(chosen & maxima) == min(count, len(maxima))
    least = min((centrality[path.states[step - 1]] for step in chosen & maxima), default=np.inf)
    assert all(centrality[path.states[step - 1]] <= least for step in maxima - chosen)


def test_a_world_of_one_way_streets_has_its_bottleneck_in_the_middle() -> None:
    # States 0 and 1 lead to 2, and 2 leads to 3 and to the goal 4; 3 also leads to the goal.
    table = np.array([[2, 2], [2, 2], [3, 4], [4, 4], [4, 4]], dtype=np.int32)
    goal = np.array([False, False, False, False, True])
    mdp = DeterministicMDP(tuple("abcde"), ("x", "y"), table, goal, goal.copy(), 0)
    assert betweenness(support_graph(mdp)).tolist() == [0, 0, 4, 0, 0]
    ready = bottlenecks(mdp, follow(mdp, plan(mdp)), stream(0))
    assert ready.choose(1) == (2,)
    assert ready.reason is not None
    assert ready.reason(2) == "betweenness 4, a local maximum"
    assert ready.reason(1) == "betweenness 0"
