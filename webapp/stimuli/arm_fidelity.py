"""How far each kind's pictures alone lead to the goal: `explainer.fidelity`, from the state that is explained.

Whoever acts as the agent does in the states that are shown with their actions, and at random elsewhere, reaches the
goal in time with this probability. It is what arms are meant to differ in; the rest of what differs is confounded.
"""

from collections.abc import Mapping, Sequence

from webapp.explainer.explanation import Strip
from webapp.explainer.fidelity import fidelities
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import Trajectory
from webapp.stimuli.scenes import Scene
from webapp.study.experiments import TAILORED_KINDS

Range = tuple[float, float, float]
"""The lowest, the mean and the highest over a kind's variants."""


def arm_fidelities(
    scene: Scene, kinds: Sequence[str], world: DeterministicMDP, policy: Policy, path: Trajectory
) -> dict[str, Range]:
    """Return the fidelity of each kind, over its draws, or over what a participant's own drive may call for.

    Args:
        scene: What one experiment shows of one layout.
        kinds: Those of the experiment.
        world: The agent's world.
        policy: `[S]`.
        path: The agent's whole path.
    """
    left = path.from_step(scene.from_step)
    selections = {kind: [_steps(strips, left) for strips in _variants(scene, kind)] for kind in kinds}
    values = iter(fidelities(world, policy, left, [chosen for each in selections.values() for chosen in each]).tolist())
    ranges: dict[str, Range] = {}
    for kind, chosen in selections.items():
        own = [next(values) for _ in chosen]
        ranges[kind] = (min(own), sum(own) / len(own), max(own))
    return ranges


def _variants(scene: Scene, kind: str) -> Sequence[Sequence[Strip]]:
    """Return what may be shown; of a tailored kind each pair by itself and, where all are shown, all of them."""
    if kind not in TAILORED_KINDS:
        by_kind: Mapping[str, Sequence[Sequence[Strip]]] = scene.explanations
        return by_kind[kind]
    pairs = list(scene.pairs.values())
    single = [[pair] for pair in pairs]
    return single if kind == "tailored_first" else [*single, pairs]


def _steps(strips: Sequence[Strip], left: Trajectory) -> tuple[int, ...]:
    """Return the steps whose action is shown; the goal by itself stands for the last."""
    step_of = {state: step for step, state in enumerate(left.states[:-1], start=1)}
    chosen: set[int] = set()
    for strip in strips:
        chosen |= {step_of[state] for state in strip.states[:-1] if state in step_of}
        if strip.states == left.states[-1:]:
            chosen.add(left.num_steps)
    return tuple(sorted(chosen))
