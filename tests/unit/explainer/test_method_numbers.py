"""The study's six layouts against numbers that another implementation computed."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.worlds import LAYOUTS
from webapp.explainer.explanation import explain
from webapp.explainer.importance import PROBABILITY_KINDS, ProbabilityKind, exact_importance
from webapp.explainer.key_points import key_point_steps
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.questioner import believed_door_at, believed_route, find_split
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.worlds.key_door import start_state, tabulate

GOLDEN: dict[str, dict[str, Any]] = json.loads(
    (Path(__file__).parents[2] / "golden" / "method-numbers.json").read_text(encoding="utf-8")
)


@cache
def planned(name: str) -> tuple[DeterministicMDP, Policy, Trajectory]:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    return mdp, policy, follow(mdp, policy)


def names(mdp: DeterministicMDP, actions: tuple[int, ...]) -> list[str]:
    return [mdp.actions[action] for action in actions]


def test_every_layout_has_its_numbers() -> None:
    assert set(GOLDEN) == set(LAYOUTS)


@pytest.mark.parametrize("name", GOLDEN)
def test_the_planner_takes_the_known_path(name: str) -> None:
    mdp, _, path = planned(name)
    assert mdp.num_states == GOLDEN[name]["reachable_states"]
    assert names(mdp, path.actions) == GOLDEN[name]["actions"]
    assert [mdp.states[state] for state in path.states] == [tuple(state) for state in GOLDEN[name]["states"]]


@pytest.mark.parametrize("random_steps", [5, 10, 20])
@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
@pytest.mark.parametrize("name", GOLDEN)
def test_importance_threshold_and_subgoals_are_the_known_ones(
    name: str, kind: ProbabilityKind, random_steps: int
) -> None:
    mdp, policy, _ = planned(name)
    known = GOLDEN[name][kind][str(random_steps)]
    found = explain(mdp, policy, lambda path: exact_importance(kind, mdp, policy, path, random_steps))
    np.testing.assert_allclose(found.importance.values, known["importance"], rtol=0, atol=1e-9)
    assert found.threshold == pytest.approx(known["threshold"], abs=1e-9)
    assert list(found.subgoals) == known["subgoal_steps"]


@pytest.mark.parametrize("name", ["experiment2-a", "experiment2-b"])
def test_the_second_experiment_asks_at_the_known_split(name: str) -> None:
    mdp, policy, path = planned(name)
    known = GOLDEN[name]["query"]
    question = find_split(LAYOUTS[name], mdp, path)
    assert question.from_step == known["from_step"]
    assert names(mdp, question.video_actions) == known["video_actions"]
    assert names(mdp, question.announced_actions) == known["announced_actions"]
    assert names(mdp, question.route) == known["a_bad"]
    found = explain(
        mdp,
        policy,
        lambda path: exact_importance("return_probability", mdp, policy, path, 10),
        question.route,
        question.from_step,
    )
    assert list(found.key_points) == known["key_point_steps"]
    assert found.explanation_step == known["explanation_step"]


def test_the_misunderstood_door_is_explained_by_passing_the_real_one() -> None:
    mdp, _, path = planned("simulation")
    known = GOLDEN["simulation"]["query"]
    layout = LAYOUTS["simulation"]
    route = believed_route(believed_door_at(layout, (4, 2), start_state(layout)))
    assert names(mdp, route) == known["a_bad"]
    subgoals = GOLDEN["simulation"]["return_probability"]["10"]["subgoal_steps"]
    key_points = key_point_steps(mdp, path, subgoals, route, known["from_step"])
    assert list(key_points) == known["key_point_steps"]
    assert key_points[0] == known["explanation_step"]


def test_the_papers_simulation_takes_key_and_door_when_the_paper_says() -> None:
    mdp, _, path = planned("simulation")
    assert mdp.num_states == 308
    actions = names(mdp, path.actions)
    assert (actions.index("pickup") + 1, actions.index("toggle") + 1, len(actions)) == (7, 14, 20)
