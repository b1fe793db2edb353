"""A key-door world as a Gymnasium environment, built on Farama MiniGrid.

The rules are MiniGrid's own, reached through five of its seven actions; what is observed is the state of five numbers
that Sakai et al. 2021 (section 5) plan and explain with. Only this module imports minigrid.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, SupportsFloat

import numpy as np
from gymnasium import spaces
from minigrid.core.actions import Actions
from minigrid.core.grid import Grid
from minigrid.core.mission import MissionSpace
from minigrid.core.world_object import Door, Goal, Key, Wall, WorldObj
from minigrid.minigrid_env import MiniGridEnv
from numpy.typing import NDArray

from webapp.explainer.worlds.key_door import ACTIONS, STEPS, KeyDoorState, start_state
from webapp.explainer.worlds.layout import Cell, Layout
from webapp.explainer.worlds.view import SIZE

COLOUR = "yellow"
"""The colour, in MiniGrid's words, of the key and of the door that it opens."""

Observation = NDArray[np.int64]
"""`[5]`: x, y, heading, has_key, door_open; see `KeyDoorState`."""

_MINIGRID_ACTIONS = tuple(int(Actions[name]) for name in ACTIONS)


class LockingDoor(Door):
    """A door that is locked whenever it is shut, so that it opens and closes only for the agent with the key.

    MiniGrid's own door, once unlocked, can be shut without being locked. No observation would tell that third state
    from the other two.
    """

    def toggle(self, env: MiniGridEnv, pos: Cell) -> bool:  # noqa: ARG002 - MiniGrid's signature.
        """Open or shut the door if the agent holds its key, and say whether it moved."""
        key = env.carrying
        if not isinstance(key, Key) or key.color != self.color:
            return False
        self.is_open = not self.is_open
        self.is_locked = not self.is_open
        return True


class KeyDoorEnv(MiniGridEnv):
    """One world, entered at its start or in any state of it.

    Actions are the indices into `key_door.ACTIONS`. Reaching the goal at step `t` terminates the episode with reward
    `1 - 0.9 * t / max_steps`; every other reward is 0. The episode is truncated at step `max_steps`, which is
    `10 * width * height`. `reset` takes the option `state`, a `KeyDoorState` in which the episode is to begin.

    Attributes:
        layout: The map of the world.
        action_names: What the actions are called.
    """

    action_names: ClassVar[tuple[str, ...]] = ACTIONS

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}  # type: ignore[misc]

    def __init__(self, layout: Layout, render_mode: str | None = None) -> None:
        super().__init__(
            mission_space=MissionSpace(mission_func=lambda: "take the key, open the door, go to the goal"),
            width=layout.width,
            height=layout.height,
            max_steps=10 * layout.width * layout.height,
            agent_view_size=SIZE,
            render_mode=render_mode,
        )
        self.layout = layout
        self.action_space = spaces.Discrete(len(ACTIONS))
        self.observation_space = spaces.MultiDiscrete([layout.width, layout.height, 4, 2, 2])
        self._start = start_state(layout)
        self._key = Key(COLOUR)
        self._door = LockingDoor(COLOUR, is_locked=True)
        self._cells = self._furnish()

    @property
    def state(self) -> KeyDoorState:
        """Where the agent is, as plain integers."""
        x, y = self.agent_pos
        return KeyDoorState(x, y, self.agent_dir, int(self.carrying is not None), int(self._door.is_open))

    @property
    def front_pos(self) -> Cell:
        """The cell ahead of the agent. MiniGrid's own makes arrays for it, which takes most of a step's time."""
        x, y = self.agent_pos
        dx, dy = STEPS[self.agent_dir]
        return x + dx, y + dy

    def reset(  # type: ignore[override]  # MiniGrid's type variables are bound to nothing.
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Seeds the environment's generator, which these worlds never draw from.
            options: None, or `{"state": s}` to begin in a state `s` other than the start.

        Raises:
            ValueError: An option is unknown, or the state is none that an episode can be in before it ends.
        """
        options = options or {}
        if unknown := set(options) - {"state"}:
            raise ValueError(f"reset has no option {sorted(unknown)}; it has 'state'")
        state = KeyDoorState(*map(int, options["state"])) if "state" in options else self._start
        self._check(state)
        super().reset(seed=seed)
        self._enter(state)
        return self.gen_obs(), {}

    def step(  # type: ignore[override]  # As for `reset`.
        self, action: int
    ) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Apply one action by MiniGrid's rules.

        Raises:
            ValueError: There is no such action.
        """
        if not 0 <= action < len(_MINIGRID_ACTIONS):
            raise ValueError(f"there is no action {action}; there are {len(_MINIGRID_ACTIONS)}, from 0")
        result: tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]] = super().step(_MINIGRID_ACTIONS[action])
        return result

    def gen_obs(self) -> Observation:
        """Return the observation of the current state."""
        x, y = self.agent_pos
        return np.array((x, y, self.agent_dir, self.carrying is not None, self._door.is_open), dtype=np.int64)

    def _furnish(self) -> list[WorldObj | None]:
        """Return what stands in each cell at first, row by row, as MiniGrid's grid holds it."""
        layout = self.layout
        furniture: dict[Cell, WorldObj] = {cell: Wall() for cell in layout.walls}
        furniture |= {layout.key: self._key, layout.door: self._door, layout.goal: Goal()}
        return [furniture.get((x, y)) for y in range(layout.height) for x in range(layout.width)]

    def _gen_grid(self, width: int, height: int) -> None:
        """Lay the world out as an episode begins, for MiniGrid's `reset`."""
        self.grid = Grid(width, height)
        self._enter(self._start)

    def _enter(self, state: KeyDoorState) -> None:
        self.grid.grid[:] = self._cells
        self.agent_pos = (state.x, state.y)
        self.agent_dir = state.heading
        self.carrying = self._key if state.has_key else None  # type: ignore[assignment]  # MiniGrid leaves it untyped.
        if state.has_key:
            self.grid.set(*self.layout.key, None)
        self._door.is_open = bool(state.door_open)
        self._door.is_locked = not state.door_open

    def _check(self, state: KeyDoorState) -> None:
        layout, cell = self.layout, (state.x, state.y)
        inside = 0 <= state.x < layout.width and 0 <= state.y < layout.height and cell not in layout.walls
        blocked = (cell == layout.key and not state.has_key) or (cell == layout.door and not state.door_open)
        flags = state.has_key in (0, 1) and state.door_open in (0, 1) and 0 <= state.heading < 4  # noqa: PLR2004
        if not inside or blocked or not flags:
            raise ValueError(f"{state} is no state of this world")
        if cell == layout.goal:
            raise ValueError(f"an episode cannot begin in {state}, where it has ended")
