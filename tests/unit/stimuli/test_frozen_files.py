"""All that a study's own code may read lies in the study's folder, and all of that folder is kept with the study."""

import os
import sys
from collections.abc import Callable
from datetime import date
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import files_of, plan_and_build, quietly, small_study
from tests.unit.stimuli.test_own_kinds import shown, study_with
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import Built, find_built
from webapp.stimuli.checking import check_study
from webapp.stimuli.frozen_files import MAX_FILE_BYTES, MAX_FOLDER_BYTES, folder_problems
from webapp.stimuli.plug_ins import study_modules
from webapp.stimuli.sources import read_sources
from webapp.stimuli.verification import verify
from webapp.study.problems import StudyError

HERE = "import pathlib\n    here = pathlib.Path(__file__).parent\n    "
BODIES = {
    "steps.txt": f"{HERE}return [int((here / 'steps.txt').read_text())]",
    "data/steps.txt": f"{HERE}return [int((here / 'data/steps.txt').read_text())]",
    "step_data.py": "import step_data\n    return [step_data.STEP]",
    "parts/steps.py": "from parts import steps\n    return [steps.STEP]",
    "whole/__init__.py": "import whole\n    return [whole.STEP]",
    "whole/inner/steps.py": "from whole.inner.steps import STEP\n    return [STEP]",
}


def write(file: Path, text: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return small_study(tmp_path)


@pytest.mark.parametrize("name", BODIES)
def test_what_own_code_reads_in_the_folder_is_kept_noticed_when_it_changes_and_used_to_verify(
    name: str, tmp_path: Path
) -> None:
    study, instance = study_with(BODIES[name], tmp_path), tmp_path / "instance"
    line = "{}\n" if name.endswith(".txt") else "STEP = {}\n"

    def built_with(step: int) -> Built:
        write(study / name, line.format(step))
        return plan_and_build(study, instance)

    # The second text has the length of the first and follows within a second: Python's own caches would not notice.
    first, second, again = built_with(1), built_with(2), built_with(1)
    assert (first.is_new, second.is_new, again.is_new) == (True, True, False)
    assert first.catalogue.version == again.catalogue.version != second.catalogue.version
    assert shown(first.catalogue) != shown(second.catalogue)
    for built, step in ((first, 1), (second, 2)):
        folder = instance / "bundles" / built.catalogue.version
        assert (folder / "sources/study" / name).read_text("utf-8") == line.format(step)
        assert verify(folder, "stored", quietly).is_proven


def test_everything_in_the_folder_is_kept_but_what_is_hidden_and_what_python_writes(
    study: Path, tmp_path: Path
) -> None:
    kept = [*files_of(study), "notes.md", "data/empty", "data/日本.csv"]
    for name in kept:
        if not (study / name).exists():
            write(study / name, "")
    before = plan_and_build(study, tmp_path / "instance").catalogue.version
    sources = tmp_path / "instance/bundles" / before / "sources/study"
    assert files_of(sources) == files_of(study)
    assert sorted(files_of(sources)) == sorted(kept)
    for name in (".git/config", ".notes.md", "__pycache__/own.pyc", "data/__pycache__/own.pyc", "data/.hidden"):
        write(study / name, "not kept")
    (study / ".#study.toml").symlink_to("an-editor-writes-such-a-lock")
    again = plan_and_build(study, tmp_path / "instance")
    assert (again.is_new, again.catalogue.version) == (False, before)


def link_to_file(study: Path) -> Path:
    write(study.parent / "elsewhere.py", "")
    (study / "linked.py").symlink_to(study.parent / "elsewhere.py")
    return study / "linked.py"


def link_to_folder(study: Path) -> Path:
    (study.parent / "elsewhere").mkdir()
    (study / "data").symlink_to(study.parent / "elsewhere")
    return study / "data"


def link_to_nothing(study: Path) -> Path:
    (study / "texts/nothing.toml").symlink_to("nowhere")
    return study / "texts/nothing.toml"


def pipe(study: Path) -> Path:
    os.mkfifo(study / "pipe")
    return study / "pipe"


def large_file(study: Path) -> Path:
    with (study / "large.npy").open("wb") as file:
        file.truncate(MAX_FILE_BYTES + 100_000)
    return study / "large.npy"


LINK = "{}: is a symbolic link; put the file itself into the study's folder"


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (link_to_file, LINK),
        (link_to_folder, LINK),
        (link_to_nothing, LINK),
        (pipe, "{}: is no regular file; move it out of the study's folder"),
        (large_file, "{}: has 5.1 MB; a file of a study has at most 5 MB"),
    ],
)
def test_what_cannot_be_kept_is_refused_by_check_and_build(
    make: Callable[[Path], Path], problem: str, study: Path, tmp_path: Path
) -> None:
    told = (problem.format(make(study)),)
    with pytest.raises(StudyError) as error:
        read_sources(study)
    assert error.value.problems == told
    with pytest.raises(StudyError) as error:
        check_study(study, tmp_path / "instance", date(2026, 11, 27))
    assert error.value.problems == told
    with pytest.raises(StudyError) as error:
        plan_and_build(study, tmp_path / "instance")
    assert error.value.problems == told


@pytest.mark.parametrize("name", ["a\nb.txt", os.fsdecode(b"\xff.txt")])
def test_a_name_that_no_list_of_files_can_hold_is_refused(name: str, study: Path) -> None:
    write(study / name, "")
    (problem,) = folder_problems(study)
    assert problem.endswith("has characters in its name that cannot be kept; rename it")
    problem.encode()


def test_a_folder_that_is_too_large_is_refused_as_a_whole(study: Path) -> None:
    for number in range(MAX_FOLDER_BYTES // MAX_FILE_BYTES):
        with (study / f"{number}.bin").open("wb") as file:
            file.truncate(MAX_FILE_BYTES)
    (problem,) = folder_problems(study)
    assert problem.startswith(f"{study}: has 50")
    assert problem.endswith("MB of files; all of it is kept with the study, so use at most 50 MB")


def test_an_instance_within_the_folder_is_refused_before_its_secrets_are_read(study: Path) -> None:
    instance = study / "instance"
    write(instance / "secret_key", "secret")
    wish = "the instance lies in the study's folder, all of which is kept with the study; move it out"
    with pytest.raises(StudyError, match=wish):
        plan_and_build(study, instance)
    with pytest.raises(StudyError, match=wish):
        find_built(study, instance, planner_agents)
    assert sorted(path.name for path in instance.iterdir()) == ["secret_key"]


def test_folders_of_modules_are_forgotten_like_modules(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / name / "parts/steps.py", f"STEP = {name!r}")
    found, before = [], set(sys.modules)
    for name in ("a", "b"):
        with study_modules(tmp_path / name):
            from parts import steps  # type: ignore[import-not-found]  # noqa: PLC0415 - it is there only here.

            found.append(steps.STEP)
    assert found == ["a", "b"]
    assert set(sys.modules) == before
