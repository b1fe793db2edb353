"""own_world.py: a world and a kind of explanation of one's own."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces

from webapp.stimuli.own_kinds import ExplanationTask

SKY, WATER, BOAT, CARGO, HARBOUR = (205, 225, 245), (40, 90, 150), (120, 60, 30), (240, 180, 30), (90, 160, 90)
State = tuple[int, int]


class Ferry(gymnasium.Env[np.ndarray, int]):
    """A boat fetches its cargo at the west end and brings it to the harbour at the east end."""

    action_names = ("west", "east", "load")
    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"]}

    def __init__(self, length: int = 7, render_mode: str | None = None) -> None:
        self.render_mode = render_mode
        self.length = length
        self.action_space = spaces.Discrete(len(self.action_names))
        self.observation_space = spaces.MultiDiscrete([length, 2])  # Where the boat is, and whether it is loaded.

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin near the west end, without the cargo."""
        super().reset(seed=seed, options=options)
        self.place, self.loaded = 2, 0
        return self._observation(), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Move, or load; what cannot be done changes nothing."""
        match self.action_names[action]:
            case "west":
                self.place = max(self.place - 1, 0)
            case "east":
                self.place = min(self.place + 1, self.length - 1)
            case "load" if self.place == 0:
                self.loaded = 1
        arrived = self.place == self.length - 1 and self.loaded == 1
        return self._observation(), float(arrived), arrived, False, {}

    def render(self) -> np.ndarray:
        """Draw the boat on the water, a pixel for each place; small pictures are enlarged."""
        picture = np.full((self.length, self.length, 3), SKY, dtype=np.uint8)
        sea = self.length // 2
        picture[sea + 1 :] = WATER
        picture[sea, -1] = HARBOUR
        picture[sea, self.place] = BOAT
        picture[sea - 1, self.place if self.loaded else 0] = CARGO
        return picture

    def describe(self, state: State) -> str:
        """Say what the picture shows, for people who hear it."""
        place, loaded = state
        cargo = "on board" if loaded else "on square 1"
        return f"The boat is on square {place + 1} of {self.length}; the cargo is {cargo}."

    def _observation(self) -> np.ndarray:
        return np.array([self.place, self.loaded])


def turns(task: ExplanationTask) -> list[int]:
    """Show each step at which the agent does something else than just before."""
    actions = task.path.actions
    return [step for step in range(2, len(actions) + 1) if actions[step - 1] != actions[step - 2]]
