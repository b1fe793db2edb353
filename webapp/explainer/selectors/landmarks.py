"""Landmarks: what is true at some moment on every path to the goal, whichever way is taken.

States: the dominators of the goal. Facts: one component of the state with one value, such as "the key is in hand".
Both as in planning (Hoffmann, Porteous & Sebastia 2004, "Ordered landmarks in planning", JAIR 22) and in Sreedharan,
Srivastava & Kambhampati 2020 ("TLdR: Policy summarization for factored SSP problems using temporal abstractions",
ICAPS). They are exact here, because the whole state graph is known. Where actions have chances a path is whatever may
happen, however unlikely: the graph is that of the support. The policy plays no part but for the order.
"""

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.selectors.baselines import evenly_spaced_steps
from webapp.explainer.selectors.ranking import Ready, check_count
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import World
from webapp.explainer.support import once, outcomes, support_graph, support_note

Fact = tuple[int, Hashable]
"""The position of a component in the state's label, and its value. A label that is no tuple is its own component 0."""

NO_LANDMARK = "no landmark"
"""The reason for a step that is there to fill the budget."""


def landmark_states(world: World, path: Trajectory) -> tuple[int, ...]:
    """Return the steps of a path in whose state every path from its start to a goal is at some time.

    Such states lie on every path and hence on this one. Without its loops it is swept once: a state is avoidable
    exactly if something before it leads past it, off the path, to a later state of it or to another goal. Takes time
    linear in transitions.

    Args:
        world: The world.
        path: A path to a goal.

    Returns:
        Steps from 1 to T, ascending, each the first that visits its state. Step 1 is always one of them; the target,
        which is no step, is left out.

    Raises:
        ValueError: The path does not end in a goal.
    """
    _check_end(world, path)
    graph, way = support_graph(world), _without_loops(path)
    place = np.where(world.goal, len(way) - 1, -1)
    place[way] = np.arange(len(way))
    explored: set[int] = set()
    unavoidable, furthest = [], 0
    for position, state in enumerate(way[:-1]):
        if furthest <= position:
            unavoidable.append(path.states.index(state) + 1)
        stack = [state]
        while stack:
            for after in graph.successors(stack.pop()):
                if place[after] >= 0:
                    furthest = max(furthest, int(place[after]))
                elif after not in explored:
                    explored.add(after)
                    stack.append(after)
    return tuple(unavoidable)


def landmarks(world: World, path: Trajectory) -> Ready:
    r"""Choose steps by the states on every path to the goal.

    A state is a landmark or not, without degrees; so where there are too many, those evenly spaced in their order are
    taken. Where there are too few, steps evenly spaced among the others of the path are added. The start is everybody's
    landmark and shown anyhow; it does not count as one.

    Args:
        world: The world.
        path: A path to a goal.

    Raises:
        ValueError: The path does not end in a goal.

    Example:
        >>> from webapp.explainer import follow, landmarks, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> landmarks(world, path).own
        (2, 4, 5, 6, 7)
    """
    steps = landmark_states(world, path)[1:]

    def choose(count: int) -> tuple[int, ...]:
        check_count(path.num_steps, count)
        own = [steps[place - 1] for place in evenly_spaced_steps(len(steps), min(count, len(steps)))]
        return _filled_up(own, steps, path.num_steps, count)

    def reason(step: int) -> str:
        return "on every path to the goal" if step in steps else NO_LANDMARK

    return Ready(choose, reason, steps, support_note(world), fills_up=True)


def landmark_facts(world: World, path: Trajectory) -> dict[Fact, int]:
    """Find the facts that come true on every path from the start of a path to a goal, but do not hold at its start.

    A fact is one exactly if no goal can be reached through states without it. All facts of the path are tried at once.

    Args:
        world: The world. The components of its labels are its facts.
        path: A path to a goal.

    Returns:
        For each such fact the step, from 1 to T, that first makes it true on the path. In the order of the steps.

    Raises:
        ValueError: The path does not end in a goal.
    """
    _check_end(world, path)
    first_step: dict[Fact, int] = {}
    for step, state in enumerate(path.states):
        for fact in _facts(world.states[state]):
            first_step.setdefault(fact, step)
    candidates = [fact for fact, step in first_step.items() if step > 0]
    avoidable = _goal_without(world, path.states[0], _holding(world, candidates))
    return {fact: first_step[fact] for fact, without in zip(candidates, avoidable, strict=True) if not without}


def fact_in_words(world: World, path: Trajectory, fact: Fact, step: int) -> str:
    """Return a fact in words, such as `has_key = 1`.

    Args:
        world: The world whose labels hold the fact. A named tuple's components go by their names.
        path: The path.
        fact: The fact.
        step: The step that makes it true.
    """
    component, value = fact
    label = world.states[path.states[step]]
    names = getattr(label, "_fields", ())
    if component < len(names):
        return f"{names[component]} = {value}"
    return f"component {component + 1} = {value}" if isinstance(label, tuple) else f"state = {value}"


def landmarks_by_fact(world: World, path: Trajectory) -> Ready:
    r"""Choose steps by the facts that come true on every path to the goal.

    A step counts by the rarest landmark fact that it is the first to make true: the fewer outcomes of actions in the
    whole world make a fact true, the earlier its step is taken. So a key with two free sides comes before a column of
    the map that can be entered from many cells. Steps that make none true are taken last, evenly spaced.

    Args:
        world: The world. The components of its labels are its facts.
        path: A path to a goal.

    Raises:
        ValueError: The path does not end in a goal.

    Example:
        >>> from webapp.explainer import follow, landmarks_by_fact, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> found = landmarks_by_fact(world, path)
        >>> step, = found.choose(1)
        >>> step, found.reason(step)
        (1, 'has_key = 1')
    """
    found = landmark_facts(world, path)
    num_ways = _num_ways(world, list(found))
    of_step: dict[int, list[Fact]] = {}
    for fact in sorted(found, key=lambda fact: num_ways[fact]):
        of_step.setdefault(found[fact], []).append(fact)
    order = sorted(of_step, key=lambda step: (num_ways[of_step[step][0]], step))

    def choose(count: int) -> tuple[int, ...]:
        check_count(path.num_steps, count)
        return _filled_up(order[:count], order, path.num_steps, count)

    def reason(step: int) -> str:
        names = [fact_in_words(world, path, fact, step) for fact in of_step.get(step, [])]
        return ", ".join(names) or NO_LANDMARK

    return Ready(choose, reason, tuple(sorted(order)), support_note(world), fills_up=True)


def _check_end(world: World, path: Trajectory) -> None:
    if not world.goal[path.states[-1]]:
        raise ValueError(f"the path must end in a goal, not in {world.states[path.states[-1]]!r}")


def _without_loops(path: Trajectory) -> list[int]:
    """Return the states of a path, each once: what lies between two visits of a state is left out."""
    way: dict[int, None] = {}
    for state in path.states:
        if state in way:
            for later in list(way)[list(way).index(state) + 1 :]:
                del way[later]
        way[state] = None
    return list(way)


def _filled_up(own: Sequence[int], landmark_steps: Sequence[int], num_steps: int, count: int) -> tuple[int, ...]:
    """Add steps evenly spaced among those that are no landmarks until there are `count`."""
    others = [step for step in range(1, num_steps + 1) if step not in landmark_steps]
    added = [others[place - 1] for place in evenly_spaced_steps(len(others), count - len(own))]
    return tuple(sorted([*own, *added]))


def _facts(label: Hashable) -> tuple[Fact, ...]:
    return tuple(enumerate(label)) if isinstance(label, tuple) else ((0, label),)


def _holding(world: World, facts: Sequence[Fact]) -> NDArray[np.bool_]:
    """`[F, S]`: where each fact is true."""
    rows = {fact: row for row, fact in enumerate(facts)}
    holds = np.zeros((len(facts), world.num_states), dtype=np.bool_)
    for state, label in enumerate(world.states):
        for fact in _facts(label):
            if fact in rows:
                holds[rows[fact], state] = True
    return holds


def _num_ways(world: World, facts: Sequence[Fact]) -> Mapping[Fact, int]:
    """How many outcomes of actions make each fact true."""
    before, after = outcomes(world)
    holds = _holding(world, facts)
    return {fact: int((~true[before] & true[after]).sum()) for fact, true in zip(facts, holds, strict=True)}


def _goal_without(world: World, start: int, removed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """`[F]`: whether some path from a state leads to a goal outside each of `[F, S]` sets; the start is in none."""
    graph = support_graph(world)
    closed = removed.ravel().copy()
    scratch = np.empty(len(closed), dtype=np.int64)
    frontier = np.arange(len(removed)) * world.num_states + start
    while len(frontier):
        closed[frontier] = True
        _, heads = graph.edges_from(frontier)
        frontier = once(heads[~closed[heads]], scratch)
    reached = closed.reshape(removed.shape) & ~removed
    return np.asarray((reached & world.goal).any(axis=1))
