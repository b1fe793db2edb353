"""What a web worker keeps of a bundle's `tables/<layout>.json`; pictures go by their numbers in the bundle's list."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from webapp.stimuli.world_table import WorldTable


@dataclass(frozen=True, slots=True)
class LayoutTable:
    """A layout's world, and how it is shown.

    Attributes:
        world: The world, and what the agent does in it.
        pictures: `[S]` the picture of each state.
        sentences: By language, each step of the path in words.
    """

    world: WorldTable
    pictures: tuple[int, ...]
    sentences: Mapping[str, tuple[str, ...]]

    def pairs(self, steps: Sequence[int], from_step: int) -> tuple[tuple[tuple[int, ...], tuple[str, ...]], ...]:
        """Return how steps of the path are shown (Sakai et al. 2021, section 6): the current state, then each pair.

        A pair is the state before and the state after; one that ends in the goal is shown as the goal alone.

        Args:
            steps: From `from_step` to T, ascending.
            from_step: The step of the current state, from 1 to T.

        Returns:
            The pictures, and the names of the actions between them.

        Raises:
            ValueError: There is no such step, or the steps do not ascend.
        """
        world = self.world
        current = world.state_of_step(from_step)
        if not all(earlier < later for earlier, later in pairwise((from_step - 1, *steps, world.num_steps + 1))):
            raise ValueError(f"steps ascend from {from_step} to {world.num_steps}, and {tuple(steps)} do not")
        return (((self.pictures[current],), ()), *(self._pair(step) for step in steps))

    def _pair(self, step: int) -> tuple[tuple[int, ...], tuple[str, ...]]:
        before, after = (self.pictures[state] for state in self.world.path_states[step - 1 : step + 1])
        if step == self.world.num_steps:
            return (after,), ()
        return (before, after), (self.world.path_actions[step - 1],)


def parse_layout_table(text: bytes, layout: str) -> LayoutTable:
    """Read a layout's table from the bytes of its file."""
    content = json.loads(text)
    sentences = {language: tuple(steps) for language, steps in content["sentences"].items()}
    return LayoutTable(WorldTable.from_content(layout, content), tuple(content["pictures"]), sentences)
