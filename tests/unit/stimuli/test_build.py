import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.unit.stimuli.study_folders import (
    change,
    copy_study,
    files_of,
    nobody,
    plan_and_build,
    quietly,
    set_texts,
    small_study,
    study_of_all_kinds,
    without_plan,
)
from tests.worlds import LAYOUTS, reachable_states
from webapp.explainer.worlds.view import View, egocentric_view
from webapp.stimuli import build as build_module
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import Built, build
from webapp.stimuli.catalogue import Catalogue, bundle_version, current_bundle
from webapp.stimuli.program import Program
from webapp.stimuli.sources import SHARED_TEXTS
from webapp.study.problems import StudyError
from webapp.study.session import Trial

GOLDEN = json.loads((Path(__file__).parents[2] / "golden" / "method-numbers.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def folder(planned_instance: Path) -> Path:
    return current_bundle(planned_instance, "sakai2021")


@pytest.fixture(scope="module")
def tables(folder: Path) -> dict[str, Any]:
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in (folder / "tables").glob("*.json")}


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return small_study(tmp_path)


def test_the_planners_subgoals_paths_and_importances_are_the_methods(tables: dict[str, Any]) -> None:
    assert tables.keys() == GOLDEN.keys()
    for name, table in tables.items():
        numbers = GOLDEN[name]["return_probability"]["10"]
        assert table["subgoals"] == numbers["subgoal_steps"]
        assert table["importance"] == pytest.approx(numbers["importance"], abs=1e-9)
        assert table["threshold"] == pytest.approx(numbers["threshold"], abs=1e-9)
        assert [table["states"][state] for state in table["path"]["states"]] == GOLDEN[name]["states"]
        assert [table["actions"][action] for action in table["path"]["actions"]] == GOLDEN[name]["actions"]


def test_every_view_that_can_be_reached_has_its_own_picture(
    folder: Path, tables: dict[str, Any], bundle: Catalogue
) -> None:
    pictures: dict[View, int] = {}
    for name, layout in LAYOUTS.items():
        table = tables[name]
        assert sorted(tuple(state) for state in table["states"]) == [tuple(state) for state in reachable_states(layout)]
        number_of = {tuple(state): number for state, number in zip(table["states"], table["pictures"], strict=True)}
        for state in reachable_states(layout):
            view = egocentric_view(layout, state)
            assert pictures.setdefault(view, number_of[tuple(state)]) == number_of[tuple(state)]
    assert sorted(pictures.values()) == list(range(len(bundle.digests)))
    assert list(bundle.digests) == sorted(bundle.digests)
    files = {path.stem: path.read_bytes() for path in (folder / "pictures").glob("*.png")}
    assert files.keys() == set(bundle.digests)
    assert all(hashlib.sha256(content).hexdigest() == digest for digest, content in files.items())


def test_two_builds_give_the_same_bytes(planned_instance: Path, tmp_path: Path) -> None:
    again = plan_and_build(copy_study(tmp_path), tmp_path / "instance")
    first = current_bundle(planned_instance, "sakai2021")
    assert again.is_new
    assert files_of(current_bundle(tmp_path / "instance", "sakai2021")) == files_of(first)
    assert again.catalogue.version == first.name == bundle_version(first)


def test_a_second_build_trains_nothing_and_reports_the_same(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = plan_and_build(small, tmp_path)
    monkeypatch.setattr(nobody, "__name__", planner_agents.__name__)
    second = build(small, tmp_path, quietly, nobody)
    assert (first.is_new, second.is_new) == (True, False)
    assert second.catalogue.version == first.catalogue.version
    assert [report.to_json() for report in second.reports] == json.loads(
        json.dumps([report.to_json() for report in first.reports])
    )


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("study.toml", "num_draws = 10", "num_draws = 9"),
        ("study.toml", '"<name and e-mail address of the responsible researcher>"', '"a@example.org"'),
        ("layouts/experiment1-a.txt", "#.>.#..#", "#.<.#..#"),
    ],
)
def test_whatever_changes_in_the_study_makes_another_version(
    file: str, before: str, after: str, small: Path, tmp_path: Path
) -> None:
    first = plan_and_build(small, tmp_path / "instance")
    change(small / file, before, after)
    second = plan_and_build(small, tmp_path / "instance")
    assert second.is_new
    assert second.catalogue.version != first.catalogue.version


def test_another_wording_makes_another_version(small: Path, tmp_path: Path) -> None:
    first = plan_and_build(small, tmp_path / "instance")
    set_texts(small, {"instructions.start": "Ready"})
    second = plan_and_build(small, tmp_path / "instance")
    assert (second.is_new, second.catalogue.version != first.catalogue.version) == (True, True)


def test_the_texts_that_all_studies_share_are_among_what_a_bundle_follows_from(small: Path, tmp_path: Path) -> None:
    shared = Path(shutil.copytree(SHARED_TEXTS, tmp_path / "shared"))

    def version() -> str:
        return build(small, tmp_path / "instance", quietly, planner_agents, shared).catalogue.version

    before = version()
    change(shared / "en.toml", 'give_up = "Stop before the goal"', 'give_up = "Stop here"')
    assert version() != before


def test_a_comment_in_the_study_file_makes_another_version_because_the_file_itself_is_frozen(
    small: Path, tmp_path: Path
) -> None:
    first = plan_and_build(small, tmp_path / "instance").catalogue.version
    change(small / "study.toml", "seed = 2021", "seed = 2021  # Any will do.")
    assert plan_and_build(small, tmp_path / "instance").catalogue.version != first


def test_a_bundle_holds_every_file_that_it_was_built_from(small: Path, tmp_path: Path) -> None:
    (small / "own.py").write_text("STEPS = 1\n", encoding="utf-8")
    (small / "plan.md").write_text("A t-test.\n", encoding="utf-8")
    (small / "notes.md").write_text("Whoever reads it.\n", encoding="utf-8")
    change(small / "study.toml", "[explanation]\n", '[analysis]\nplan = "plan.md"\n\n[explanation]\n')
    folder = tmp_path / "instance" / "bundles" / plan_and_build(small, tmp_path / "instance").catalogue.version
    shared = {f"shared_texts/{language}.toml": SHARED_TEXTS / f"{language}.toml" for language in ("en", "ja")}
    own = {f"study/{name}": content for name, content in files_of(small).items()}
    assert {"study/own.py", "study/plan.md", "study/notes.md", "study/texts/en.toml"} < own.keys()
    assert files_of(folder / "sources") == own | {name: file.read_bytes() for name, file in shared.items()}


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (None, "is missing; analysis.plan names it"),
        ("\n", "is empty; write down the planned analysis, or leave analysis.plan out"),
    ],
)
def test_an_analysis_plan_that_cannot_be_frozen_is_refused(
    content: str | None, problem: str, small: Path, tmp_path: Path
) -> None:
    change(small / "study.toml", "[explanation]\n", '[analysis]\nplan = "plan.md"\n\n[explanation]\n')
    if content is not None:
        (small / "plan.md").write_text(content, encoding="utf-8")
    with pytest.raises(StudyError) as error:
        plan_and_build(small, tmp_path / "instance")
    assert error.value.problems == (f"{small}/plan.md: {problem}",)


def test_other_code_makes_another_version_of_the_same_pictures_and_trains_nothing(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = plan_and_build(small, tmp_path)
    monkeypatch.setattr(build_module, "running_program", lambda: Program("9.9", "f" * 64))
    monkeypatch.setattr(nobody, "__name__", planner_agents.__name__)
    second = build(small, tmp_path, quietly, nobody)
    before, after = (files_of(tmp_path / "bundles" / built.catalogue.version) for built in (first, second))
    assert second.catalogue.version != first.catalogue.version
    assert {name for name in before if before[name] != after[name]} == {"manifest.json"}
    assert build(small, tmp_path, quietly, nobody).catalogue.version == second.catalogue.version


def test_the_last_built_version_is_current_and_earlier_ones_stay(small: Path, tmp_path: Path) -> None:
    study, instance = small, tmp_path / "instance"
    first = plan_and_build(study, instance).catalogue
    wording = first.texts("en")("instructions.start")
    texts = (study / "texts" / "en.toml").read_bytes()
    set_texts(study, {"instructions.start": "Ready"})
    second = plan_and_build(study, instance).catalogue.version
    assert current_bundle(instance, "sakai2021").name == second
    assert Catalogue.open(instance / "bundles" / first.version).texts("en")("instructions.start") == wording
    (study / "texts" / "en.toml").write_bytes(texts)
    back = plan_and_build(study, instance)
    assert (back.is_new, current_bundle(instance, "sakai2021").name) == (False, first.version)


def test_a_damaged_bundle_is_built_again(small: Path, tmp_path: Path) -> None:
    built = plan_and_build(small, tmp_path)
    picture = current_bundle(tmp_path, "sakai2021") / "pictures" / f"{built.catalogue.digests[0]}.png"
    whole = picture.read_bytes()
    picture.write_bytes(whole[:-1])
    again = plan_and_build(small, tmp_path)
    assert again.is_new
    assert again.catalogue.version == built.catalogue.version
    assert picture.read_bytes() == whole


def test_a_new_instance_is_closed_to_other_accounts(small: Path, tmp_path: Path) -> None:
    plan_and_build(small, tmp_path / "instance")
    assert (tmp_path / "instance").stat().st_mode & 0o777 == 0o700
    assert not list((tmp_path / "instance" / "bundles").glob("draft-*"))


def test_a_study_that_cannot_be_used_builds_nothing(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    change(study / "study.toml", "num_draws = 10", "num_draws = 0")
    with pytest.raises(StudyError, match="num_draws"):
        build(study, tmp_path / "instance", quietly, nobody)
    assert not (tmp_path / "instance").exists()


def test_a_study_of_all_kinds_builds_to_the_same_bytes_twice(tmp_path: Path) -> None:
    first = plan_and_build(study_of_all_kinds(tmp_path), tmp_path / "once")
    again = plan_and_build(study_of_all_kinds(tmp_path / "again"), tmp_path / "twice")
    assert again.is_new
    version = first.catalogue.version
    assert files_of(tmp_path / "once" / "bundles" / version) == files_of(tmp_path / "twice" / "bundles" / version)


def test_random_pairs_after_a_video_are_drawn_from_what_lies_ahead(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    without_plan(study)
    change(study / "study.toml", '["all_key_points", "first_key_point"]', '["random", "first_key_point"]')
    bundle = plan_and_build(study, tmp_path / "instance").catalogue
    for layout in ("experiment2-a", "experiment2-b"):
        split = GOLDEN[layout]["query"]["from_step"]
        whole = json.loads(
            (current_bundle(tmp_path / "instance", "sakai2021") / "tables" / f"{layout}.json").read_text()
        )
        ahead = [bundle.digests[whole["pictures"][state]] for state in whole["path"]["states"][split - 1 :]]
        pairs = {tuple(ahead[i : i + 2]) for i in range(len(ahead) - 1)} | {(ahead[-1],)}
        for draw in range(10):
            first, *others = bundle.explanation(Trial("2", 1, 2, layout, "random", draw), "en")
            assert [frame.digest for frame in first.frames] == ahead[:1]
            assert {tuple(frame.digest for frame in strip.frames) for strip in others} <= pairs
            assert len(others) == len([step for step in whole["subgoals"] if step >= split])


def test_the_manifest_tells_what_the_bundle_was_made_with(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["agents"] == "planner"
    assert manifest["training_seeds"] == dict.fromkeys(LAYOUTS, 2021)
    assert {"torch", "numpy", "pillow", "minigrid"} <= manifest["made_with"]["packages"].keys()
    assert manifest["made_with"]["processor"]
    by_layout = {report["layout"]: report for report in manifest["report"]}
    for name, report in by_layout.items():
        assert report["num_states"] == GOLDEN[name]["reachable_states"]
        assert report["subgoals"] == GOLDEN[name]["return_probability"]["10"]["subgoal_steps"]
        assert report["max_difference"] == 0.0
    for name in ("experiment2-a", "experiment2-b"):
        assert by_layout[name]["key_points"] == {"2": GOLDEN[name]["query"]["key_point_steps"]}


def test_progress_goes_from_nothing_to_all(small: Path, tmp_path: Path) -> None:
    told: list[tuple[str, float]] = []
    build(small, tmp_path, lambda name, done: told.append((name, done)), planner_agents)
    for wanted in ("explaining", "drawing pictures"):
        shares = [done for name, done in told if name == wanted]
        assert shares == sorted(shares)
        assert shares[-1] == 1.0
        assert all(0 <= share <= 1 for share in shares)


def test_a_build_that_was_new_says_how(small: Path, tmp_path: Path) -> None:
    built = plan_and_build(small, tmp_path)
    assert isinstance(built, Built)
    assert [report.layout for report in built.reports] == list(built.catalogue.study.layouts)
