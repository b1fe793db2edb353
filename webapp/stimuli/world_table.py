"""The world of one layout as the web worker knows it: where each action leads, and what the agent does.

It is read from a bundle's `tables/<layout>.json` and answers in plain Python what the explainer answers with NumPy,
so that a worker can move a participant's agent and find the key points of their own route. The data keep actions by
their names, so here they go by their names too.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any


@dataclass(frozen=True, eq=False)
class WorldTable:
    """States `0 .. S - 1`, where each action leads from them, the agent's policy, its path and the path's subgoals.

    Attributes:
        layout: The layout's name.
        actions: `[A]` names; the tables below count actions in this order.
        start: The state in which an episode begins.
        next_states: `[S][A]` states; an action that cannot act leads back to its own state.
        terminal: The states in which an episode has ended.
        goals: Those of them that are the goal.
        policy: `[S]` action numbers.
        path_states: `[T + 1]` states of the agent's path, the goal last.
        path_actions: `[T]` names of the actions between them.
        subgoals: Steps of the path, from 1, ascending.

    Raises:
        ValueError: The parts do not fit together; the message names the first that does not.
    """

    layout: str
    actions: tuple[str, ...]
    start: int
    next_states: tuple[tuple[int, ...], ...]
    terminal: frozenset[int]
    goals: frozenset[int]
    policy: tuple[int, ...]
    path_states: tuple[int, ...]
    path_actions: tuple[str, ...]
    subgoals: tuple[int, ...]

    def __post_init__(self) -> None:
        if len(self.policy) != len(self.next_states):
            raise ValueError(f"a policy for {len(self.policy)} states does not fit {len(self.next_states)} of them")
        if self.path_states != self.roll_out(self.path_states[0], self.path_actions):
            raise ValueError(f"the actions of the path do not lead through its states {self.path_states}")
        if not self.is_goal(self.path_states[-1]):
            raise ValueError(f"the path must end in a goal, not in state {self.path_states[-1]}")
        ascending = all(earlier < later for earlier, later in pairwise((0, *self.subgoals, self.num_steps + 1)))
        if not ascending:
            raise ValueError(f"subgoals ascend from 1 to {self.num_steps}, and {self.subgoals} do not")

    @classmethod
    def from_content(cls, layout: str, content: Mapping[str, Any]) -> "WorldTable":
        """Take from the content of `tables/<layout>.json` what a worker needs; see `stimuli.tables`."""
        actions = tuple(content["actions"])
        return cls(
            layout=layout,
            actions=actions,
            start=content["start"],
            next_states=tuple(tuple(row) for row in content["next_state"]),
            terminal=_where(content["terminal"]),
            goals=_where(content["goal"]),
            policy=tuple(content["policy"]),
            path_states=tuple(content["path"]["states"]),
            path_actions=tuple(actions[action] for action in content["path"]["actions"]),
            subgoals=tuple(content["subgoals"]),
        )

    @property
    def num_states(self) -> int:
        """S."""
        return len(self.next_states)

    @property
    def num_steps(self) -> int:
        """T."""
        return len(self.path_actions)

    def next_state(self, state: int, action: str) -> int:
        """Return where an action leads; in a state in which the episode has ended, nowhere.

        Raises:
            ValueError: There is no such state or action.
        """
        self._check_state(state)
        if action not in self.actions:
            raise ValueError(f"there is no action {action!r}; the actions are {', '.join(self.actions)}")
        return self.next_states[state][self.actions.index(action)]

    def changes_nothing(self, state: int, action: str) -> bool:
        """Tell whether an action cannot act in a state.

        Raises:
            ValueError: There is no such state or action.
        """
        return self.next_state(state, action) == state

    def is_goal(self, state: int) -> bool:
        """Tell whether a state is the goal.

        Raises:
            ValueError: There is no such state.
        """
        self._check_state(state)
        return state in self.goals

    def is_terminal(self, state: int) -> bool:
        """Tell whether the episode has ended in a state.

        Raises:
            ValueError: There is no such state.
        """
        self._check_state(state)
        return state in self.terminal

    def policy_action(self, state: int) -> str:
        """Return what the agent does in a state.

        Raises:
            ValueError: There is no such state, or the episode has ended in it.
        """
        if self.is_terminal(state):
            raise ValueError(f"the episode has ended in state {state}; the agent does nothing there")
        return self.actions[self.policy[state]]

    def optimum(self, state: int) -> int | None:
        """Return the fewest actions that lead from a state to a goal, 0 in a goal, None where none is reached.

        Raises:
            ValueError: There is no such state.
        """
        self._check_state(state)
        return self._distances.get(state)

    def roll_out(self, state: int, actions: Sequence[str]) -> tuple[int, ...]:
        """Return the states that are visited from a state on, itself first, up to the end of the episode.

        Args:
            state: The first.
            actions: Those after the end of the episode are left out.

        Raises:
            ValueError: There is no such state or action.
        """
        self._check_state(state)
        visited = [state]
        for action in actions:
            after = self.next_state(visited[-1], action)
            if visited[-1] not in self.terminal:
                visited.append(after)
        return tuple(visited)

    def key_points(self, from_step: int, actions: Sequence[str]) -> tuple[int, ...]:
        """Return the subgoals that a route misses (Sakai et al. 2021, section 4.3, equation 4).

        Args:
            from_step: The step from whose state the route is taken, from 1 to T; subgoals before it lie behind.
            actions: The route.

        Returns:
            Steps, ascending; empty when the route reaches the goal.

        Raises:
            ValueError: There is no such step or action.
        """
        visited = self.roll_out(self.state_of_step(from_step), actions)
        if visited[-1] in self.goals:
            return ()
        passed = self._passed(visited, actions)
        return tuple(step for step in self._ahead(from_step) if step not in passed)

    def subgoals_passed(self, from_step: int, actions: Sequence[str]) -> tuple[int, ...]:
        """Return the subgoals whose state and action occur on a route, whether or not it reaches the goal.

        Args:
            from_step: The step from whose state the route is taken, from 1 to T; subgoals before it lie behind.
            actions: The route.

        Raises:
            ValueError: There is no such step or action.
        """
        passed = self._passed(self.roll_out(self.state_of_step(from_step), actions), actions)
        return tuple(step for step in self._ahead(from_step) if step in passed)

    def state_of_step(self, step: int) -> int:
        """Return the state of a step of the path.

        Raises:
            ValueError: The step is not from 1 to T.
        """
        if not 1 <= step <= self.num_steps:
            raise ValueError(f"there is no step {step}; the path has steps 1 to {self.num_steps}")
        return self.path_states[step - 1]

    def _ahead(self, from_step: int) -> tuple[int, ...]:
        return tuple(step for step in self.subgoals if step >= from_step)

    def _passed(self, visited: Sequence[int], actions: Sequence[str]) -> frozenset[int]:
        """Return the steps of the path whose state and action are among those of a route."""
        pairs = set(zip(visited[:-1], actions, strict=False))  # Actions after the end lead nowhere.
        own = zip(self.path_states, self.path_actions, strict=False)
        return frozenset(step for step, pair in enumerate(own, start=1) if pair in pairs)

    @cached_property
    def _distances(self) -> dict[int, int]:
        """The fewest actions from each state to a goal, for the states from which one is reached."""
        before: list[set[int]] = [set() for _ in range(self.num_states)]
        for state, row in enumerate(self.next_states):
            for after in row:
                before[after].add(state)
        distances = dict.fromkeys(self.goals, 0)
        queue = deque(self.goals)
        while queue:
            state = queue.popleft()
            for earlier in before[state] - distances.keys():
                distances[earlier] = distances[state] + 1
                queue.append(earlier)
        return distances

    def _check_state(self, state: int) -> None:
        if not 0 <= state < self.num_states:
            raise ValueError(f"there is no state {state}; there are {self.num_states}, from 0")


def _where(flags: Sequence[bool]) -> frozenset[int]:
    return frozenset(state for state, flag in enumerate(flags) if flag)
