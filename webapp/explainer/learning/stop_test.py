"""When training may stop: both losses have flattened, and both networks are right wherever the agent can get.

The world's table serves this test and nothing else in training.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.learning.agent import AgentNetworks
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import distances_to_goal, steps_to_goal


@dataclass(frozen=True, slots=True)
class Verdict:
    """How far two networks are from being right.

    Attributes:
        is_optimal: Whether the greedy policy takes a shortest path from the start.
        num_lost: Reachable states from which the greedy policy never reaches the goal.
        num_states: Reachable states that do not end the episode.
        num_wrong: Reachable pairs of such a state and an action on which the world model is wrong in its most
            probable next state or in whether the episode ends.
        num_pairs: How many such pairs there are.
    """

    is_optimal: bool
    num_lost: int
    num_states: int
    num_wrong: int
    num_pairs: int

    @property
    def is_right(self) -> bool:
        """Whether both networks are right."""
        return self.is_optimal and not self.num_lost and not self.num_wrong

    @property
    def missing(self) -> tuple[str, ...]:
        """What is not right, in words."""
        optimal = "the policy is not optimal from the start"
        lost = f"the policy does not reach the goal from {self.num_lost} of {self.num_states} states"
        wrong = f"the world model is wrong on {self.num_wrong} of {self.num_pairs} state-action pairs"
        problems = ((not self.is_optimal, optimal), (self.num_lost > 0, lost), (self.num_wrong > 0, wrong))
        return tuple(words for applies, words in problems if applies)


def judge(networks: AgentNetworks, table: DeterministicMDP) -> Verdict:
    """Compare both networks with the world's table, on every reachable state that does not end the episode."""
    live = np.flatnonzero(~table.terminal)
    policy = networks.policy(table)
    steps = steps_to_goal(table, policy)
    arrives = np.isfinite(steps)
    is_shortest = bool(arrives[table.start]) and steps[table.start] == distances_to_goal(table)[table.start]
    return Verdict(
        is_optimal=bool(is_shortest),
        num_lost=int((~arrives[live]).sum()),
        num_states=len(live),
        num_wrong=int(_is_wrong(networks, table, live).sum()),
        num_pairs=len(live) * table.num_actions,
    )


def has_flattened(losses: NDArray[np.float64], window: int, max_relative_change: float) -> bool:
    """Compare the means of the last two windows of a loss `[iterations so far]`; False while there are not two."""
    if len(losses) < 2 * window:
        return False
    before, now = losses[-2 * window : -window].mean(), losses[-window:].mean()
    return bool(abs(now - before) < max_relative_change * before)


def _is_wrong(networks: AgentNetworks, table: DeterministicMDP, live: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return `[live states * actions]`: where the world model differs from the table."""
    labels = np.array(table.states, dtype=np.int64)
    actions = np.tile(np.arange(table.num_actions), len(live))
    predicted, predicted_end = networks.predict(np.repeat(labels[live], table.num_actions, axis=0), actions)
    after = table.next_state[live].ravel()
    wrong: NDArray[np.bool_] = (predicted != labels[after]).any(axis=1) | (predicted_end != table.terminal[after])
    return wrong
