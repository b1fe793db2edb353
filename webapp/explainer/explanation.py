"""From a world and a policy to an explanation, and the panels in which each kind of explanation is shown."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, cast

from webapp.explainer.importance import Importance
from webapp.explainer.key_points import key_point_steps
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import Trajectory, check_step, follow
from webapp.explainer.stochastic import AnyPolicy, World
from webapp.explainer.subgoals import ThresholdRule, importance_threshold, subgoal_steps

Assess = Callable[[Trajectory], Importance]
"""A way of finding the importance of a path's states, such as an exact solver with all but the path filled in."""

ExplanationKind = Literal["full", "subgoals", "random", "all_key_points", "first_key_point"]
EXPLANATION_KINDS: tuple[ExplanationKind, ...] = ("full", "subgoals", "random", "all_key_points", "first_key_point")


@dataclass(frozen=True, slots=True)
class Explanation:
    r"""What is known about a path, and what of it answers a question.

    Attributes:
        path: The agent's path to the goal.
        importance: Of each of the path's states.
        subgoals: Steps from 1, ascending, computed from the episode's start.
        route: The questioner's action indices, or None when nobody has asked.
        from_step: The step at which the question is asked.
        key_points: The subgoals that the route misses; empty when nobody has asked.
        rule: How the threshold was found.
        num_subgoals: k of the rule that needs it, else None.

    Example:
        >>> from webapp.explainer import exact_importance, explain, follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> assess = lambda path: exact_importance("return_probability", world, policy, path, 2)
        >>> route = [world.actions.index(name) for name in ("left", "left", "forward")]
        >>> found = explain(world, policy, assess, route)
        >>> found.subgoals, found.key_points, found.explanation_step, round(found.threshold, 3)
        ((1, 7), (1, 7), 1, 0.24)
    """

    path: Trajectory
    importance: Importance
    subgoals: tuple[int, ...]
    route: tuple[int, ...] | None
    from_step: int
    key_points: tuple[int, ...]
    rule: ThresholdRule = "mean"
    num_subgoals: int | None = None

    @property
    def threshold(self) -> float:
        """The level that separates subgoals from the rest; the paper's is the mean, the target's 0 included."""
        return importance_threshold(self.importance.values, self.rule, self.num_subgoals)

    @property
    def explanation_step(self) -> int | None:
        """The earliest key point, which is the explanation (equation 5), or None when there is none."""
        return self.key_points[0] if self.key_points else None


def explain(
    world: World,
    policy: AnyPolicy,
    assess: Assess,
    route: Sequence[int] | None = None,
    from_step: int = 1,
    *,
    path: Trajectory | None = None,
    rule: ThresholdRule = "mean",
    num_subgoals: int | None = None,
) -> Explanation:
    r"""Explain a policy's way from the world's start to the goal.

    Args:
        world: The world. A route is rolled out in it, each action with its most probable outcome.
        policy: `[S]` actions or `[S, A]` probabilities.
        assess: Computes the importance of the path's states.
        route: The questioner's action indices from the state of `from_step`, if somebody asks.
        from_step: The step at which they ask, from 1 to T.
        path: The way that is explained. Where nothing is left to chance it may be left out: the policy has only one.
        rule: How the threshold is found; the paper's is the mean.
        num_subgoals: k of the rule that needs it.

    Raises:
        NeverArrives: The policy does not lead to the goal.
        ValueError: There is no such step or action, or the path was left out although there is more than one.

    Example:
        >>> from webapp.explainer import exact_importance, explain, follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> assess = lambda path: exact_importance("return_probability", world, policy, path, 2)
        >>> explain(world, policy, assess).subgoals
        (1, 7)
    """
    if path is None:
        if not isinstance(world, DeterministicMDP) or policy.ndim != 1:
            raise ValueError("where chance has a say, name the path that is to be explained")
        path = follow(world, cast("Policy", policy))
    check_step(path, from_step)
    importance = assess(path)
    subgoals = subgoal_steps(importance.values, rule, num_subgoals)
    asked = None if route is None else tuple(route)
    key_points = () if asked is None else key_point_steps(certain(world), path, subgoals, asked, from_step)
    return Explanation(path, importance, subgoals, asked, from_step, key_points, rule, num_subgoals)


def certain(world: World) -> DeterministicMDP:
    """Return the world in which each action has its most probable outcome: the one that routes are rolled out in."""
    if isinstance(world, DeterministicMDP):
        return world
    from webapp.explainer.stochastic_planning import most_probable  # noqa: PLC0415 - loads SciPy.

    return most_probable(world)


@dataclass(frozen=True, slots=True)
class Strip:
    """Pictures in a row with the action named between each two.

    Attributes:
        states: State indices, one per picture.
        actions: Action indices, one fewer.

    Raises:
        ValueError: There is not exactly one picture more than there are actions.
    """

    states: tuple[int, ...]
    actions: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if len(self.states) != len(self.actions) + 1:
            raise ValueError(
                f"{len(self.actions)} actions stand between {len(self.actions) + 1} pictures, not {len(self.states)}"
            )


def kind_strips(
    kind: ExplanationKind, path: Trajectory, steps: Sequence[int] = (), from_step: int = 1
) -> tuple[Strip, ...]:
    """Lay out one kind of explanation (Sakai et al. 2021, section 6, made precise).

    Every kind begins with the current state. The full sequence is one strip with each state once. The other kinds
    show the current state, then each pair as the state before and after its action; a pair that ends in the target,
    last of all, shows as one picture of the target.

    Args:
        kind: `first_key_point` shows only the first of the steps.
        path: The agent's path to the goal.
        steps: The steps to show, from `from_step` to T, ascending; the full sequence takes none.
        from_step: The step of the current state, from 1 to T.

    Raises:
        ValueError: There is no such step, the steps do not ascend, or the full sequence was given some.
    """
    remaining = path.from_step(from_step)
    if kind == "full":
        if steps:
            raise ValueError(f"the full sequence shows every step; it takes no choice of steps such as {tuple(steps)}")
        return (Strip(remaining.states, remaining.actions),)
    _check_ascending(path, steps, from_step)
    shown = steps[:1] if kind == "first_key_point" else steps
    return (Strip(remaining.states[:1]), *(_pair(path, step) for step in shown))


def _pair(path: Trajectory, step: int) -> Strip:
    before, after = path.states[step - 1 : step + 1]
    return Strip((after,)) if step == path.num_steps else Strip((before, after), (path.actions[step - 1],))


def _check_ascending(path: Trajectory, steps: Sequence[int], from_step: int) -> None:
    earliest = from_step
    for step in steps:
        if not earliest <= step <= path.num_steps:
            raise ValueError(
                f"the steps of an explanation ascend from {from_step} to {path.num_steps}, and {tuple(steps)} do not"
            )
        earliest = step + 1
