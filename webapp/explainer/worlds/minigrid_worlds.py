"""MiniGrid's environments as finite worlds: put into a state, stepped once by their own rules, and read again.

Of a grid only what can change makes a state: where the agent is, what it carries, doors, and things that can be taken
away. Everything else is compared after each step, so that a world with a memory elsewhere is refused, not distorted.
"""

from collections import Counter, namedtuple
from collections.abc import Callable, Hashable, Iterator, Sequence
from operator import is_, itemgetter
from typing import Any, cast

import numpy as np
from minigrid.core.world_object import Box, Door, WorldObj
from minigrid.envs.babyai.core.roomgrid_level import RoomGridLevel
from minigrid.minigrid_env import MiniGridEnv

from webapp.explainer.worlds.finite import GUIDE, NotFinite, Outcome
from webapp.explainer.worlds.spaces import action_names

HEADINGS = ("right", "down", "left", "up")
"""MiniGrid's headings, in words."""

_CARRIED, _INSIDE, _GONE = "carried", "inside a box", "gone"
_NOTHING = "nothing"
_DOORS = {(True, False): "open", (False, False): "closed", (False, True): "locked", (True, True): "open, bolt out"}
"""Words for `(is_open, is_locked)`."""

_STATE = frozenset({"agent_pos", "agent_dir", "carrying", "grid", "step_count"})
"""The attributes of an environment that make up its state, and the clock, which is held still."""


class MiniGridWorld:
    """The world of a MiniGrid environment as one seed lays it out.

    A state is a named tuple: `x`, `y`, `heading` (0 right, 1 down, 2 left, 3 up); where there is anything to take,
    `carrying`; then one component per door ("open", "closed", "locked") and per thing that can be taken away: its
    `(x, y)`, "carried", "inside a box", or "gone" for a box that was opened. The clock stands at 0 before each step,
    so that the reward for success is the same in every state; running out of time ends no episode.

    Attributes:
        name: What to call it in messages.
        actions: The names of its actions.
        start: The state in which `reset` begins.
        least_goal_reward: Above 0: MiniGrid pays for success only.

    Args:
        env: The environment, without wrappers. It is kept and stepped.
        seed: Of `reset`.
        name: What to call it in messages.

    Raises:
        NotFinite: Something that changes cannot be restored.
    """

    least_goal_reward = 1e-6

    def __init__(self, env: MiniGridEnv, seed: int, name: str) -> None:
        if isinstance(env, RoomGridLevel):
            raise NotFinite(
                f"{name} gives an instruction that remembers what was done, which cannot be restored: "
                f"name its states through the protocol of {GUIDE}"
            )
        env.reset(seed=seed)
        if type(env).gen_obs is MiniGridEnv.gen_obs and type(env).__module__.startswith("minigrid."):
            env.gen_obs = dict  # type: ignore[method-assign]  # Nobody looks at the picture, which takes most of a step.
        self.name = name
        self.actions: Sequence[str] = action_names(env, name, [action.name for action in env.actions])
        self._env = env
        things = list(_things(cell for cell in env.grid.grid if cell is not None))
        self._check_things(things)
        self._doors = [thing for thing in things if isinstance(thing, Door)]
        self._movable = [thing for thing in things if thing.can_pickup()]
        self._inside = {id(thing.contains) for thing in things if isinstance(thing, Box)}
        self._fixed = [None if cell is not None and cell.can_pickup() else cell for cell in env.grid.grid]
        names = [name for name in vars(env) if name not in _STATE]
        self._rest = itemgetter(*names)
        self._kept = dict(zip(names, self._rest(vars(env)), strict=True))
        self._names = _distinct_names([*self._doors, *self._movable])
        own = ["x", "y", "heading", *(["carrying"] if self._movable else [])]
        self._doors_at = slice(len(own), len(own) + len(self._doors))
        self._label = _label_type([*own, *(name.replace(" ", "_") for name in self._names)])
        self.start: Hashable = self._label(*(self._agent() + self._furniture("reset")))

    def outcomes(self, state: Hashable, action: int) -> Iterator[Outcome]:
        """Put the environment into the state and step once.

        Raises:
            NotFinite: The step draws random numbers, or changes what cannot be restored.
        """
        label = cast("tuple[Any, ...]", state)
        env, doing = self._env, repr(self.actions[action])
        self._enter(label)
        cells, carried = env.grid.grid.copy(), env.carrying
        generator = env.np_random.bit_generator
        before = generator.state
        _, reward, ended, _, _ = env.step(action)
        if generator.state != before:
            raise NotFinite(
                f"{doing} in {self.name} draws random numbers, so what can happen cannot be listed by stepping: "
                f"give the probabilities through the protocol of {GUIDE}"
            )
        self._check_rest(doing)
        moved = env.carrying is not carried or env.grid.grid != cells
        after = self._agent() + (self._furniture(doing) if moved else self._same_furniture(label))
        yield Outcome(1.0, self._label(*after), float(reward), bool(ended))

    def describe(self, state: Hashable) -> str:
        """Put a state into words."""
        label = cast("tuple[Any, ...]", state)
        words = [f"at {label[:2]} facing {HEADINGS[label[2]]}"]
        if self._movable:
            words.append(f"carrying {label[3] if label[3] == _NOTHING else f'the {label[3]}'}")
        for name, how in zip(self._names, label[self._doors_at.start :], strict=True):
            if how != _CARRIED:
                words.append(f"the {name} {f'at {how}' if isinstance(how, tuple) else how}")
        return ", ".join(words)

    def _check_things(self, things: Sequence[WorldObj]) -> None:
        for thing in things:
            if type(thing).toggle is not WorldObj.toggle and not isinstance(thing, Door | Box):
                raise NotFinite(
                    f"{self.name} holds a {thing.color} {thing.type} that toggling may change in ways unknown here: "
                    f"name its states through the protocol of {GUIDE}"
                )

    def _enter(self, label: tuple[Any, ...]) -> None:
        env, width = self._env, self._env.grid.width
        env.grid.grid[:] = self._fixed
        env.step_count = 0
        env.agent_pos, env.agent_dir = label[:2], label[2]
        env.carrying = None
        for door, how in zip(self._doors, label[self._doors_at], strict=True):
            door.is_open, door.is_locked = next(flags for flags, word in _DOORS.items() if word == how)
        for thing, place in zip(self._movable, label[self._doors_at.stop :], strict=True):
            if place == _CARRIED:
                env.carrying = thing  # type: ignore[assignment]  # MiniGrid leaves it untyped.
            elif isinstance(place, tuple):
                env.grid.grid[place[1] * width + place[0]] = thing
                thing.cur_pos = place

    def _agent(self) -> tuple[Any, ...]:
        x, y = self._env.agent_pos
        return int(x), int(y), int(self._env.agent_dir)

    def _door_words(self) -> tuple[str, ...]:
        return tuple(_DOORS[bool(door.is_open), bool(door.is_locked)] for door in self._doors)

    def _same_furniture(self, label: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return the components after the agent's, of which only the doors have to be looked at again."""
        return label[3 : self._doors_at.start] + self._door_words() + label[self._doors_at.stop :]

    def _furniture(self, doing: str) -> tuple[Any, ...]:
        """Return the components after the agent's, read from the whole grid."""
        env, width = self._env, self._env.grid.width
        places: dict[int, Any] = {}
        for index, (cell, fixed) in enumerate(zip(env.grid.grid, self._fixed, strict=True)):
            if cell is not fixed:
                y, x = divmod(index, width)
                if fixed is not None or not any(cell is thing for thing in self._movable):
                    raise NotFinite(f"{doing} in {self.name} builds the cell {(x, y)} anew, which cannot be restored")
                places[id(cell)] = (x, y)
        if env.carrying is not None:
            places[id(env.carrying)] = _CARRIED
        things = [places.get(id(each), _INSIDE if id(each) in self._inside else _GONE) for each in self._movable]
        if not things:
            return self._door_words()
        names = dict(zip(things, self._names[len(self._doors) :], strict=True))
        return (names.get(_CARRIED, _NOTHING), *self._door_words(), *things)

    def _check_rest(self, doing: str) -> None:
        """Refuse a step that changed an attribute which is no part of the state."""
        held, kept = vars(self._env), self._kept
        if len(held) == len(kept) + len(_STATE) and all(map(is_, self._rest(held), kept.values())):
            return
        changed = [name for name in held if name not in _STATE and not np.all(held[name] == kept.get(name, held))]
        if changed:
            raise NotFinite(
                f"{doing} in {self.name} changes {', '.join(changed)}, which is no part of the grid: "
                f"name its states through the protocol of {GUIDE}"
            )


def _label_type(fields: Sequence[str]) -> Callable[..., Hashable]:
    """Make the named tuple of one layout's states; which fields it has is known only now."""
    label: type[tuple[Any, ...]] = namedtuple("MiniGridState", fields)  # type: ignore[misc]  # noqa: PYI024 - as said.
    return label


def _things(cells: Iterator[WorldObj]) -> Iterator[WorldObj]:
    """Return what stands in cells and what is inside of it."""
    for cell in cells:
        yield cell
        if cell.contains is not None:
            yield from _things(iter([cell.contains]))


def _distinct_names(things: Sequence[WorldObj]) -> tuple[str, ...]:
    """Return colour and kind of each thing, numbered where there are several of a name."""
    names = [f"{thing.color} {thing.type}" for thing in things]
    count, seen = Counter(names), Counter[str]()
    distinct = []
    for name in names:
        seen[name] += 1
        distinct.append(f"{name} {seen[name]}" if count[name] > 1 else name)
    return tuple(distinct)
