"""Importance from a fixed number of trials, as most tests of sampling want it."""

from webapp.explainer.batched_rollouts import RecurrentWorldModel
from webapp.explainer.importance import Importance, ProbabilityKind
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.sampling import sample, sample_recurrent
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import AnyPolicy, World
from webapp.explainer.stop_rule import StopRule


def sampled_importance(
    kind: ProbabilityKind,
    world: World,
    policy: AnyPolicy,
    path: Trajectory,
    random_steps: int,
    num_trials: int,
    seed: int,
    device: str | None = None,
) -> Importance:
    return sample(kind, world, policy, path, random_steps, StopRule(num_trials), seed, device).importance


def recurrent_importance(
    kind: ProbabilityKind,
    model: RecurrentWorldModel,
    mdp: DeterministicMDP,
    policy: Policy,
    path: Trajectory,
    random_steps: int,
    num_trials: int,
    seed: int,
) -> Importance:
    return sample_recurrent(kind, model, mdp, policy, path, random_steps, StopRule(num_trials), seed).importance
