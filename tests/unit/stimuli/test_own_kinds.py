"""Kinds of explanation of a study's own: what they get, what they may return, and how they are found."""

import re
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import change, copy_study, plan_and_build, quietly, small_study
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build_error import BuildError
from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.scenes import Walk, stage, walk
from webapp.stimuli.sources import read_sources
from webapp.study.problems import StudyError
from webapp.study.session import Trial


def study_with(kind: str, folder: Path) -> Path:
    """The small study with a kind of its own, given by the body of its function."""
    study = small_study(folder)
    change(study / "study.toml", "[explanation]", '[kinds.mine]\nuse = "mine:choose"\n\n[explanation]')
    change(study / "study.toml", 'kinds = ["random"]', 'kinds = ["random", "mine"]')
    (study / "mine.py").write_text(f"def choose(task):\n    {kind}\n", encoding="utf-8")
    return study


def shown(catalogue: Catalogue) -> list[tuple[str, ...]]:
    trial = Trial("1", 1, 1, "experiment1-a", "mine", None)
    return [strip.actions for strip in catalogue.explanation(trial, "en")]


def test_an_own_kind_shows_the_pairs_of_the_steps_that_it_returns(tmp_path: Path) -> None:
    built = plan_and_build(study_with("return [1, task.path.num_steps]", tmp_path), tmp_path / "instance")
    (report,) = built.reports
    words = built.catalogue.action_name(built.catalogue.world("experiment1-a").path_actions[0], "en")
    assert shown(built.catalogue) == [(), (words,), ()]
    assert report.pictures["1"]["mine"] == (4, 4)


def test_an_own_kind_that_chooses_the_subgoals_is_told_to_be_like_them(tmp_path: Path) -> None:
    built = plan_and_build(study_with("return task.subgoals", tmp_path), tmp_path / "instance")
    assert built.reports[0].arms_like_subgoals == {"1": ("mine",)}


def test_an_own_kind_may_yield_its_steps_as_numpy_integers(tmp_path: Path) -> None:
    body = "import numpy as np\n    yield from np.arange(1, task.path.num_steps + 1)"
    built = plan_and_build(study_with(body, tmp_path), tmp_path / "instance")
    assert len(shown(built.catalogue)) == built.reports[0].num_steps + 1


def test_the_draws_of_an_own_kind_are_the_same_in_every_build(tmp_path: Path) -> None:
    body = "return sorted(task.rng.choice(task.path.num_steps, 2, replace=False) + 1)"
    builds = [plan_and_build(study_with(body, tmp_path / name), tmp_path / name) for name in ("a", "b")]
    assert shown(builds[0].catalogue) == shown(builds[1].catalogue)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("calls.append(1)\n    return [len(calls)]\ncalls = []", "draw with `rng`"),
        ("raise SystemExit(3)", "raised SystemExit: 3"),
    ],
)
def test_an_own_kind_that_chooses_otherwise_each_time_or_leaves_is_refused(
    tmp_path: Path, body: str, message: str
) -> None:
    study = study_with(body, tmp_path)
    with pytest.raises(BuildError, match=re.escape(message)):
        plan_and_build(study, tmp_path / "instance")


def test_an_own_kind_is_told_what_the_built_in_ones_know(tmp_path: Path) -> None:
    body = (
        "assert len(task.importance) == task.path.num_steps + 1 and task.importance[-1] == 0\n"
        "    assert task.importance.mean() < min(task.importance[step - 1] for step in task.subgoals)\n"
        "    assert task.num_pictures == sum(1 + (step < task.path.num_steps) for step in task.subgoals)\n"
        "    assert all(task.policy[state] == action for state, action in task.path.pairs)\n"
        "    assert task.layout == 'experiment1-a' and task.world.actions[0] == 'forward'\n"
        "    return task.subgoals[:1]"
    )
    built = plan_and_build(study_with(body, tmp_path), tmp_path / "instance")
    assert len(shown(built.catalogue)) == 2


@pytest.mark.parametrize("array", ["world.next_state", "world.terminal", "world.goal", "policy", "importance"])
def test_an_own_kind_cannot_change_the_world(array: str, tmp_path: Path) -> None:
    body = f"task.{array}[0] = 1\n    return [1]"
    with pytest.raises(BuildError, match="the kind 'mine' raised ValueError: assignment destination is read-only"):
        plan_and_build(study_with(body, tmp_path), tmp_path / "instance")


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("return []", "returned []"),
        ("return [0]", "returned [0]"),
        ("return [999]", "returned [999]"),
        ("return [2, 1]", "returned [2, 1]"),
        ("return [1, 1]", "returned [1, 1]"),
        ("return None", "returned None"),
        ("return [1.5]", "returned [1.5]"),
        ("return [True]", "returned [True]"),
        ("return 'ab'", "returned 'ab'"),
        ("return 1 / 0", "raised ZeroDivisionError: division by zero"),
        ("yield 1 / 0", "raised ZeroDivisionError: division by zero"),
    ],
)
def test_a_wrong_choice_stops_the_build_and_is_told(body: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(BuildError) as error:
        plan_and_build(study_with(body, tmp_path), tmp_path / "instance")
    message = str(error.value)
    assert message.startswith(f"layout 'experiment1-a': the kind 'mine' {told}")
    assert "raised" in told or re.search(r"it should return ascending steps from 1 to \d+, at least one$", message)


@pytest.mark.parametrize(
    ("module", "told"),
    [
        (None, "there is no module 'mine' beside the study file or among what is installed"),
        ("import there_is_none", "the module 'mine' cannot be imported: No module named 'there_is_none'"),
        ("x = 1 / 0", "the module 'mine' cannot be imported: ZeroDivisionError: division by zero"),
        ("def other(): ...", "the module 'mine' has no 'choose'"),
        ("choose = 3", "'mine:choose' is 3; it should be a function"),
    ],
)
def test_a_kind_that_cannot_be_loaded_is_told_with_its_line(module: str | None, told: str, tmp_path: Path) -> None:
    study = study_with("", tmp_path)
    (study / "mine.py").unlink()
    if module is not None:
        (study / "mine.py").write_text(module, encoding="utf-8")
    (line,) = [
        number
        for number, text in enumerate((study / "study.toml").read_text("utf-8").splitlines(), start=1)
        if "mine:choose" in text
    ]
    with pytest.raises(StudyError) as error:
        read_sources(study)
    assert error.value.problems == (f"{study / 'study.toml'}, line {line}: kinds.mine.use: {told}",)


def test_an_own_kind_needs_no_subgoals_ahead(tmp_path: Path) -> None:
    sources = read_sources(study_with("return [1 + len(task.subgoals) + task.num_pictures]", tmp_path))
    agent = planner_agents(sources, quietly).by_layout["experiment1-a"]
    way = walk("experiment1-a", agent, sources.study.explanation)
    experiment = sources.study.experiment("1").model_copy(update={"kinds": ("mine",)})
    behind = Walk(way.path, way.importance, subgoals=())
    scene = stage(sources.study, experiment, "experiment1-a", None, agent, behind, sources.kinds)
    assert [strip.states for strip in scene.explanations["mine"][0]] == [way.path.states[:1], way.path.states[:2]]


def test_a_step_is_shown_from_the_present_state_on_where_a_video_ends(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    change(study / "study.toml", "[explanation]", '[kinds.mine]\nuse = "mine:choose"\n\n[explanation]')
    change(study / "study.toml", '["all_key_points", ', '["mine", "all_key_points", ')
    (study / "mine.py").write_text("def choose(task):\n    return [1]\n", encoding="utf-8")
    catalogue = plan_and_build(study, tmp_path / "instance").catalogue
    trial = Trial("2", 1, 2, "experiment2-a", "mine", None)
    step = catalogue.from_step(trial)
    assert step > 1
    assert catalogue.explanation(trial, "en") == catalogue.strips_of("experiment2-a", [step], "en", step)
