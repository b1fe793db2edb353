from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import SHIPPED, change, copy_study
from webapp.stimuli.sources import find_study, phrases, read_sources
from webapp.study.problems import StudyError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return copy_study(tmp_path)


def problems_of(folder: Path) -> str:
    with pytest.raises(StudyError) as error:
        read_sources(folder)
    return str(error.value)


def test_the_shipped_study_has_all_it_needs(folder: Path) -> None:
    sources = read_sources(folder)
    assert list(sources.layouts) == list(sources.study.layouts)
    assert list(sources.texts) == ["en"]
    assert phrases(sources.texts["en"])["ahead"] == sources.texts["en"]("pictures.ahead")


def test_the_problems_of_all_files_are_told_at_once(folder: Path) -> None:
    (folder / "layouts" / "experiment1-a.txt").unlink()
    change(folder / "layouts" / "experiment1-b.txt", "#.K.#..#", "#...#..#")
    change(folder / "layouts" / "experiment1-c.txt", "#..D...#", "#..##..#")
    change(folder / "texts" / "en.toml", 'skip = "Skip to the content"\n', "")
    change(folder / "texts" / "en.toml", 'step = "Step {number} of', 'step = "Step {nummer} of')
    change(folder / "study.toml", 'languages = ["en"]', 'languages = ["en", "xx"]')
    lines = problems_of(folder).splitlines()
    assert [line.removeprefix(f"{folder}/") for line in lines] == [
        "layouts/experiment1-a.txt: is missing",
        *[line.removeprefix(f"{folder}/") for line in lines if "experiment1-b.txt, line" in line and "no key" in line],
        *[line.removeprefix(f"{folder}/") for line in lines if "experiment1-c.txt, line" in line and "door" in line],
        "texts/en.toml: page.skip: is missing",
        "texts/en.toml: page.step: names the parameter {nummer}; it may use {number}, {total}",
        "texts/xx.toml: is missing",
    ]
    assert len(lines) == 6


def test_a_goal_that_cannot_be_reached_is_refused_with_its_place(folder: Path) -> None:
    change(folder / "layouts" / "experiment1-a.txt", "#...#.G#", "#...##G#")
    change(folder / "layouts" / "experiment1-a.txt", "#...D..#", "#...D.##")
    assert "experiment1-a.txt, line 7, column 7: the goal cannot be reached" in problems_of(folder)


def test_a_study_and_its_folder_have_one_name(folder: Path) -> None:
    change(folder / "study.toml", 'name = "sakai2021"', 'name = "sakai2022"')
    assert "name: is 'sakai2022' in the folder 'sakai2021'; use one name" in problems_of(folder)


def test_phrases_that_say_the_same_of_different_pictures_are_refused(folder: Path) -> None:
    change(
        folder / "texts" / "en.toml",
        'holds_no_key = "the agent holds no key"',
        'holds_no_key = "the agent holds the key"',
    )
    assert "the phrases 'holds_key', 'holds_no_key' say the same" in problems_of(folder)


def test_a_file_that_is_not_text_is_refused(folder: Path) -> None:
    (folder / "texts" / "en.toml").write_bytes(b"\xff\xfe\x00")
    assert "en.toml: cannot be read as UTF-8 text" in problems_of(folder)


def test_a_folder_without_a_study_file_is_refused(tmp_path: Path) -> None:
    assert problems_of(tmp_path) == f"{tmp_path / 'study.toml'}: is missing"


def test_a_study_is_found_by_its_name_or_its_folder(folder: Path) -> None:
    assert find_study("sakai2021") == SHIPPED
    assert find_study(str(folder)) == folder
    with pytest.raises(StudyError, match="there is no study 'sakai1999'; use sakai2021, or a folder"):
        find_study("sakai1999")
