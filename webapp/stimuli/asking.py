"""What the agent says about a route that somebody asks about (Sakai et al. 2021, section 4.3)."""

from collections.abc import Sequence
from dataclasses import dataclass

from webapp.stimuli.world_table import WorldTable


@dataclass(frozen=True, slots=True)
class Answer:
    """A route beside the agent's own way from the same state. Steps are those of the agent's way, from 1.

    Attributes:
        reaches_goal: Whether the route does.
        num_actions: How many actions of the route were taken; those after the end of the episode were not.
        num_agent_actions: How many the agent takes.
        subgoals: Those that lie ahead, ascending.
        passed: Those of them that are on the route.
        key_points: Those of them that the route lacks (equation 4); none if it reaches the goal.
    """

    reaches_goal: bool
    num_actions: int
    num_agent_actions: int
    subgoals: tuple[int, ...]
    passed: tuple[int, ...]
    key_points: tuple[int, ...]

    @property
    def explanation(self) -> int | None:
        """The earliest key point, which is the explanation (equation 5), or None where there is none."""
        return self.key_points[0] if self.key_points else None

    @property
    def shown(self) -> tuple[int, ...]:
        """The steps to show: what is missing, or where nothing is, every subgoal ahead."""
        return self.key_points or self.subgoals


def answer(world: WorldTable, route: Sequence[str], from_step: int = 1) -> Answer:
    """Answer a question about a route.

    Args:
        world: The world, and what the agent does in it.
        route: Names of actions.
        from_step: The step of the agent's way from whose state the route is taken, from 1 to T.

    Raises:
        ValueError: There is no such step or action.
    """
    visited = world.roll_out(world.state_of_step(from_step), route)
    return Answer(
        reaches_goal=world.is_goal(visited[-1]),
        num_actions=len(visited) - 1,
        num_agent_actions=world.num_steps - from_step + 1,
        subgoals=tuple(step for step in world.subgoals if step >= from_step),
        passed=world.subgoals_passed(from_step, route),
        key_points=world.key_points(from_step, route),
    )
