import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import change, copy_study, plan_and_build, study_of_all_kinds, without_plan
from webapp.explainer.fidelity import fidelities
from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import Layout
from webapp.stimuli.arm_linter import Arm, ArmReport, compare_arms
from webapp.stimuli.catalogue import Catalogue, current_bundle


def compare(folder: Path) -> Mapping[str, ArmReport]:
    report = json.loads((folder / "manifest.json").read_text("utf-8"))["report"]
    return {found.experiment: found for found in compare_arms(Catalogue.open(folder), folder, report)}


@pytest.fixture(scope="module")
def paper(planned_instance: Path) -> Mapping[str, ArmReport]:
    return compare(current_bundle(planned_instance, "sakai2021"))


def arm(report: ArmReport, kind: str, layout: str) -> Arm:
    (found,) = [each for each in report.arms if (each.kind, each.layout) == (kind, layout)]
    return found


def test_the_papers_random_arm_differs_in_nothing_but_a_picture_at_most_and_its_full_arm_in_everything(
    paper: Mapping[str, ArmReport],
) -> None:
    report = paper["1"]
    assert {confound.kind for confound in report.confounds} == {"full"}
    assert {confound.measure for confound in report.confounds} == {
        "pictures",
        "words",
        "words_heard",
        "seconds",
        "kilobytes",
    }
    for layout in ("experiment1-a", "experiment1-b", "experiment1-c"):
        pictures = arm(report, "random", layout).measures["pictures"]
        subgoals = arm(report, "subgoals", layout).measures["pictures"].mean
        assert subgoals - 1 <= pictures.lowest <= pictures.highest <= subgoals + 1


def test_a_warning_names_kinds_numbers_layout_and_threshold(paper: Mapping[str, ArmReport]) -> None:
    (pictures,) = [str(confound) for confound in paper["1"].confounds if confound.measure == "pictures"]
    assert pictures == (
        "'full' has 13 more pictures than 'random' in layout 'experiment1-b' (20 and 7; warned about above 1)"
    )


def test_all_key_points_are_more_to_look_at_than_the_first(paper: Mapping[str, ArmReport]) -> None:
    assert {(confound.kind, confound.other) for confound in paper["2"].confounds} == {
        ("all_key_points", "first_key_point")
    }


def test_what_an_arm_shows_is_counted_as_its_pages_show_it(
    planned_instance: Path, paper: Mapping[str, ArmReport]
) -> None:
    folder = current_bundle(planned_instance, "sakai2021")
    table = json.loads((folder / "tables" / "experiment1-a.json").read_text("utf-8"))
    full = arm(paper["1"], "full", "experiment1-a")
    assert full.measures["pictures"].mean == len(table["path"]["states"])
    digests = {Catalogue.open(folder).digests[table["pictures"][state]] for state in table["path"]["states"]}
    size = sum((folder / "pictures" / f"{digest}.png").stat().st_size for digest in digests)
    assert full.measures["kilobytes"].mean == size / 1000


def test_fidelity_is_the_probability_of_arriving_by_what_is_shown(
    layouts: Mapping[str, Layout], planned_instance: Path, paper: Mapping[str, ArmReport]
) -> None:
    folder = current_bundle(planned_instance, "sakai2021")
    for name in ("experiment1-a", "experiment1-b", "experiment1-c"):
        world = tabulate(layouts[name])
        policy = plan(world)
        path = follow(world, policy)
        subgoals = json.loads((folder / "tables" / f"{name}.json").read_text("utf-8"))["subgoals"]
        expected = fidelities(world, policy, path, [subgoals, range(1, path.num_steps + 1)]).tolist()
        found = [arm(paper["1"], kind, name).fidelity.mean for kind in ("subgoals", "full")]
        assert found == pytest.approx(expected, abs=1e-12)
        assert found[1] == 1.0


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, ArmReport]:
    folder = tmp_path_factory.mktemp("all-kinds")
    version = plan_and_build(study_of_all_kinds(folder), folder / "instance").catalogue.version
    return compare(folder / "instance" / "bundles" / version)


def test_every_kind_is_measured_on_every_layout(everything: Mapping[str, ArmReport]) -> None:
    assert [len(report.arms) for report in everything.values()] == [10 * 3, 9 * 2]
    for report in everything.values():
        for each in report.arms:
            for spread in (*each.measures.values(), each.fidelity):
                assert 0 <= spread.lowest <= spread.mean + 1e-12
                assert spread.mean <= spread.highest + 1e-12


def test_explaining_nothing_is_compared_with_nothing(everything: Mapping[str, ArmReport]) -> None:
    nothing = arm(everything["1"], "none", "experiment1-a")
    assert (nothing.measures["pictures"].highest, nothing.measures["kilobytes"].highest) == (0, 0)
    assert nothing.measures["words"].mean > 0
    assert nothing.fidelity == arm(everything["1"], "placebic", "experiment1-a").fidelity
    named = {name for report in everything.values() for each in report.confounds for name in (each.kind, each.other)}
    assert "none" not in named


def test_a_tailored_kind_is_warned_about_because_people_of_one_arm_see_unequally_much(
    everything: Mapping[str, ArmReport],
) -> None:
    pictures = arm(everything["1"], "tailored_all", "experiment1-a").measures["pictures"]
    assert (
        pictures.lowest
        < pictures.highest
        == arm(everything["1"], "subgoals", "experiment1-a").measures["pictures"].mean
    )
    assert ("tailored_all", "pictures") in {(each.kind, each.measure) for each in everything["1"].confounds}


def test_a_single_kind_is_compared_with_nothing(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    without_plan(study)
    change(study / "study.toml", 'kinds = ["full", "subgoals", "random"]', 'kinds = ["full"]')
    version = plan_and_build(study, tmp_path / "instance").catalogue.version
    assert compare(tmp_path / "instance" / "bundles" / version)["1"].confounds == ()
