"""The same path explained at another granularity (Sakai et al. 2021, section 7.2).

The method runs unchanged on a coarse world. What stands here is the way there and back: the coarse path that a path
amounts to, the steps that each coarse step covers, and a question asked about the one as a question about the other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

from webapp.explainer.abstraction import CoarseWorld, coarsen, sound_refinement
from webapp.explainer.explanation import Explanation, explain
from webapp.explainer.importance import ImportanceKind, exact_importance
from webapp.explainer.mdp import Policy
from webapp.explainer.solvers import NeverArrives, Trajectory, check_step, plan
from webapp.explainer.stochastic import World
from webapp.explainer.subgoals import ThresholdRule
from webapp.explainer.worlds.key_door_abstractions import SHIPPED, CoarseGranularity
from webapp.explainer.worlds.layout import Layout

Granularity = Literal["steps", "events", "rooms"]
GRANULARITIES: tuple[Granularity, ...] = get_args(Granularity)
"""From fine to coarse."""

RANDOM_STEPS = 1
"""The default r of coarse worlds: one coarse action already takes several steps (docs/decisions/0010)."""


@dataclass(frozen=True, slots=True)
class CoarsePath:
    """What a path of a world amounts to in a coarse one.

    Attributes:
        path: `[T' + 1]` coarse states, none of them twice, and the coarse actions between them.
        spans: `[T']`: the first and the last step, from 1, of the path that each coarse step covers. One begins where
            the other ends.

    Raises:
        ValueError: The spans do not join, or there are not as many as coarse steps.
    """

    path: Trajectory
    spans: tuple[tuple[int, int], ...]

    def __post_init__(self) -> None:
        if len(self.spans) != self.path.num_steps:
            raise ValueError(f"{self.path.num_steps} coarse steps cover as many spans, not {len(self.spans)}")
        begins = 1
        for first, last in self.spans:
            if first != begins or last < first:
                raise ValueError(
                    f"a span must begin at step {begins}, where the one before it ends, not {first}-{last}"
                )
            begins = last + 1

    def step_covering(self, step: int) -> int:
        """Return the coarse step, from 1, during which a step happens.

        Raises:
            ValueError: There is no such step.
        """
        for number, (first, last) in enumerate(self.spans, start=1):
            if first <= step <= last:
                return number
        num_steps = self.spans[-1][1] if self.spans else 0
        raise ValueError(f"there is no step {step}; the path has steps 1 to {num_steps}")


def coarse_world(world: World, layout: Layout, granularity: CoarseGranularity) -> CoarseWorld:
    """Return a key-door world at one of the shipped granularities, blocks split where that is needed to be sound.

    Raises:
        TypeError: The world's labels are not those of a key-door world.
    """
    return coarsen(world, sound_refinement(world, SHIPPED[granularity](layout)))


def coarse_path(coarse: CoarseWorld, path: Trajectory) -> CoarsePath:
    """Return the coarse path that a path takes.

    A path that leaves a block and comes back to it has made a detour of which, at this granularity, nothing came: the
    detour is left out, and its steps belong to the coarse step that leaves the block for good.

    Args:
        coarse: The coarse world.
        path: A path of the world beneath.

    Raises:
        ValueError: The path enters a state that cannot be reached, or goes from block to block in a way that no
            coarse action does, which only a stochastic world or a wrong path allows.
    """
    blocks = coarse.coarse_states(path.states)
    last = {block: position for position, block in enumerate(blocks)}
    states, actions, spans = [blocks[0]], [], []
    position, begins = last[blocks[0]], 1
    while position < path.num_steps:
        after = blocks[position + 1]
        actions.append(_action(coarse, states[-1], after))
        states.append(after)
        spans.append((begins, position + 1))
        begins, position = position + 2, last[after]
    if spans:
        spans[-1] = (spans[-1][0], path.num_steps)
    return CoarsePath(Trajectory(tuple(states), tuple(actions)), tuple(spans))


def coarse_policy(coarse: CoarseWorld, path: Trajectory) -> Policy:
    """Return the policy that takes a coarse path, and a shortest way to it or to the goal from anywhere else.

    The path that is explained need not be the coarse planner's own: what takes few steps may take many events.

    Args:
        coarse: The coarse world.
        path: A path of it that visits no state twice.
    """
    policy = plan(coarse.mdp)
    for state, action in path.pairs:
        policy[state] = action
    return policy


def coarse_route(coarse: CoarseWorld, route: Trajectory) -> tuple[int, ...]:
    """Return the coarse actions that a questioner's route amounts to, detours included.

    Raises:
        ValueError: As in `coarse_path`.
    """
    blocks = coarse.coarse_states(route.states)
    moves = [(before, after) for before, after in pairwise(blocks) if before != after]
    return tuple(_action(coarse, before, after) for before, after in moves)


def explain_coarsely(  # noqa: PLR0913 - what an explanation takes, and the coarse world.
    coarse: CoarseWorld,
    path: Trajectory,
    kind: ImportanceKind = "return_probability",
    random_steps: int = RANDOM_STEPS,
    route: Trajectory | None = None,
    from_step: int = 1,
    *,
    discount: float = 0.99,
    rule: ThresholdRule = "mean",
    num_subgoals: int | None = None,
) -> tuple[CoarsePath, Explanation]:
    r"""Explain a path of a world in a coarser one, by the method as it is.

    Args:
        coarse: The coarse world.
        path: A path from the start to a goal in the world beneath.
        kind: The definition of importance.
        random_steps: r, in coarse actions.
        route: The questioner's route, rolled out in the world beneath from the state of `from_step`.
        from_step: The step of `path` at which they ask, from 1.
        discount: Of `reward_importance`, per coarse action.
        rule: How the threshold is found.
        num_subgoals: k of the rule that needs it.

    Returns:
        The coarse path with the steps it covers, and its explanation, whose steps are coarse ones.

    Raises:
        NeverArrives: The path does not end in a goal.
        ValueError: The path does not begin at the start, there is no such step, the question is asked on a detour or in
            another state than the route begins in, or as in `coarse_path`.

    Example:
        >>> from webapp.explainer import (
        ...     by_components, coarsen, explain_coarsely, follow, parse_layout, plan_world, tabulate)
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> coarse = coarsen(world, by_components(["x", "has_key"]))
        >>> found, explanation = explain_coarsely(coarse, path)
        >>> [(coarse.mdp.actions[action], span) for action, span in zip(found.path.actions, found.spans)]
        [('has_key 1', (1, 1)), ('x 3', (2, 4)), ('x 4', (5, 6)), ('x 5', (7, 7))]
        >>> explanation.subgoals
        (4,)
    """
    check_step(path, from_step)
    found = coarse_path(coarse, path)
    if found.path.states[0] != coarse.mdp.start:
        begins, start = (coarse.mdp.states[state] for state in (found.path.states[0], coarse.mdp.start))
        raise ValueError(f"the path must begin where the episode does, in {start!s}, not in {begins!s}")
    if not coarse.mdp.goal[found.path.states[-1]]:
        raise NeverArrives(f"the path must end in a goal, not in {coarse.mdp.states[found.path.states[-1]]!s}")
    policy = coarse_policy(coarse, found.path)
    asked = None if route is None else _asked(coarse, path, route, from_step, found)
    step = found.step_covering(from_step)
    assess = lambda trajectory: exact_importance(kind, coarse.mdp, policy, trajectory, random_steps, discount)
    explanation = explain(coarse.mdp, policy, assess, asked, step, rule=rule, num_subgoals=num_subgoals)
    return found, explanation


def as_json(coarse: CoarseWorld, found: CoarsePath, explanation: Explanation) -> Mapping[str, object]:
    """Return a coarse explanation as the object that other programs read, made of lists, numbers and text only.

    A state is its coarse label as text. `steps` are the first and the last step of the fine path that a step covers.
    """

    def pair(step: int) -> Mapping[str, object]:
        state, action = found.path.pairs[step - 1]
        steps = list(found.spans[step - 1])
        return {
            "step": step,
            "steps": steps,
            "state": str(coarse.mdp.states[state]),
            "action": coarse.mdp.actions[action],
        }

    first = explanation.explanation_step
    return {
        "granularity": coarse.abstraction.name,
        "states": [str(coarse.mdp.states[state]) for state in found.path.states],
        "actions": [coarse.mdp.actions[action] for action in found.path.actions],
        "steps": [list(span) for span in found.spans],
        "importance": explanation.importance.values.tolist(),
        "standard_error": None,
        "threshold": explanation.threshold,
        "subgoals": [pair(step) for step in explanation.subgoals],
        "key_points": [pair(step) for step in explanation.key_points],
        "explanation": None if first is None else pair(first),
    }


def _asked(
    coarse: CoarseWorld, path: Trajectory, route: Trajectory, from_step: int, found: CoarsePath
) -> Sequence[int]:
    if route.states[0] != path.states[from_step - 1]:
        raise ValueError(f"the route must begin in the state of step {from_step}, not in state {route.states[0]}")
    (block,) = coarse.coarse_states(route.states[:1])
    step = found.step_covering(from_step)
    if found.path.states[step - 1] != block:
        first = found.spans[step - 1][0]
        raise ValueError(
            f"step {from_step} lies on a detour that {coarse.abstraction.name} leave out; ask at step {first} instead"
        )
    return coarse_route(coarse, route)


def _action(coarse: CoarseWorld, before: int, after: int) -> int:
    for action, leads_to in enumerate(coarse.mdp.next_state[before].tolist()):
        if leads_to == after:
            return action
    names = coarse.mdp.states
    raise ValueError(f"no coarse action leads from {names[before]!s} to {names[after]!s}, as the path does")
