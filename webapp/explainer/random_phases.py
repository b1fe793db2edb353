"""The random phase (Sakai et al. 2021, section 4.2.1), from many states at once and exactly.

Within `r` actions one gets only so far. In a large world the work is done in the ball of states that can be reached
from a few neighbouring states of the path, a block of it after the other, so that time and memory grow with the path
and not with the world.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.random_step import Indices, Mass, RandomStep, check_num_steps

_SMALL_WORLD = 1024
"""Up to this many states a world is not worth cutting balls out of."""
_BLOCK = 32
"""So many states of a path share one ball: neighbours, whose balls overlap."""


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """The states that random actions can reach from `N` starts, and the table of a random action among them.

    Attributes:
        first: Which of all starts the first of these is.
        states: `[B]` state indices of the world, ascending.
        starts: `[N]`: the place in `states` of each start.
        next_state: `[B, A]`: the place in `states` that follows; B outside of the ball.
        selectable: `[B, A]`: the actions a random step chooses from.
        step: One random action.
    """

    first: int
    states: Indices
    starts: Indices
    next_state: Indices
    selectable: NDArray[np.bool_]
    step: RandomStep

    @property
    def columns(self) -> NDArray[np.int32]:
        """`[N]`: which of all starts these are."""
        return np.arange(self.first, self.first + len(self.starts), dtype=np.int32)

    def random_phase(self, num_steps: int, forbidden: NDArray[np.bool_] | None = None) -> Mass:
        """Return where random actions lead from each start.

        Args:
            num_steps: r, at most the radius of the ball.
            forbidden: `[N, A]`: for each start the actions that are not selectable there (`do(allow = 0)`), if any.

        Returns:
            `[B, N]`: in each column the probability of each state after the last action.
        """
        change = None if forbidden is None or not num_steps else self._change(forbidden)
        return self.step.push(self.starts, num_steps, change)

    def _change(self, forbidden: NDArray[np.bool_]) -> Mass:
        """`[B, N]`: the outcome of a random step from each start with some actions forbidden, minus that without."""
        allowed = self.selectable[self.starts]
        targets = np.where(allowed, self.next_state[self.starts], self.starts[:, None])
        change = np.zeros((len(self.states), len(self.starts)))
        columns = np.arange(len(self.starts))
        for chosen, sign in ((allowed & ~forbidden, 1.0), (allowed, -1.0)):
            count = chosen.sum(axis=1)
            change[self.starts, columns] += np.where(count == 0, sign, 0.0)
            share = np.where(chosen, sign / np.maximum(count, 1)[:, None], 0.0)
            for action in range(targets.shape[1]):
                change[targets[:, action], columns] += share[:, action]
        return change


def balls(mdp: DeterministicMDP, starts: Sequence[int], radius: int) -> Iterator[Ball]:
    """Cover what random actions can reach from some states, block by block.

    Args:
        mdp: The world.
        starts: State indices; neighbours in the world should be neighbours in the list.
        radius: How many random actions.

    Raises:
        ValueError: The number of actions is negative.
    """
    check_num_steps(radius)
    if not starts:
        return
    if mdp.num_states <= _SMALL_WORLD:
        whole = np.arange(mdp.num_states)
        yield Ball(0, whole, np.array(starts, dtype=np.int64), mdp.next_state, mdp.selectable, mdp.random_step)
        return
    place = np.full(mdp.num_states, -1, dtype=np.int64)
    for first in range(0, len(starts), _BLOCK):
        block = np.array(starts[first : first + _BLOCK], dtype=np.int64)
        states = _within(mdp, block, radius, place)
        place[states] = np.arange(len(states))
        inside = place[mdp.next_state[states]]
        next_state = np.where(inside < 0, len(states), inside)
        selectable = mdp.selectable[states]
        yield Ball(first, states, place[block], next_state, selectable, RandomStep.of(next_state, selectable))
        place[states] = -1


def _within(mdp: DeterministicMDP, starts: Indices, radius: int, place: Indices) -> Indices:
    """Return the states within some random actions of the starts, ascending; `place`, all -1, is left as it was."""
    frontier = np.unique(starts)
    found = [frontier]
    place[frontier] = 0
    for _ in range(radius):
        after = mdp.next_state[frontier][mdp.selectable[frontier]]
        new = after[place[after] < 0]
        # Whoever is named more than once is claimed by one of its namings. That is faster than sorting them.
        place[new] = np.arange(len(new))
        frontier = new[place[new] == np.arange(len(new))]
        found.append(frontier)
    states = np.sort(np.concatenate(found))
    place[states] = -1
    return states
