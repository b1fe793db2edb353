"""How the states of a finite world are enumerated: breadth first, each contradiction told by state and action."""

import math
from array import array
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.stochastic import World, from_outcomes
from webapp.explainer.worlds.finite import GUIDE, Ended, FiniteWorld, Outcome, own_failures

MAX_STATES = 200_000
"""So many states are enumerated at most, unless somebody asks for more."""


class TooManyStates(ValueError):
    """A world of more states than were allowed for."""


_TOLERANCE = 1e-9
"""So far may probabilities sum from 1, and rewards that count as equal lie apart."""


def enumerate_world(
    world: FiniteWorld, *, max_states: int = MAX_STATES, progress: Callable[[int], None] | None = None
) -> World:
    """Enumerate the states that can be reached from a world's start, breadth first and actions in order.

    A state that ends the episode on one way in and not on another is kept as two; the ended one is labelled `Ended`.

    Args:
        world: The world.
        max_states: Refuse to enumerate more states than this.
        progress: Told now and then how many states are known, where there are thousands.

    Returns:
        A `DeterministicMDP` if every outcome is certain, else a `StochasticMDP`; with the expected rewards.

    Raises:
        ValueError: The world contradicts itself, has too many states, or has no goal in reach; the message names the
            state and the action.

    Example:
        >>> from webapp.explainer import Outcome, enumerate_world
        >>> class Tower:
        ...     actions, start = ("down", "up"), 0
        ...     def outcomes(self, floor, action):
        ...         return [Outcome(0.9, max(floor - 1, 0) if action == 0 else floor + 1), Outcome(0.1, floor)]
        ...     def is_goal(self, floor):
        ...         return floor == 3
        ...
        >>> world = enumerate_world(Tower())
        >>> type(world).__name__, world.states, world.goal.tolist()
        ('StochasticMDP', (0, 1, 2, 3), [False, False, False, True])
    """
    search = _Search(world, max_states, progress)
    search.run()
    labels, merged, goal, ended = _merge(search.nodes, _goal_endings(world, search.nodes))
    table = np.frombuffer(search.table, dtype=np.float64).reshape(-1, 4).copy()
    table[:, 0], table[:, 2] = merged[table[:, 0].astype(np.int64)], merged[table[:, 2].astype(np.int64)]
    reward = np.zeros((len(labels), len(world.actions)))
    np.add.at(reward, tuple(table[:, :2].astype(np.int64).T), np.frombuffer(search.rewards))
    mdp = from_outcomes(labels, tuple(world.actions), table, terminal=ended, goal=goal, start=0, reward=reward)
    if len(mdp.next_state) > mdp.num_states * mdp.num_actions:
        return mdp
    return DeterministicMDP(
        states=mdp.states,
        actions=mdp.actions,
        next_state=mdp.next_state.reshape(mdp.num_states, mdp.num_actions),
        terminal=ended,
        goal=goal,
        start=0,
        reward=reward,
    )


_REPORTED = 5_000
"""After so many states each the progress is reported."""

_Node = tuple[Hashable, float | None]
"""A state, and what its entry paid if the episode ended with it. Where the world knows its goals it is 1 for those."""


@dataclass(slots=True)
class _Search:
    """Breadth first through all that can happen.

    Attributes:
        nodes: What was found, in order, with its index.
        table: State, action, next state and probability of each outcome, one after the other.
        rewards: Probability times reward of each outcome.
    """

    world: FiniteWorld
    max_states: int
    progress: Callable[[int], None] | None
    nodes: dict[_Node, int] = field(default_factory=dict)
    table: "array[float]" = field(default_factory=lambda: array("d"))
    rewards: "array[float]" = field(default_factory=lambda: array("d"))

    def run(self) -> None:
        self._check_start()
        queue: list[_Node] = [(self.world.start, None)]
        self.nodes[queue[0]] = 0
        for here, (state, ending) in enumerate(queue):
            if self.progress is not None and here and here % _REPORTED == 0:
                self.progress(len(self.nodes))
            if ending is None:
                for action in range(len(self.world.actions)):
                    queue.extend(self._act(here, state, action))

    def _check_start(self) -> None:
        actions, start = self.world.actions, self.world.start
        if isinstance(actions, str) or not actions or any(not isinstance(name, str) or not name for name in actions):
            raise ValueError(f"a world needs a list of named actions, not {actions!r}")
        if len(set(actions)) != len(actions):
            raise ValueError(f"the actions need different names, not {', '.join(actions)}")
        if self.max_states < 1:
            raise ValueError(f"the largest number of states must be 1 or larger, not {self.max_states}")
        _check_label(start, "the start")
        if self._is_goal(start):
            raise ValueError(f"the start {start!r} is a goal, so the episode has ended before it begins")

    def _is_goal(self, state: Hashable) -> bool | None:
        is_goal = getattr(self.world, "is_goal", None)
        return None if is_goal is None else bool(is_goal(state))

    def _act(self, here: int, state: Hashable, action: int) -> list[_Node]:
        """Write down what can happen after an action, and return what was not known yet."""
        place = f"after {self.world.actions[action]!r} in {state!r}"
        found: list[_Node] = []
        total = 0.0
        with own_failures(f"{type(self.world).__name__}.outcomes", place):
            outcomes = list(self.world.outcomes(state, action))
        for each in outcomes:
            outcome = _checked(each, place)
            total += outcome.probability
            if outcome.probability == 0:
                continue
            node = self._node(outcome)
            if node not in self.nodes:
                self._check_room()
                self.nodes[node] = len(self.nodes)
                found.append(node)
            self.table.extend((here, action, self.nodes[node], outcome.probability))
            self.rewards.append(outcome.probability * outcome.reward)
        if not abs(total - 1) <= _TOLERANCE:
            raise ValueError(f"the probabilities {place} must sum to 1, not {total}")
        return found

    def _node(self, outcome: Outcome) -> _Node:
        is_goal = self._is_goal(outcome.state)
        if not outcome.ended and not is_goal:
            return outcome.state, None
        return outcome.state, float(outcome.reward if is_goal is None else is_goal)

    def _check_room(self) -> None:
        if len(self.nodes) == self.max_states:
            raise TooManyStates(
                f"more than {self.max_states} states can be reached from the start {self.world.start!r}: "
                f"abstract the world to fewer ({GUIDE} says how), or raise the limit (--max-states)"
            )


def _checked(each: Iterable[object], place: str) -> Outcome:
    try:
        outcome = Outcome(*each)  # type: ignore[arg-type]  # What is wrong with it is what we are about to see.
        probability, reward = float(outcome.probability), float(outcome.reward)
    except (TypeError, ValueError):
        raise ValueError(
            f"an outcome is a probability, a state, a reward and an end, and {place} is {each!r}"
        ) from None
    if not 0 <= probability <= 1 + _TOLERANCE:
        raise ValueError(f"a probability must be a number from 0 to 1, not {probability} {place}")
    if not math.isfinite(reward):
        raise ValueError(f"a reward must be a finite number, not {reward} {place}")
    _check_label(outcome.state, f"the state {place}")
    return Outcome(probability, outcome.state, reward, bool(outcome.ended))


def _check_label(label: object, name: str) -> None:
    try:
        hash(label)
    except TypeError:
        raise ValueError(f"{name} must be hashable, such as a tuple, and {label!r} is not") from None


def _goal_endings(world: FiniteWorld, nodes: Iterable[_Node]) -> float:
    """Return what an ending must have paid, within the tolerance, to count as goal.

    Raises:
        ValueError: No goal can be reached.
    """
    endings = [ending for _, ending in nodes if ending is not None]
    problem = f"no goal can be reached from the start {world.start!r}: "
    if not endings:
        raise ValueError(f"{problem}no episode ever ends; say which states are goals with is_goal ({GUIDE})")
    best = max(endings)
    if hasattr(world, "is_goal"):
        if best < 1:
            raise ValueError(f"{problem}is_goal holds for none of the ends in reach")
        return 1.0
    least = float(getattr(world, "least_goal_reward", -math.inf))
    if best < least - _TOLERANCE:
        raise ValueError(f"{problem}the best end in reach pays {best:g}, and a goal pays {least:g} or more")
    return best


def _merge(
    nodes: Iterable[_Node], goal_ending: float
) -> tuple[tuple[Hashable, ...], NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Make one state of all endings that look alike and reach the goal alike.

    Returns:
        The labels, the new index of each node, and which of the new states are goals and which have ended.
    """
    kinds: dict[tuple[Hashable, bool, bool], int] = {}
    merged = []
    for state, ending in nodes:
        kind = (state, ending is not None, ending is not None and ending >= goal_ending - _TOLERANCE)
        merged.append(kinds.setdefault(kind, len(kinds)))
    copies: dict[Hashable, int] = {}
    for state, _, _ in kinds:
        copies[state] = copies.get(state, 0) + 1
    labels = tuple(Ended(state, goal) if end and copies[state] > 1 else state for state, end, goal in kinds)
    ended = np.array([end for _, end, _ in kinds])
    return labels, np.array(merged), np.array([goal for _, _, goal in kinds]), ended
