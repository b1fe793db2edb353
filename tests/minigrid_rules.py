"""MiniGrid's rules once more, on plain values: what its documentation says of walls, doors, one key, lava and the goal.

Knows nothing of the adapter. It reads a fresh environment's furniture once and then plays alone.
"""

from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

Cell = tuple[int, int]
AHEAD = ((1, 0), (0, 1), (-1, 0), (0, -1))


class Situation(NamedTuple):
    """All that changes: the agent, the key (None: in its hand, or there is none) and each door."""

    place: Cell
    heading: int
    carrying: bool
    key: Cell | None
    doors: tuple[tuple[Cell, str], ...]


@dataclass
class Rules:
    """The furniture that stays, read from an environment that was just reset."""

    env: Any
    opening_wins: bool = False

    def __post_init__(self) -> None:
        grid = self.env.grid
        self.kinds = {(x, y): grid.get(x, y) for x in range(grid.width) for y in range(grid.height)}
        of = {
            kind: {cell for cell, thing in self.kinds.items() if thing is not None and thing.type == kind}
            for kind in ("wall", "goal", "lava")
        }
        self.walls, self.goals, self.lava = of["wall"], of["goal"], of["lava"]
        self.start = situation_of(self.env)

    def act(self, now: Situation, action: str) -> tuple[Situation, bool, bool]:
        """Return what follows, whether the episode has ended, and whether in success."""
        (x, y), (dx, dy) = now.place, AHEAD[now.heading]
        ahead, doors = (x + dx, y + dy), dict(now.doors)
        if action in ("left", "right"):
            turn = 1 if action == "right" else -1
            return now._replace(heading=(now.heading + turn) % 4), False, False
        solid = ahead in self.walls or ahead == now.key or doors.get(ahead, "open") != "open"
        if action == "forward" and not solid:
            return now._replace(place=ahead), ahead in self.goals | self.lava, ahead in self.goals
        if action == "pickup" and ahead == now.key and not now.carrying:
            return now._replace(carrying=True, key=None), False, False
        empty = not solid and ahead not in doors and ahead not in self.goals | self.lava
        if action == "drop" and now.carrying and empty:
            return now._replace(carrying=False, key=ahead), False, False
        if action == "toggle" and ahead in doors and (doors[ahead] != "locked" or now.carrying):
            doors[ahead] = "closed" if doors[ahead] == "open" else "open"
            won = self.opening_wins and doors[ahead] == "open"
            return now._replace(doors=tuple(sorted(doors.items()))), won, won
        return now, False, False

    def explore(self, actions: tuple[str, ...]) -> tuple[dict[Situation, int], set[Situation], set[Situation]]:
        """Return the number of steps to everything in reach, what of it has ended, and what of that is success."""
        depth, ended, won = {self.start: 0}, set(), set()
        queue = deque([self.start])
        while queue:
            now = queue.popleft()
            for action in actions:
                after, over, success = self.act(now, action)
                if after not in depth:
                    depth[after] = depth[now] + 1
                    if not over:
                        queue.append(after)
                if over:
                    ended.add(after)
                if success:
                    won.add(after)
        return depth, ended, won


def door_word(door: Any) -> str:  # noqa: ANN401 - MiniGrid's classes are not needed here.
    """Say how a door of MiniGrid's stands."""
    return "open" if door.is_open else "locked" if door.is_locked else "closed"


def situation_of(env: Any) -> Situation:  # noqa: ANN401 - as above.
    """Read all that changes from an environment."""
    grid = env.grid
    cells = {(x, y): grid.get(x, y) for x in range(grid.width) for y in range(grid.height)}
    things = {cell: thing for cell, thing in cells.items() if thing is not None}
    keys = [cell for cell, thing in things.items() if thing.type == "key"]
    doors = [(cell, door_word(thing)) for cell, thing in things.items() if thing.type == "door"]
    carrying = env.carrying is not None
    x, y = map(int, env.agent_pos)
    return Situation((x, y), int(env.agent_dir), carrying, keys[0] if keys else None, tuple(sorted(doors)))
