"""What sub-rewards do to a world, exactly: when they can be earned again, and whether the shortest path stays optimal.

Sakai et al. 2021, sections 5.2 and 5.3. A sub-reward is no potential-based shaping, so it can make it better to walk
in a circle than to arrive.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, StateAction
from webapp.explainer.solvers import distances_to_goal
from webapp.simulations.tasks import Task

FALL = 0.9
"""How much of a reward is lost by the last action of an episode: MiniGrid's."""


def steps_until_again(mdp: DeterministicMDP, pair: StateAction) -> float:
    """Count the actions from after a pair was executed until it has been executed again, at the earliest.

    Returns:
        At least 1; infinite if it cannot be executed again, as when it takes the key.
    """
    state, action = pair
    distance = {int(mdp.next_state[state, action]): 0}
    frontier = list(distance)
    while frontier and state not in distance:
        going = [here for here in frontier if not mdp.terminal[here]]
        found = [(int(after), distance[here] + 1) for here in going for after in mdp.next_state[here]]
        frontier = []
        for after, steps in found:
            if after not in distance:
                distance[after] = steps
                frontier.append(after)
    return distance[state] + 1 if state in distance and not mdp.terminal[state] else float("inf")


def pays_to_go_on(task: Task, step: int, next_step: int, sub_reward: float) -> bool:
    """Say whether the next subgoal's reward is higher than what coming back to this one pays.

    The first of the paper's two requirements on an added subgoal (section 5.3): on the shortest path, the reward is
    higher when reaching the next subgoal than when reaching this one again after passing it once. Both rewards fall
    over time as the goal's does, so the later one is the smaller.

    Args:
        task: The map.
        step: Of the added subgoal.
        next_step: Of the next subgoal; T is the goal.
        sub_reward: The most that a sub-reward pays.
    """
    again = steps_until_again(task.mdp, task.path.pairs[step - 1])
    highest = 1.0 if next_step == task.path.num_steps else sub_reward
    onwards = highest * (1 - FALL * next_step / task.max_steps)
    back = 0.0 if np.isinf(again) else sub_reward * (1 - FALL * (step + again) / task.max_steps)
    return onwards > back


def add_subgoal(task: Task, steps: Sequence[int], sub_reward: float) -> int | None:
    """Choose the step that is added to some subgoals by the paper's two requirements (section 5.3).

    It divides the largest distance between neighbours into two, as evenly as the first requirement allows. The path's
    start and the goal are neighbours, too. Of distances of one size the earliest is divided, of two middles the
    earlier taken: the paper leaves both open.

    Args:
        task: The map.
        steps: The subgoals so far, without the goal's step.
        sub_reward: The most that a sub-reward pays.

    Returns:
        The step, or None if none in the largest distance meets the first requirement.
    """
    places = [0, *sorted(steps), task.path.num_steps]
    before, after = max(pairwise(places), key=lambda ends: ends[1] - ends[0])
    by_evenness = sorted(range(before + 1, after), key=lambda step: (abs(2 * step - before - after), step))
    return next((step for step in by_evenness if pays_to_go_on(task, step, after, sub_reward)), None)


def keeps_shortest_path(
    mdp: DeterministicMDP, pairs: Sequence[StateAction], sub_reward: float, discount: float, *, once: bool
) -> bool:
    """Say whether a shortest path from the start is still optimal when some pairs pay a sub-reward.

    Exact, by value iteration, but for the fall of rewards over time, which agents cannot observe: every reward counts
    in full.

    Args:
        mdp: The world.
        pairs: Those that pay.
        sub_reward: What each pays; the goal pays 1.
        discount: Per action, below 1.
        once: Whether a pair pays only the first time. What has been earned is then part of the state.
    """
    paid = np.zeros((mdp.num_states, mdp.num_actions), dtype=np.int64)
    for number, pair in enumerate(dict.fromkeys(pairs)):
        paid[pair] = 1 << number
    num_memories = 1 << len(set(pairs)) if once else 1
    values = _optimal_values(mdp, paid, num_memories, sub_reward, discount)
    best = values.max(axis=2, keepdims=True)
    optimal = values >= best - _SAME
    shorter = distances_to_goal(mdp)
    reached = {(0, mdp.start)}
    for _ in range(int(shorter[mdp.start])):
        reached = {
            (memory | int(paid[state, action]) if once else 0, int(mdp.next_state[state, action]))
            for memory, state in reached
            for action in range(mdp.num_actions)
            if optimal[memory, state, action] and shorter[mdp.next_state[state, action]] == shorter[state] - 1
        }
    return bool(reached)


def _optimal_values(
    mdp: DeterministicMDP, paid: NDArray[np.int64], num_memories: int, sub_reward: float, discount: float
) -> NDArray[np.float64]:
    """Return `[M, S, A]`: the optimal action values for each memory of what has been earned."""
    memories = np.arange(num_memories)[:, None, None]
    after_memory = memories | paid if num_memories > 1 else np.zeros((1, *paid.shape), dtype=np.int64)
    unpaid = (memories & paid) == 0
    arrives = mdp.goal[mdp.next_state] & ~mdp.terminal[:, None]
    rewards = arrives + sub_reward * ((paid > 0) & unpaid & ~mdp.terminal[:, None])
    goes_on = ~mdp.terminal[mdp.next_state]
    values = np.zeros((num_memories, mdp.num_states, mdp.num_actions))
    for _ in range(_MOST_SWEEPS):
        best = values.max(axis=2)
        new: NDArray[np.float64] = rewards + discount * best[after_memory, mdp.next_state] * goes_on
        if np.abs(new - values).max() <= _SETTLED * (1 - discount):
            return new
        values = new
    raise ArithmeticError(f"value iteration did not settle within {_MOST_SWEEPS} sweeps; use a smaller discount")


_MOST_SWEEPS = 100_000
_SETTLED = 1e-12
_SAME = 1e-9
"""Values closer than this are equal."""
