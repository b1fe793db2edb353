"""What a questioner believes, the route that follows from it, and the step at which they ask.

The routes `a_bad` are shortest paths in the world that the questioner believes in (Sakai et al. 2021, sections 5.1
and 6). The paper does not give the questioner of its second experiment; this one is ours: they believe that the door
stands open and that no key is needed, and they ask where the agent first does what they cannot account for.
"""

from dataclasses import dataclass

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.worlds.key_door import KeyDoorState, enumerate_from
from webapp.explainer.worlds.layout import Cell, Layout
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
    states = [_key_door_state(mdp, state) for state in path.states]
    for step in reversed(range(first, last + 1)):
        if any(key_in_view(layout, state) for state in states[:step]):
            continue
        route = believed_route(believed_open_door(layout, states[step - 1]))
        if route[0] != path.actions[step - 1]:
            announced = path.actions[step - 1 : step - 1 + num_announced]
            return Question(step, path.actions[: step - 1], announced, route)
    raise NoSplit(
        f"no step of this path can be asked about: from step {first} to {last} the agent has either seen the key or "
        f"goes where somebody would go who believes that the door stands open (start {states[0]!r})"
    )


def _key_door_state(mdp: DeterministicMDP, state: int) -> KeyDoorState:
    label = mdp.states[state]
    if not isinstance(label, KeyDoorState):
        raise TypeError(f"a questioner asks about key-door worlds, and {label!r} is no state of one")
    return label
