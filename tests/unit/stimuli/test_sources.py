import json
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import SHIPPED, change, copy_study, set_languages, set_texts
from webapp.stimuli.sources import find_study, phrases, read_sources
from webapp.study.problems import StudyError
from webapp.study.texts import parse_texts


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
    assert list(sources.texts) == list(sources.step_phrases) == list(sources.study.languages)
    assert phrases(sources.texts["en"])["ahead"] == sources.texts["en"]("pictures.ahead")


def test_the_problems_of_all_files_are_told_at_once(folder: Path) -> None:
    (folder / "layouts" / "experiment1-a.txt").unlink()
    change(folder / "layouts" / "experiment1-b.txt", "#.K.#..#", "#...#..#")
    change(folder / "layouts" / "experiment1-c.txt", "#..D...#", "#..##..#")
    set_texts(folder, {"experiments.1.introduction": None, "experiments.1.title": "Layout {nummer}"})
    set_languages(folder, "en", "xx")
    (folder / "texts" / "xx.toml").unlink()
    lines = problems_of(folder).splitlines()
    assert [line.removeprefix(f"{folder}/") for line in lines] == [
        *[line.removeprefix(f"{folder}/") for line in lines if "no sentences in the language 'xx'" in line],
        "layouts/experiment1-a.txt: is missing",
        *[line.removeprefix(f"{folder}/") for line in lines if "experiment1-b.txt, line" in line and "no key" in line],
        *[line.removeprefix(f"{folder}/") for line in lines if "experiment1-c.txt, line" in line and "door" in line],
        "texts/en.toml: experiments.1.title: names the parameter {nummer}; it may use {num_trials}, {position}",
        "texts/en.toml: experiments.1.introduction: is missing",
        "texts/xx.toml: is missing",
    ]
    assert len(lines) == 7


def test_a_goal_that_cannot_be_reached_is_refused_with_its_place(folder: Path) -> None:
    change(folder / "layouts" / "experiment1-a.txt", "#...#.G#", "#...##G#")
    change(folder / "layouts" / "experiment1-a.txt", "#...D..#", "#...D.##")
    assert "experiment1-a.txt, line 7, column 7: the goal cannot be reached" in problems_of(folder)


def test_a_study_and_its_folder_have_one_name(folder: Path) -> None:
    change(folder / "study.toml", 'name = "sakai2021"', 'name = "sakai2022"')
    assert "name: is 'sakai2022' in the folder 'sakai2021'; use one name" in problems_of(folder)


def test_phrases_that_say_the_same_of_different_pictures_are_refused(folder: Path) -> None:
    set_texts(folder, {"pictures.holds_key": "the same", "pictures.holds_no_key": "the same"})
    assert f"{folder}/texts/en.toml: pictures: the phrases 'holds_key', 'holds_no_key' say the same" in problems_of(
        folder
    )


def test_a_language_without_sentences_is_refused_with_its_place(folder: Path) -> None:
    set_languages(folder, "en", "xx")
    (line,) = [line for line in problems_of(folder).splitlines() if line.startswith(f"{folder}/study.toml")]
    assert line.endswith(": languages[2]: there are no sentences in the language 'xx'; use en or ja")
    assert line.startswith(f"{folder}/study.toml, line ")


@pytest.fixture
def shared(folder: Path) -> Path:
    """A folder of texts that all studies share: all that the shipped study needs in English but its facts."""
    set_languages(folder, "en")
    file = folder.parent / "texts" / "en.toml"
    file.parent.mkdir()
    texts = read_sources(folder).texts["en"].entries
    lines = [f"{json.dumps(key)} = {json.dumps(text)}\n" for key, text in texts.items() if not key.startswith("facts")]
    file.write_text("".join(lines), encoding="utf-8")
    return file.parent


FACTS = """
[facts]
goal = "It goes for the goal."
key_and_door = "It needs the key."
places_change = "Places change."
"""


def test_a_studys_own_texts_add_to_those_that_all_studies_share(folder: Path, shared: Path) -> None:
    (folder / "texts" / "en.toml").write_text(FACTS, encoding="utf-8")
    texts = read_sources(folder, shared).texts["en"]
    assert texts("facts.goal") == "It goes for the goal."
    assert texts("actions.left") == parse_texts((shared / "en.toml").read_text(encoding="utf-8"), "en", "")(
        "actions.left"
    )


def test_a_studys_own_text_takes_the_place_of_the_shared_one(folder: Path, shared: Path) -> None:
    (folder / "texts" / "en.toml").write_text(f'[actions]\nleft = "turn to port"\n{FACTS}', encoding="utf-8")
    texts = read_sources(folder, shared).texts["en"]
    assert texts("actions.left") == "turn to port"
    assert texts("actions.right") != texts("actions.left")


def test_what_is_missing_is_missing_from_the_studys_own_texts(folder: Path, shared: Path) -> None:
    (folder / "texts" / "en.toml").write_text(FACTS.replace("goal =", "gaol ="), encoding="utf-8")
    with pytest.raises(StudyError) as error:
        read_sources(folder, shared)
    assert error.value.problems == (
        f"{folder}/texts/en.toml, line 3: facts.gaol: nothing uses it; did you mean 'facts.goal', which is missing?",
    )


def test_what_is_wrong_with_a_shared_text_is_told_of_the_shared_file(folder: Path, shared: Path) -> None:
    change(shared / "en.toml", '"study.title" = "', '"study.title" = "{nonsense} ')
    (folder / "texts" / "en.toml").write_text(FACTS, encoding="utf-8")
    with pytest.raises(StudyError) as error:
        read_sources(folder, shared)
    assert error.value.problems == (
        f"{shared}/en.toml: study.title: names the parameter {{nonsense}}; it may use none",
    )


def test_shared_texts_do_not_stand_in_for_a_studys_own_file(folder: Path, shared: Path) -> None:
    (folder / "texts" / "en.toml").unlink()
    with pytest.raises(StudyError, match=r"sakai2021/texts/en\.toml: is missing"):
        read_sources(folder, shared)


def test_a_language_that_studies_do_not_share_is_all_the_studys(folder: Path, shared: Path, tmp_path: Path) -> None:
    (folder / "texts" / "en.toml").write_text((shared / "en.toml").read_text(encoding="utf-8") + FACTS, "utf-8")
    assert read_sources(folder, tmp_path / "nothing").texts["en"]("facts.goal") == "It goes for the goal."


def test_a_file_that_is_not_text_is_refused(folder: Path) -> None:
    (folder / "texts" / "en.toml").write_bytes(b"\xff\xfe\x00")
    assert "en.toml: cannot be read as UTF-8 text" in problems_of(folder)


def test_a_folder_without_a_study_file_is_refused(tmp_path: Path) -> None:
    assert problems_of(tmp_path) == f"{tmp_path / 'study.toml'}: is missing"


def test_a_study_is_found_by_its_name_or_its_folder(folder: Path) -> None:
    assert find_study("sakai2021") == SHIPPED
    assert find_study(str(folder)) == folder
    with pytest.raises(StudyError, match=r"there is no study 'sakai1999'; use .*sakai2021.* or a folder"):
        find_study("sakai1999")
