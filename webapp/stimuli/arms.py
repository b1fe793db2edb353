"""The steps that the comparison arms show: as many pictures as the subgoals of the same situation, chosen otherwise."""

from typing import Literal

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.selectors import evenly_spaced_steps, highlights_steps, landmark_states, q_gaps
from webapp.explainer.selectors.highlights import MIN_GAP
from webapp.explainer.solvers import Trajectory
from webapp.stimuli.agents import BuildError

ArmKind = Literal["highlights", "landmarks", "evenly_spaced"]
"""HIGHLIGHTS (Amir & Amir 2018), landmarks (Hoffmann et al. 2004), key frames at a fixed rate; see `selectors`."""


def arm_steps(
    kind: ArmKind, layout: str, world: DeterministicMDP, policy: Policy, path: Trajectory, subgoals: tuple[int, ...]
) -> tuple[int, ...]:
    """Choose the steps of a comparison arm for the budget that the subgoals set.

    A pair that ends in the target shows as one picture instead of two. So where the last step is a subgoal every arm
    shows it too, and chooses the others among the steps before it; where it is none, no arm may choose it. Then all
    have equally many pictures.

    Args:
        kind: The arm.
        layout: What to call the layout in messages.
        world: The world.
        policy: `[S]`.
        path: What is left of the policy's path from the current state on.
        subgoals: The subgoals among its steps, counted from 1; no two of them are neighbours.

    Returns:
        As many steps of `path` as there are subgoals, from 1, ascending.

    Raises:
        BuildError: The method has not so many steps to choose from.
    """
    last = tuple(step for step in subgoals if step == path.num_steps)
    budget = len(subgoals) - len(last)
    if budget == 0:
        return last
    match kind:
        case "highlights":
            steps = _highlights(world, policy, path, budget, shows_last=bool(last))
        case "landmarks":
            steps = _landmarks(world, path, budget)
        case "evenly_spaced":
            steps = evenly_spaced_steps(path.num_steps - 1, budget)
    if len(steps) < budget:
        raise BuildError(
            f"layout {layout!r}: the kind {kind!r} has {len(steps)} steps to show before the last, and needs {budget} "
            "for as many pictures as the subgoals have; leave the kind out, or change the map"
        )
    return (*steps, *last)


def _highlights(
    world: DeterministicMDP, policy: Policy, path: Trajectory, budget: int, *, shows_last: bool
) -> tuple[int, ...]:
    """Take the steps with the largest Q gaps; they keep their distance from the last step too, if that is shown.

    Since no two subgoals are neighbours there are always steps enough. Of the context that HIGHLIGHTS shows with each
    state only the next state is left, because a pair of any arm has two pictures.
    """
    left_out = MIN_GAP if shows_last else 1
    before = Trajectory(path.states[:-left_out], path.actions[:-left_out])
    return highlights_steps(q_gaps(world, policy), before, budget)


def _landmarks(world: DeterministicMDP, path: Trajectory, budget: int) -> tuple[int, ...]:
    """Take landmarks evenly spaced in their order; the current state, everybody's landmark, is shown anyhow.

    What is no landmark would only fill the budget, and is not taken.
    """
    steps = [step for step in landmark_states(world, path)[1:] if step < path.num_steps]
    return tuple(steps[place - 1] for place in evenly_spaced_steps(len(steps), min(budget, len(steps))))
