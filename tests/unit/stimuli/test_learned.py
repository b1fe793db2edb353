"""The bundle that people see: explained are learned agents, in the world as they have learned it."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.unit.stimuli.study_folders import quietly, small_study
from webapp.explainer.learning import TrainingSettings, load
from webapp.explainer.worlds.key_door import key_door_state
from webapp.stimuli.agents import BuildError
from webapp.stimuli.build import build
from webapp.stimuli.catalogue import Catalogue, current_bundle
from webapp.stimuli.learned import WEIGHTS, learned_agents
from webapp.stimuli.sources import read_sources
from webapp.study.problems import StudyError

GOLDEN = json.loads((Path(__file__).parents[2] / "golden" / "method-numbers.json").read_text(encoding="utf-8"))


def study_with(settings: str, folder: Path) -> Path:
    study = small_study(folder)
    with (study / "study.toml").open("a", encoding="utf-8") as file:
        file.write(f"\n[learning.settings]\n{settings}\n")
    return study


def test_an_unknown_training_setting_is_refused_with_a_suggestion(tmp_path: Path) -> None:
    sources = read_sources(study_with("num_cycle = 1\nmoon_phase = 3", tmp_path))
    with pytest.raises(StudyError) as error:
        learned_agents(sources, quietly)
    first, second = error.value.problems
    assert (
        first == "study.toml: learning.settings.num_cycle: is not a setting of the training; did you mean 'num_cycles'?"
    )
    assert second.startswith(
        "study.toml: learning.settings.moon_phase: is not a setting of the training; the settings are "
    )


def test_a_training_setting_out_of_range_is_refused(tmp_path: Path) -> None:
    sources = read_sources(study_with("visited_start_share = 0.7", tmp_path))
    with pytest.raises(StudyError, match=r"learning\.settings: visited_start_share must be at most 0\.5, not 0\.7"):
        learned_agents(sources, quietly)


def test_a_training_that_does_not_succeed_fails_the_build_and_says_what_was_missing(tmp_path: Path) -> None:
    study = study_with("num_cycles = 1\ncycle_iterations = 2\nnum_warmup_steps = 10", tmp_path)
    with pytest.raises(
        BuildError,
        match=r"the training failed: after 2 iterations, .*losses have not flattened .*the agents: 1 experiment1-a",
    ):
        build(study, tmp_path / "instance", quietly)
    assert not list((tmp_path / "instance" / "bundles").glob("current-*"))


@pytest.fixture(scope="module")
def folder(built_instance: Path) -> Path:
    return current_bundle(built_instance, "sakai2021")


@pytest.fixture(scope="module")
def manifest(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    return content


@pytest.mark.slow
def test_the_learned_agents_have_the_methods_subgoals_on_all_layouts(manifest: dict[str, Any]) -> None:
    assert manifest["agents"] == "learned"
    subgoals = {report["layout"]: [report["subgoals"], report["num_steps"]] for report in manifest["report"]}
    assert subgoals == {
        name: [golden["return_probability"]["10"]["subgoal_steps"], len(golden["actions"])]
        for name, golden in GOLDEN.items()
    }


@pytest.mark.slow
def test_the_learned_worlds_importance_is_the_exact_tables(manifest: dict[str, Any]) -> None:
    assert [report["max_difference"] <= 1e-9 for report in manifest["report"]] == [True] * 6


@pytest.mark.slow
def test_the_manifest_tells_how_the_agents_were_trained(manifest: dict[str, Any]) -> None:
    assert manifest["training_settings"] == TrainingSettings().to_dict()
    for report in manifest["report"]:
        assert report["training"]["seed"] == manifest["training_seeds"][report["layout"]]
        assert 0 < 2 * report["training"]["num_visited_starts"] <= report["training"]["num_episodes"]
        assert report["training"]["num_steps"] > 0


@pytest.mark.slow
def test_the_weights_of_the_bundle_are_those_that_were_explained(folder: Path) -> None:
    study = Catalogue.open(folder).study
    tables = [json.loads((folder / "tables" / f"{name}.json").read_text(encoding="utf-8")) for name in study.layouts]
    sources = read_sources(Path(__file__).parents[3] / "webapp" / "studies" / "sakai2021")
    agents = load(folder / WEIGHTS, [sources.layouts[name] for name in study.layouts])
    for agent, table in zip(agents, tables, strict=True):
        world = agent.tabulate()
        assert [list(key_door_state(world, state)) for state in range(world.num_states)] == table["states"]
        assert world.next_state.tolist() == table["next_state"]
        assert agent.policy(world).tolist() == table["policy"]
