"""What a build refuses: agents that do what cannot be shown, and models that err where people act."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.unit.stimuli.study_folders import (
    SHIPPED,
    change,
    copy_study,
    files_of,
    plan_and_build,
    quietly,
    small_study,
    study_of_all_kinds,
)
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import plan
from webapp.explainer.worlds.key_door import TOGGLE
from webapp.stimuli.agents import Agent, AgentProvider, Agents, BuildError, ReportProgress, planner_agents
from webapp.stimuli.build import build
from webapp.stimuli.scenes import Walk, stage, walk
from webapp.stimuli.sources import Sources, read_sources
from webapp.study.experiments import Kind


def with_policy(change_policy: Any) -> Any:  # noqa: ANN401
    """Return a provider of planners whose policy on `experiment2-a` is changed."""

    def provide(sources: Sources, progress: ReportProgress) -> Agents:
        agents = planner_agents(sources, progress)
        by_layout = dict(agents.by_layout)
        agent = by_layout["experiment2-a"]
        by_layout["experiment2-a"] = Agent(lambda mdp: change_policy(mdp, agent.policy(mdp)), agent.world, {})
        return Agents("planner", by_layout, {}, {}, agents.save)

    return provide


def test_an_agent_that_never_arrives_fails_the_build_and_leaves_nothing(tmp_path: Path) -> None:
    def stuck(mdp: DeterministicMDP, policy: Policy) -> Policy:
        policy[mdp.start] = TOGGLE
        return policy

    with pytest.raises(BuildError, match="layout 'experiment2-a': the policy never reaches the goal"):
        build(SHIPPED, tmp_path, quietly, with_policy(stuck))
    assert files_of(tmp_path) == {}


def test_a_path_without_a_split_fails_the_build(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    change(study / "study.toml", "min_video_actions = 2", "min_video_actions = 12")
    with pytest.raises(BuildError, match="layout 'experiment2-a' in experiment '2': no step of this path"):
        plan_and_build(study, tmp_path / "instance")


@pytest.mark.parametrize("kind", ["subgoals", "highlights", "placebic", "random", "tailored_first"])
def test_a_kind_that_needs_subgoals_where_none_lie_ahead_fails_the_build(kind: Kind, tmp_path: Path) -> None:
    """As after the last subgoal of a path whose importance stays high to the end."""
    sources = read_sources(study_of_all_kinds(tmp_path))
    layout, study = sources.layouts["experiment2-a"], sources.study
    agent = planner_agents(sources, quietly).by_layout["experiment2-a"]
    way = walk("experiment2-a", agent, study.explanation)
    behind = Walk(way.path, way.importance, subgoals=(1,))
    experiment = study.experiment("2").model_copy(update={"kinds": (kind,)})
    with pytest.raises(BuildError, match=f"layout 'experiment2-a': experiment '2' has nothing to show as '{kind}'"):
        stage(study, experiment, "experiment2-a", layout, agent, behind)


def erring(name: str) -> AgentProvider:
    """Return a provider of planners whose model of one layout takes an action off the path for one that cannot act."""

    def provide(sources: Sources, progress: ReportProgress) -> Agents:
        agents = planner_agents(sources, progress)
        by_layout = dict(agents.by_layout)
        world = by_layout[name].world
        next_state = world.next_state.copy()
        off_path = next(
            (state, action)
            for state in range(world.num_states)
            for action in range(world.num_actions)
            if world.next_state[state, action] not in (state, *reached_by_policy(world, state))
        )
        next_state[off_path] = off_path[0]
        model = DeterministicMDP(world.states, world.actions, next_state, world.terminal, world.goal, world.start)
        by_layout[name] = Agent(lambda mdp: plan(world) if mdp is model else plan(mdp), model, {})
        return Agents("erring", by_layout, {}, {}, agents.save)

    return provide


def test_a_world_model_that_errs_off_the_path_is_told_by_the_report(tmp_path: Path) -> None:
    """The path stays, the importance does not."""
    study = copy_study(tmp_path)
    change(study / "study.toml", "\n[ask]\n", "\n")
    built = build(study, tmp_path / "instance", quietly, erring("simulation"))
    differences = {report.layout: report.max_difference for report in built.reports}
    assert differences.pop("simulation") > 1e-6
    assert set(differences.values()) == {0.0}


@pytest.mark.parametrize(
    ("before", "addition", "layout"),
    [
        ('facts = ["goal", "key_and_door"]', 'practice = { layout = "simulation" }', "simulation"),
        ('facts = ["goal", "key_and_door"]', "ask = {}", "simulation"),
        ('kinds = ["random"]', "drive = {}", "experiment1-a"),
    ],
)
def test_a_world_model_that_errs_where_people_act_fails_the_build(
    before: str, addition: str, layout: str, tmp_path: Path
) -> None:
    study = small_study(tmp_path)
    change(
        study / "study.toml", 'layouts = ["experiment1-a"]\nfacts', 'layouts = ["experiment1-a", "simulation"]\nfacts'
    )
    change(study / "study.toml", before, f"{before}\n{addition}")
    with pytest.raises(BuildError, match=f"layout '{layout}': people act in it, and the world model errs there"):
        build(study, tmp_path / "instance", quietly, erring(layout))


def reached_by_policy(world: DeterministicMDP, state: int) -> Iterator[int]:
    yield int(world.next_state[state, plan(world)[state]])
