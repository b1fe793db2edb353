"""The world models of the shipped study against the exact tables, tabulated and rolled out (paper, section 4.2.1)."""

from pathlib import Path

import numpy as np
import pytest

from tests.sampled import recurrent_importance
from webapp.explainer.importance import PROBABILITY_KINDS, ProbabilityKind, exact_importance
from webapp.explainer.learning import TrainedAgent, load
from webapp.explainer.solvers import follow
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import Layout
from webapp.stimuli.catalogue import Catalogue, current_bundle
from webapp.stimuli.learned import WEIGHTS

pytestmark = pytest.mark.slow

LAYOUTS = ["simulation", "experiment1-a", "experiment1-b", "experiment1-c", "experiment2-a", "experiment2-b"]
NUM_TRIALS = 1000
BIAS = 0.02
"""How far the hidden state that is carried along may shift a probability."""


@pytest.fixture(scope="module")
def agents(built_instance: Path, layouts: dict[str, Layout]) -> dict[str, TrainedAgent]:
    folder = current_bundle(built_instance, "sakai2021")
    names = Catalogue.open(folder).study.layouts
    return dict(zip(names, load(folder / WEIGHTS, [layouts[name] for name in names]), strict=True))


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("random_steps", [5, 10, 20])
@pytest.mark.parametrize("name", LAYOUTS)
def test_tabulated_the_learned_world_gives_the_exact_importance(
    name: str, random_steps: int, kind: ProbabilityKind, agents: dict[str, TrainedAgent], layouts: dict[str, Layout]
) -> None:
    exact, learned = tabulate(layouts[name]), agents[name].tabulate()
    results = []
    for world in (exact, learned):
        policy = agents[name].policy(world)
        results.append(exact_importance(kind, world, policy, follow(world, policy), random_steps).values)
    np.testing.assert_allclose(results[1], results[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("name", LAYOUTS)
def test_rolled_out_the_learned_world_gives_nearly_the_exact_importance(
    name: str, kind: ProbabilityKind, agents: dict[str, TrainedAgent], layouts: dict[str, Layout]
) -> None:
    world, agent = tabulate(layouts[name]), agents[name]
    policy = agent.policy(world)
    path = follow(world, policy)
    exact = exact_importance(kind, world, policy, path, 10).values
    rolled_out = recurrent_importance(kind, agent.recurrent_model(), world, policy, path, 10, NUM_TRIALS, 7).values
    standard_errors = np.sqrt(np.maximum(exact * (1 - exact), 0) / NUM_TRIALS)
    assert np.all(np.abs(rolled_out - exact) <= BIAS + 4 * standard_errors), np.abs(rolled_out - exact).max()
