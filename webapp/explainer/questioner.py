"""What a questioner believes, the route that follows from it, and the step at which they ask.

The routes `a_bad` are shortest paths in the world that the questioner believes in (Sakai et al. 2021, sections 5.1
and 6). The paper does not give the questioner of its second experiment; this one is ours: they believe that the door
stands open and that no key is needed, and they ask where the agent first does what they cannot account for.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.worlds.key_door import KeyDoorState, enumerate_from, key_door_state, step
from webapp.explainer.worlds.layout import Cell, Layout, LayoutError
from webapp.explainer.worlds.view import key_in_view


class NoSplit(ValueError):
    """A path has no step at which the second experiment's question can be asked."""


@dataclass(frozen=True, slots=True)
class Question:
    """The situation in which a participant of the second experiment is asked to understand the agent.

    Attributes:
        from_step: The step n of the split.
        video_actions: `[n - 1]`: the action indices taken so far.
        announced_actions: The agent's next action indices.
        route: The action indices `a_bad` that the questioner would take from the split.
    """

    from_step: int
    video_actions: tuple[int, ...]
    announced_actions: tuple[int, ...]
    route: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Belief:
    r"""A map that a questioner takes for the real one; where the agent starts on it does not matter.

    Attributes:
        layout: The believed map.
        source: What to call it, such as its file name.

    Example:
        >>> from webapp.explainer import Belief, parse_layout
        >>> Belief(parse_layout("#######\n#K<.DG#\n#######"), "what the visitor drew").source
        'what the visitor drew'
    """

    layout: Layout
    source: str = "believed map"


def believed_open_door(layout: Layout, state: KeyDoorState) -> DeterministicMDP:
    """Return the world in which the door already stands open, from a state of the real one."""
    return enumerate_from(layout, state._replace(door_open=1))


def believed_door_at(layout: Layout, door: Cell, state: KeyDoorState) -> DeterministicMDP:
    """Return the world in which the door is elsewhere, from a state of the real one.

    Raises:
        ValueError: The cell is not an inner wall.
    """
    return enumerate_from(layout.with_door_at(door), state)


def believed_route(belief: DeterministicMDP) -> tuple[int, ...]:
    """Return the shortest path in a believed world, as the questioner's action indices `a_bad`.

    Raises:
        NeverArrives: The goal cannot be reached even in that world.
    """
    return follow(belief, plan(belief)).actions


def mistaken_route(layout: Layout, belief: Belief, state: KeyDoorState) -> tuple[int, ...]:
    r"""Return the shortest path on a believed map from a state of the real world, as action indices `a_bad`.

    The agent's state is taken over as it is: position, heading, key in hand, door open.

    Args:
        layout: The real map.
        belief: The believed one.
        state: A state of the real world, in which the question is asked.

    Raises:
        LayoutError: The maps differ in size, the agent could not be where it is on the believed map, or its goal
            cannot be reached from there.

    Example:
        >>> from webapp.explainer import Belief, mistaken_route, parse_layout, tabulate
        >>> real = parse_layout("#######\n#>K.DG#\n#######")
        >>> believed = Belief(parse_layout("#######\n#>.KDG#\n#######"))
        >>> world = tabulate(real)
        >>> [world.actions[action] for action in mistaken_route(real, believed, world.states[world.start])]
        ['forward', 'pickup', 'forward', 'toggle', 'forward', 'forward']
    """
    check_size(layout, belief)
    if (found := _in_the_way(belief.layout, state)) is not None:
        problem = f"the agent stands at ({state.x}, {state.y}), where this believed map has {found}"
        raise LayoutError(problem, line=state.y + 1, column=state.x + 1, source=belief.source)
    mdp = enumerate_from(belief.layout, state)
    if not np.any(mdp.goal):
        x, y = belief.layout.goal
        problem = f"on this believed map the goal cannot be reached from ({state.x}, {state.y}), where the agent stands"
        raise LayoutError(problem, line=y + 1, column=x + 1, source=belief.source)
    return believed_route(mdp)


def believed_states(belief: Belief, state: KeyDoorState, route: Sequence[int]) -> tuple[KeyDoorState, ...]:
    """Return the states that a questioner expects: the given one, and one after each action of the route."""
    states = [state]
    for action in route:
        states.append(step(belief.layout, states[-1], action)[0])
    return tuple(states)


def check_size(layout: Layout, belief: Belief) -> None:
    """Refuse a believed map that is not as large as the real one.

    Raises:
        LayoutError: It is not.
    """
    real, believed = ((some.width, some.height) for some in (layout, belief.layout))
    if real != believed:
        problem = (
            f"the believed map is {believed[0]} cells wide and {believed[1]} high, the real one {real[0]} and {real[1]}"
        )
        raise LayoutError(problem, line=believed[1], column=believed[0], source=belief.source)


def find_split(
    layout: Layout, mdp: DeterministicMDP, path: Trajectory, *, min_video_actions: int = 2, num_announced: int = 2
) -> Question:
    """Find the last step at which somebody who believes in an open door is surprised, the key still unseen.

    At the split the key has not been in view in any state so far, the agent's next action differs from the first of
    the route that the questioner would take, enough actions have been taken to show, and enough are left to announce.

    Args:
        layout: The real world.
        mdp: A world whose labels are the layout's `KeyDoorState`s.
        path: The agent's path from the start.
        min_video_actions: How many actions must have been taken.
        num_announced: How many of the agent's next actions are announced, at least 1.

    Raises:
        NoSplit: There is no such step.
        ValueError: A number is too small.
    """
    if min_video_actions < 0 or num_announced < 1:
        raise ValueError(
            f"a question shows 0 actions or more and announces 1 or more, not {min_video_actions} and {num_announced}"
        )
    first, last = min_video_actions + 1, path.num_steps - num_announced + 1
    states = [key_door_state(mdp, state) for state in path.states]
    for number in reversed(range(first, last + 1)):
        if any(key_in_view(layout, state) for state in states[:number]):
            continue
        route = believed_route(believed_open_door(layout, states[number - 1]))
        if route[0] != path.actions[number - 1]:
            announced = path.actions[number - 1 : number - 1 + num_announced]
            return Question(number, path.actions[: number - 1], announced, route)
    raise NoSplit(
        f"no step of this path can be asked about: from step {first} to {last} the agent has either seen the key or "
        f"goes where somebody would go who believes that the door stands open (start {states[0]!r})"
    )


def _in_the_way(layout: Layout, state: KeyDoorState) -> str | None:
    """Return what an agent in this state could not stand on, if its cell has such a thing."""
    things = {layout.goal: "the goal"}
    if not state.has_key:
        things[layout.key] = "the key"
    if not state.door_open:
        things[layout.door] = "a locked door"
    cell = (state.x, state.y)
    return "a wall" if cell in layout.walls else things.get(cell)
