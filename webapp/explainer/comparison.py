"""The paper's subgoals beside rival ways of choosing as many steps, measured alike in a world of either kind."""

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from webapp.explainer.comparison_results import (
    SELECTORS,
    SOURCES,
    Comparison,
    ComparisonSettings,
    Measure,
    Rating,
    as_json,
)
from webapp.explainer.fidelity import drops, fidelities, policy_fidelity, smallest_sufficient
from webapp.explainer.importance import exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.seeding import stream
from webapp.explainer.selectors import (
    Ready,
    bottlenecks,
    context_frames,
    evenly_spaced_steps,
    highlights,
    landmarks,
    landmarks_by_fact,
    most_important_steps,
    random_pair_steps,
)
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import AnyPolicy, World, action_probabilities, from_deterministic
from webapp.explainer.subgoals import subgoal_steps

__all__ = [
    "SELECTORS",
    "SOURCES",
    "Comparison",
    "ComparisonSettings",
    "Measure",
    "Rating",
    "as_json",
    "compare",
]

Selections = list[tuple[int, ...]]
"""What a selector chooses at one budget: one explanation, or some that count as random draws."""


def compare(world: World, policy: AnyPolicy, path: Trajectory, settings: ComparisonSettings) -> Comparison:
    r"""Compare the selectors on one way of a policy to the goal.

    In a stochastic world landmarks and bottlenecks are those of the support graph: of what may happen, however
    unlikely. All measures are exact but the means over random draws.

    Args:
        world: The world.
        policy: `[S]` actions or `[S, A]` probabilities.
        path: A way to a goal that the policy may take.
        settings: What to compare.

    Raises:
        ValueError: The path has no steps, or fewer than the budget, or is not the policy's way to a goal.
        NotSolved: A linear system's answer cannot be trusted.

    Example:
        >>> from webapp.explainer import ComparisonSettings, compare, follow, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> found = compare(world, policy, path, ComparisonSettings(random_steps=2))
        >>> [(rating.selector, rating.steps) for rating in found.ratings[:3]]
        [('subgoals', (1, 7)), ('highlights', (5, 7)), ('landmarks', (4, 6))]
    """
    _check_path(world, policy, path)
    entrants = _entrants(world, policy, path, settings)
    subgoals = entrants[0].ready.own
    budget = max(1, len(subgoals)) if settings.budget is None else settings.budget
    if budget > path.num_steps:
        raise ValueError(f"k must be at most {path.num_steps}, the number of the path's steps, not {budget}")
    found = [_Choice.timed(entrant, budget) for entrant in entrants]
    curves = _curves(world, policy, path, entrants)
    losses = iter(drops(world, policy, path, [steps for choice in found for steps in choice.selections]).tolist())
    ratings = [
        choice.rated(path, subgoals, curve, list(islice(losses, len(choice.selections))), settings)
        for choice, curve in zip(found, curves, strict=True)
    ]
    achieved = policy_fidelity(world, policy, path)
    return Comparison(path, subgoals, budget, settings.alpha, tuple(ratings), achieved, settings)


def _check_path(world: World, policy: AnyPolicy, path: Trajectory) -> None:
    """Refuse a path that is no way of the policy to a goal, or too short to choose from."""
    if not path.num_steps:
        raise ValueError("the path has no steps to choose from: the start is the goal")
    wrong = next((state for state in path.states if not 0 <= state < world.num_states), None)
    if wrong is not None:
        raise ValueError(f"a path must hold state indices from 0 to {world.num_states - 1}, not {wrong}")
    mdp = from_deterministic(world) if isinstance(world, DeterministicMDP) else world
    chances = action_probabilities(mdp, policy)
    for (state, action), after in zip(path.pairs, path.states[1:], strict=True):
        row = state * mdp.num_actions + action
        if not 0 <= action < mdp.num_actions or not chances[state, action]:
            raise ValueError(f"the path leaves the policy in {mdp.states[state]!r}")
        if after not in mdp.next_state[mdp.row_start[row] : mdp.row_start[row + 1]]:
            raise ValueError(f"the path leaves the world in {mdp.states[state]!r}: its action cannot lead there")
    if not mdp.goal[path.states[-1]]:
        raise ValueError(f"the path must end in a goal, not in {mdp.states[path.states[-1]]!r}")


@dataclass(frozen=True, slots=True)
class _Entrant:
    """A selector that is ready, and how long that took."""

    name: str
    ready: Ready
    choose: Callable[[int], Selections]
    seconds: float


def _entrants(world: World, policy: AnyPolicy, path: Trajectory, settings: ComparisonSettings) -> list[_Entrant]:
    prepare: Mapping[str, Callable[[], Ready]] = {
        "subgoals": lambda: _subgoals(world, policy, path, settings),
        "highlights": lambda: highlights(world, policy, path, settings.discount, settings.min_gap),
        "landmarks": lambda: landmarks(world, path),
        "landmark facts": lambda: landmarks_by_fact(world, path),
        "bottlenecks": lambda: bottlenecks(world, path, stream(settings.seed, "comparison", "bottlenecks")),
        "evenly spaced": lambda: Ready(lambda count: evenly_spaced_steps(path.num_steps, count)),
    }
    entrants = []
    for name, get_ready in prepare.items():
        begin = time.perf_counter()
        ready = get_ready()
        entrants.append(_Entrant(name, ready, _alone(ready), time.perf_counter() - begin))
    draw = _draws(path, settings)
    return [*entrants, _Entrant("random", Ready(lambda count: draw(count)[0]), draw, 0.0)]


def _subgoals(world: World, policy: AnyPolicy, path: Trajectory, settings: ComparisonSettings) -> Ready:
    values = exact_importance(settings.importance, world, policy, path, settings.random_steps, settings.discount).values
    own = subgoal_steps(values)
    return Ready(
        lambda count: most_important_steps(values[:-1], own, count),
        lambda step: f"importance {values[step - 1] + 0.0:.3g}",  # Never -0.
        own,
        fills_up=True,
    )


def _alone(ready: Ready) -> Callable[[int], Selections]:
    return lambda count: [ready.choose(count)]


def _draws(path: Trajectory, settings: ComparisonSettings) -> Callable[[int], Selections]:
    """Draw for each budget from streams of its own, so that no budget changes another's draws."""

    def draw(count: int) -> Selections:
        rng = stream(settings.seed, "comparison", "random", str(count))
        return [random_pair_steps(path.num_steps, count, rng) for _ in range(settings.num_draws)]

    return draw


@dataclass(frozen=True, slots=True)
class _Choice:
    """What a selector chooses at the budget."""

    entrant: _Entrant
    selections: Selections
    seconds: float

    @classmethod
    def timed(cls, entrant: _Entrant, budget: int) -> "_Choice":
        begin = time.perf_counter()
        selections = entrant.choose(budget)
        return cls(entrant, selections, entrant.seconds + (time.perf_counter() - begin) / len(selections))

    def rated(
        self,
        path: Trajectory,
        subgoals: Collection[int],
        curve: Sequence[Measure],
        losses: Sequence[float],
        settings: ComparisonSettings,
    ) -> Rating:
        """Put together what was measured."""
        ready, steps = self.entrant.ready, self.selections[0]
        drawn = len(self.selections) > 1
        reason = ready.reason
        return Rating(
            selector=self.entrant.name,
            steps=None if drawn else steps,
            overlap=_measured([len(set(each) & set(subgoals)) for each in self.selections]),
            fidelity=curve[len(steps)],
            drop=_measured(losses),
            seconds=self.seconds,
            curve=tuple(curve),
            smallest=smallest_sufficient([measure.value for measure in curve], settings.alpha),
            reasons=() if reason is None else tuple(map(reason, steps)),
            own={} if reason is None else {step: reason(step) for step in ready.own},
            frames=context_frames(steps, path.num_steps, settings.context) if self._shows_context else (),
            note=_note(ready, len(steps), settings),
            fillers=tuple(step for step in steps if step not in ready.own) if ready.fills_up else (),
            min_gap=None if ready.distance is None else ready.distance(len(steps)),
        )

    @property
    def _shows_context(self) -> bool:
        return self.entrant.name == "highlights"


def _note(ready: Ready, count: int, settings: ComparisonSettings) -> str:
    """Add to a selector's own note that the distance asked for does not go with the budget."""
    distance = None if ready.distance is None else ready.distance(count)
    if distance is None or distance >= settings.min_gap:
        return ready.note
    nearer = (
        f"{count} steps, the most important first, do not fit {settings.min_gap} apart; they are kept {distance} apart"
    )
    return "; ".join(part for part in (ready.note, nearer) if part)


def _curves(
    world: World, policy: AnyPolicy, path: Trajectory, entrants: Sequence[_Entrant]
) -> list[tuple[Measure, ...]]:
    """Measure every choice of every selector at every budget, all at once."""
    choices = [[entrant.choose(count) for count in range(path.num_steps + 1)] for entrant in entrants]
    everything = [steps for of_entrant in choices for selections in of_entrant for steps in selections]
    found = iter(fidelities(world, policy, path, everything).tolist())
    return [
        tuple(_measured(list(islice(found, len(selections)))) for selections in of_entrant) for of_entrant in choices
    ]


def _measured(numbers: Sequence[float]) -> Measure:
    """One exact number as it is, several as their mean with its standard error."""
    values = np.asarray(numbers, dtype=np.float64)
    if len(values) == 1:
        return Measure(float(values[0]))
    if (values == values[0]).all():
        return Measure(float(values[0]), 0.0)  # Their mean might be off by a rounding.
    return Measure(float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values))))
