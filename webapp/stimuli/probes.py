"""What participants are asked to predict: states of a layout, each with what the agent does there."""

from dataclasses import dataclass

import numpy as np

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.seeding import stream
from webapp.explainer.solvers import Trajectory, distances_to_goal, steps_to_goal
from webapp.stimuli.agents import BuildError
from webapp.study.protocol import Experiment


@dataclass(frozen=True, slots=True)
class Prediction:
    """The question what the agent does next, and its answer.

    Attributes:
        state: The state that is shown.
        action: What the agent does there.
        as_good: Every action, the agent's among them, after which the goal is no farther than after the agent's;
            ascending.
    """

    state: int
    action: int
    as_good: tuple[int, ...]

    def __post_init__(self) -> None:
        if self.action not in self.as_good:
            raise ValueError(f"the agent's action {self.action} must be among those as good, {self.as_good}")


def predictions(
    seed: int,
    experiment: Experiment,
    layout: str,
    world: DeterministicMDP,
    policy: Policy,
    path: Trajectory,
    from_step: int,
) -> tuple[Prediction, ...]:
    """Draw an experiment's questions about a layout, without replacement: the same for every kind and participant.

    Args:
        seed: The study's.
        experiment: Says how many there are, and whether they lie on the path or elsewhere.
        layout: The layout's name.
        world: The world.
        policy: `[S]`.
        path: The policy's path.
        from_step: The step of the state in which the explanation is given, from 1.

    Returns:
        In the order in which they are asked; empty where the experiment asks for no prediction.

    Raises:
        BuildError: There are not so many states.
    """
    probe = experiment.probe
    if probe is None:
        return ()
    states = path.states[from_step:-1] if probe.states == "path" else _elsewhere(world, policy, path)
    if len(states) < probe.num_questions:
        raise BuildError(
            f"layout {layout!r} in experiment {experiment.id!r}: the probe asks about {probe.num_questions} states, "
            f"and {len(states)} lie {_WHERE[probe.states]}; ask fewer questions"
        )
    rng = stream(seed, "prediction probe", experiment.id, layout)
    drawn = rng.choice(np.array(states), size=probe.num_questions, replace=False)
    return tuple(_prediction(world, policy, state) for state in drawn.tolist())


_WHERE = {"path": "on the agent's path after the current one and before the goal", "elsewhere": "elsewhere"}


def _elsewhere(world: DeterministicMDP, policy: Policy, path: Trajectory) -> tuple[int, ...]:
    """Return the states off the path from which the policy reaches the goal; all can be reached from the start."""
    arrives = np.isfinite(steps_to_goal(world, policy)) & ~world.terminal
    arrives[list(path.states)] = False
    return tuple(np.flatnonzero(arrives).tolist())


def _prediction(world: DeterministicMDP, policy: Policy, state: int) -> Prediction:
    """Compare the actions that change the state: one that cannot act leads nowhere, however near the goal is."""
    after = distances_to_goal(world)[world.next_state[state]]
    action = int(policy[state])
    as_good = (after <= after[action]) & (world.next_state[state] != state)
    return Prediction(state, action, tuple(np.flatnonzero(as_good).tolist()))
