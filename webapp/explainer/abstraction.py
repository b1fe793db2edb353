"""Coarse worlds: an abstraction maps states to coarser ones, and only promises that can be kept become actions.

Sakai et al. 2021, section 7.2, made precise. The states of a world with the same coarse label form a block. A coarse
action is an option (Sutton, Precup & Singh 1999): walk about in the block until you step into another one. It is sound
if every state of the block can surely do it, so that the blocks are classes of a stuttering equivalence (Browne,
Clarke & Grumberg 1988; Groote & Vaandrager 1990). What is sound is checked here and never assumed.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.block_exits import Able, Outcomes, members_of
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.stochastic import World


class UnsoundAbstraction(ValueError):
    """A coarse world would promise what cannot be done; the message names a block and one of its states."""


@dataclass(frozen=True, slots=True)
class Abstraction:
    r"""A way of looking at states more coarsely.

    Attributes:
        name: What to call it.
        coarse: Maps the label of every state to a coarse label.
        edge_name: Says in a few words what leads from one coarse label to another, such as "open the door".

    Example:
        >>> from webapp.explainer import Abstraction, coarsen, parse_layout, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> key = Abstraction("key", lambda state: (state.x == 5, state.has_key), lambda before, after: f"to {after}")
        >>> coarsen(world, key).mdp.states
        ((False, 0), (False, 1), (True, 1))
    """

    name: str
    coarse: Callable[[Hashable], Hashable]
    edge_name: Callable[[Hashable, Hashable], str]


class Part(NamedTuple):
    """One of the parts into which a block had to be split; the first part keeps the block's own label.

    Attributes:
        whole: The coarse label of the block.
        number: From 2.
    """

    whole: Hashable
    number: int

    def __str__(self) -> str:
        return f"{self.whole} (part {self.number})"


@dataclass(frozen=True, slots=True, eq=False)
class CoarseWorld:
    """A world seen through an abstraction that is sound.

    Attributes:
        abstraction: The abstraction.
        mdp: The coarse world, `B` states. Its labels are the coarse ones, its actions are named after edges; where an
            action does not apply it leads back to the same state.
        block_of: `[S]`: the coarse state of each state. The entries of states that cannot be reached are never used.
        reachable: `[S]`: True for the states that can be reached from the start.
    """

    abstraction: Abstraction
    mdp: DeterministicMDP
    block_of: NDArray[np.int32]
    reachable: NDArray[np.bool_]

    def coarse_states(self, states: Sequence[int]) -> tuple[int, ...]:
        """Return the coarse state of each of some states.

        Raises:
            ValueError: There is no such state, or it cannot be reached from the start.
        """
        for state in states:
            if not 0 <= state < len(self.block_of):
                raise ValueError(f"there is no state {state}; there are {len(self.block_of)}, from 0")
            if not self.reachable[state]:
                raise ValueError(f"state {state} cannot be reached from the start, so it has no coarse state")
        return tuple(int(self.block_of[state]) for state in states)


def by_components(components: Sequence[str | int], name: str = "components") -> Abstraction:
    r"""Return the abstraction that keeps some components of states that are tuples, and drops the others.

    Args:
        components: What to keep: names, where the labels are NamedTuples, or positions from 0.
        name: What to call the abstraction.

    Returns:
        An abstraction whose coarse labels are tuples and whose edges are named after what changes, such as
        "has_key 1". A label that lacks one of the components is refused when it is met.

    Raises:
        ValueError: No component is named, or one is named twice.

    Example:
        >>> from webapp.explainer import by_components, parse_layout, tabulate
        >>> by_components(["has_key"]).coarse(tabulate(parse_layout("#######\n#K<.DG#\n#######")).states[0])
        (0,)
    """
    kept = tuple(components)
    if not kept or len(set(kept)) != len(kept):
        raise ValueError(f"name at least one component, and each one once, not {kept}")

    def coarse(label: Hashable) -> Hashable:
        return tuple(_component(label, component) for component in kept)

    def edge_name(before: Hashable, after: Hashable) -> str:
        old, new = (label if isinstance(label, tuple) else () for label in (before, after))
        changes = [f"{component} {b}" for component, a, b in zip(kept, old, new, strict=True) if a != b]
        return ", ".join(changes)

    return Abstraction(name, coarse, edge_name)


def coarsen(world: World, abstraction: Abstraction) -> CoarseWorld:
    r"""Return a world as an abstraction shows it, if that promises nothing that cannot be done.

    An action leads from block B to block B' if some state of B can surely get to B' without passing through a third
    block, and then all states of B must be able to. Where chances decide, "surely" means with probability 1 under some
    policy; what can only happen by chance is no coarse action. Actions that lead from one block to several others
    under the same name are numbered: "leave", "leave (2)".

    Args:
        world: The world. Only states that can be reached from its start count.
        abstraction: How to look at it. `sound_refinement` mends one that is refused.

    Raises:
        UnsoundAbstraction: A block mixes ends with other states or goals with other ends, or an edge out of a block
            cannot be taken from one of its states. The message names them.
        ValueError: All reachable states look the same, or an edge has no name.

    Example:
        >>> from webapp.explainer import by_components, coarsen, parse_layout, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> coarse = coarsen(world, by_components(["x", "has_key"]))
        >>> world.num_states, coarse.mdp.num_states, coarse.mdp.actions[:2]
        (37, 7, ('has_key 1', 'x 3'))
    """
    outcomes = Outcomes.of(world)
    reachable = outcomes.reachable(world.start, len(world.states))
    labels = [abstraction.coarse(world.states[state]) for state in np.flatnonzero(reachable).tolist()]
    names = tuple(dict.fromkeys(labels))
    if len(names) == 1:
        raise ValueError(f"{abstraction.name} sees every state as {names[0]!s}, so nothing ever happens")
    block_of = _numbered(labels, reachable)
    blocks = members_of(block_of, reachable)
    for kind, flags in (("states that end the episode", world.terminal), ("goals", world.goal)):
        _refuse_mixture(world, abstraction, kind, flags, blocks)
    able = outcomes.exits(block_of, blocks)
    _refuse_empty_promises(world, abstraction, able, names, blocks)
    actions, next_state = _actions(names, able, abstraction)
    firsts = [int(block[0]) for block in blocks]
    mdp = DeterministicMDP(
        names, actions, next_state, world.terminal[firsts], world.goal[firsts], int(block_of[world.start])
    )
    return CoarseWorld(abstraction, mdp, block_of, reachable)


def sound_refinement(world: World, abstraction: Abstraction) -> Abstraction:
    r"""Return the coarsest sound abstraction of a world that tells apart at least what a given one does.

    Blocks are split by what their states can surely do next until all states of a block can do the same. One that is
    sound already keeps its labels; else the first part of a block keeps the label and the others become a `Part`. An
    edge between parts is named after the part that it leads to, any other as before.

    Args:
        world: The world.
        abstraction: What must be told apart at least. Ends are told from other states, and goals from other ends.

    Returns:
        An abstraction for the reachable states of this world only.

    Example:
        >>> from webapp.explainer import by_components, coarsen, parse_layout, sound_refinement, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> columns = sound_refinement(world, by_components(["x"]))
        >>> [str(label) for label in coarsen(world, columns).mdp.states]
        ['(2,)', '(2,) (part 2)', '(1,)', '(3,)', '(3,) (part 2)', '(4,)', '(5,)']
    """
    outcomes = Outcomes.of(world)
    reachable = outcomes.reachable(world.start, len(world.states))
    states = np.flatnonzero(reachable).tolist()
    wholes = {state: abstraction.coarse(world.states[state]) for state in states}
    keys: list[Hashable] = [(wholes[state], bool(world.terminal[state]), bool(world.goal[state])) for state in states]
    while True:
        block_of = _numbered(keys, reachable)
        blocks = members_of(block_of, reachable)
        options: dict[int, list[int]] = {state: [] for state in states}
        for (block, after), can in outcomes.exits(block_of, blocks).items():
            for state in blocks[block][can].tolist():
                options[state].append(after)
        keys = [(int(block_of[state]), tuple(options[state])) for state in states]
        if len(set(keys)) == len(blocks):
            return _refined(world, abstraction, wholes, block_of)


def _refined(
    world: World, abstraction: Abstraction, wholes: Mapping[int, Hashable], block_of: NDArray[np.int32]
) -> Abstraction:
    parts: dict[Hashable, list[int]] = {}
    coarse: dict[Hashable, Hashable] = {}
    for state, whole in wholes.items():
        known = parts.setdefault(whole, [])
        if block_of[state] not in known:
            known.append(int(block_of[state]))
        number = known.index(int(block_of[state])) + 1
        coarse[world.states[state]] = whole if number == 1 else Part(whole, number)

    def edge_name(before: Hashable, after: Hashable) -> str:
        old, new = (label.whole if isinstance(label, Part) else label for label in (before, after))
        return abstraction.edge_name(old, new) if old != new else f"go on to {after}"

    return Abstraction(abstraction.name, coarse.__getitem__, edge_name)


def _component(label: Hashable, component: str | int) -> Hashable:
    found: Hashable
    if isinstance(component, str) and component in getattr(label, "_fields", ()):
        found = getattr(label, component)
        return found
    if isinstance(component, int) and isinstance(label, tuple) and 0 <= component < len(label):
        found = label[component]
        return found
    raise ValueError(f"the state {label!r} has no component {component!r}")


def _numbered(keys: Sequence[Hashable], reachable: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return `[S]`: equal numbers for equal keys of the reachable states, counted from 0 as they appear."""
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    block_of = np.zeros(len(reachable), dtype=np.int32)
    block_of[reachable] = [numbers[key] for key in keys]
    return block_of


def _refuse_mixture(
    world: World, abstraction: Abstraction, kind: str, flags: NDArray[np.bool_], blocks: list[NDArray[np.int64]]
) -> None:
    for block in blocks:
        if np.any(flags[block]) and not np.all(flags[block]):
            inside = world.states[int(block[np.argmax(flags[block])])]
            outside = world.states[int(block[np.argmin(flags[block])])]
            raise UnsoundAbstraction(
                f"{abstraction.name} is not sound: {abstraction.coarse(inside)!s} mixes {kind}, such as {inside!r}, "
                f"with others, such as {outside!r}; keep apart what does not end alike"
            )


def _refuse_empty_promises(
    world: World, abstraction: Abstraction, able: Able, names: Sequence[Hashable], blocks: list[NDArray[np.int64]]
) -> None:
    if not able:
        raise UnsoundAbstraction(f"{abstraction.name} has no actions: chance decides about every way out of a block")
    for (block, after), can in able.items():
        if not np.all(can):
            stuck = world.states[int(blocks[block][np.argmin(can)])]
            raise UnsoundAbstraction(
                f"{abstraction.name} is not sound: in {names[block]!s} some states can surely "
                f"{abstraction.edge_name(names[block], names[after])!r}, but {stuck!r} cannot without leaving it for "
                "somewhere else; keep more in the abstraction, or take its sound refinement"
            )


def _actions(
    names: Sequence[Hashable], able: Able, abstraction: Abstraction
) -> tuple[tuple[str, ...], NDArray[np.int32]]:
    """Return the names of the coarse actions, in the order in which blocks offer them, and `[B, A]`."""
    edges: dict[tuple[int, str], int] = {}
    for block, after in able:
        name = abstraction.edge_name(names[block], names[after])
        if not name:
            raise ValueError(f"{abstraction.name} has no name for the way from {names[block]!s} to {names[after]!s}")
        count = 1
        while (block, numbered := name if count == 1 else f"{name} ({count})") in edges:
            count += 1
        edges[block, numbered] = after
    actions = {name: number for number, name in enumerate(dict.fromkeys(name for _, name in edges))}
    next_state = np.tile(np.arange(len(names), dtype=np.int32)[:, None], (1, len(actions)))
    for (block, name), after in edges.items():
        next_state[block, actions[name]] = after
    return tuple(actions), next_state
