"""The core: worlds, learning, importance, subgoals, key points, explanations and their pictures.

It may not import Flask, SQLAlchemy, or any other package of this project. Only `learning` and `batched_rollouts`
import torch; only `worlds.environment` and the adapters of environments import gymnasium and minigrid.

What a researcher needs can be had from here, `from webapp.explainer import enumerate_world, exact_importance`, and is
listed below by what it is for; docs/tutorial.md uses it from an environment to an explanation. Whoever imports a part
of the core runs this file first, so it loads nothing by itself: a name brings its module when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from webapp.explainer.abstraction import Abstraction, by_components, coarsen, sound_refinement
    from webapp.explainer.comparison import ComparisonSettings, compare
    from webapp.explainer.explanation import Explanation, explain
    from webapp.explainer.fidelity import drops, fidelities, smallest_sufficient
    from webapp.explainer.granularity import explain_coarsely
    from webapp.explainer.importance import Importance, exact_importance
    from webapp.explainer.key_points import key_point_steps
    from webapp.explainer.learning.settings import TrainingSettings
    from webapp.explainer.learning.training import train
    from webapp.explainer.mdp import DeterministicMDP
    from webapp.explainer.pictures.comparison_picture import write_picture as write_comparison_picture
    from webapp.explainer.pictures.stability_picture import write_picture as write_stability_picture
    from webapp.explainer.questioner import Belief, mistaken_route
    from webapp.explainer.reachability import reach_probability
    from webapp.explainer.sampling import Sampled
    from webapp.explainer.sampling import sample as sample_importance
    from webapp.explainer.selectors.baselines import evenly_spaced_steps, random_pair_steps
    from webapp.explainer.selectors.bottlenecks import bottlenecks
    from webapp.explainer.selectors.highlights import highlights
    from webapp.explainer.selectors.landmarks import landmarks, landmarks_by_fact
    from webapp.explainer.solvers import Trajectory, follow
    from webapp.explainer.stability import stability as assess_stability
    from webapp.explainer.stochastic import StochasticMDP, from_outcomes
    from webapp.explainer.stochastic_planning import most_probable_path, plan_world, tie_averaged_plan
    from webapp.explainer.stop_rule import StopRule
    from webapp.explainer.subgoals import importance_threshold, subgoal_steps
    from webapp.explainer.variants import StabilitySettings
    from webapp.explainer.worlds.enumeration import enumerate_world
    from webapp.explainer.worlds.finite import FiniteWorld, Outcome, describe_state
    from webapp.explainer.worlds.gymnasium_worlds import world_of
    from webapp.explainer.worlds.key_door import tabulate
    from webapp.explainer.worlds.layout import Layout, parse_layout

__all__ = [
    "Abstraction",
    "Belief",
    "ComparisonSettings",
    "DeterministicMDP",
    "Explanation",
    "FiniteWorld",
    "Importance",
    "Layout",
    "Outcome",
    "Sampled",
    "StabilitySettings",
    "StochasticMDP",
    "StopRule",
    "TrainingSettings",
    "Trajectory",
    "assess_stability",
    "bottlenecks",
    "by_components",
    "coarsen",
    "compare",
    "describe_state",
    "drops",
    "enumerate_world",
    "evenly_spaced_steps",
    "exact_importance",
    "explain",
    "explain_coarsely",
    "fidelities",
    "follow",
    "from_outcomes",
    "highlights",
    "importance_threshold",
    "key_point_steps",
    "landmarks",
    "landmarks_by_fact",
    "mistaken_route",
    "most_probable_path",
    "parse_layout",
    "plan_world",
    "random_pair_steps",
    "reach_probability",
    "sample_importance",
    "smallest_sufficient",
    "sound_refinement",
    "subgoal_steps",
    "tabulate",
    "tie_averaged_plan",
    "train",
    "world_of",
    "write_comparison_picture",
    "write_stability_picture",
]

_HOMES = {
    # A world of your own, one of Gymnasium's, a list of outcomes, or a key-door map.
    "FiniteWorld": "worlds.finite",
    "Outcome": "worlds.finite",
    "enumerate_world": "worlds.enumeration",
    "describe_state": "worlds.finite",
    "world_of": "worlds.gymnasium_worlds",
    "from_outcomes": "stochastic",
    "DeterministicMDP": "mdp",
    "StochasticMDP": "stochastic",
    "Layout": "worlds.layout",
    "parse_layout": "worlds.layout",
    "tabulate": "worlds.key_door",
    # What the agent does in it.
    "plan_world": "stochastic_planning",
    "tie_averaged_plan": "stochastic_planning",
    "Trajectory": "solvers",
    "follow": "solvers",
    "most_probable_path": "stochastic_planning",
    "TrainingSettings": "learning.settings",
    "train": "learning.training",
    # How important each state of its path is.
    "Importance": "importance",
    "exact_importance": "importance",
    "sample_importance": "sampling:sample",
    "Sampled": "sampling",
    "StopRule": "stop_rule",
    "reach_probability": "reachability",
    # Subgoals, and what a questioner's route misses of them.
    "importance_threshold": "subgoals",
    "subgoal_steps": "subgoals",
    "Belief": "questioner",
    "mistaken_route": "questioner",
    "key_point_steps": "key_points",
    "Explanation": "explanation",
    "explain": "explanation",
    # How far to trust them.
    "StabilitySettings": "variants",
    "assess_stability": "stability:stability",
    "write_stability_picture": "pictures.stability_picture:write_picture",
    # Other methods for the same path, and what is measured of all.
    "ComparisonSettings": "comparison",
    "compare": "comparison",
    "highlights": "selectors.highlights",
    "landmarks": "selectors.landmarks",
    "landmarks_by_fact": "selectors.landmarks",
    "bottlenecks": "selectors.bottlenecks",
    "evenly_spaced_steps": "selectors.baselines",
    "random_pair_steps": "selectors.baselines",
    "fidelities": "fidelity",
    "drops": "fidelity",
    "smallest_sufficient": "fidelity",
    "write_comparison_picture": "pictures.comparison_picture:write_picture",
    # A coarser view of the world.
    "Abstraction": "abstraction",
    "by_components": "abstraction",
    "coarsen": "abstraction",
    "sound_refinement": "abstraction",
    "explain_coarsely": "granularity",
}
"""The module of each name, and what it is called there where that would be ambiguous here."""

if not TYPE_CHECKING:
    # Type checkers would take its answer for any name, misspelt ones too.
    def __getattr__(name: str) -> object:
        """Import what a public name stands for, when it is first asked for."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        module, _, original = _HOMES[name].partition(":")
        found = getattr(import_module(f"{__name__}.{module}"), original or name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
