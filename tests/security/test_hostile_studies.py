"""A study file that somebody made to do harm is refused in a line, at once."""

import time
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import copy_study
from webapp.stimuli.sources import read_sources
from webapp.study.problems import MAX_BYTES, StudyError
from webapp.study.protocol import MAX_TOLD, parse_study
from webapp.study.texts import parse_texts

BOMBS = {
    "lists within lists": "x = " + "[" * 100_000,
    "closed lists within lists": "x = " + "[" * 3_000 + "]" * 3_000,
    "tables within tables": "x = " + "{a=" * 3_000 + "1" + "}" * 3_000,
    "a long number": "x = " + "9" * 10_000,
    "a key of many parts": ".".join("a" * 20_000) + " = 1",
    "a table of many parts": "[" + ".".join("a" * 20_000) + "]",
    "ten megabytes": "x = '" + "y" * 10_000_000 + "'",
    "an alias, which only YAML has": "x = &a [1]\ny = *a",
    "a control character": 'x = "\x00"',
}
"""Each makes some reader of such files run out of stack, time or memory."""

TRAVERSALS = (
    "../../../etc/passwd",
    "/etc/passwd",
    "..",
    "a/../b",
    "\\\\host\\share",
    "C:\\x",
    "a\x00b",
    "%2e%2e/x",
    "~root",
)


@pytest.mark.parametrize("bomb", BOMBS.values(), ids=BOMBS)
def test_a_bomb_is_refused_in_a_line_at_once(bomb: str) -> None:
    for read in (lambda: parse_study(bomb, "study.toml"), lambda: parse_texts(bomb, "en", "en.toml")):
        began = time.perf_counter()
        with pytest.raises(StudyError) as refusal:
            read()
        assert time.perf_counter() - began < 0.5  # 0.1 s where nothing else runs.
        assert len(refusal.value.problems) == 1
        assert len(str(refusal.value)) < 300


def test_of_thousands_of_problems_the_first_are_told_and_the_rest_counted() -> None:
    text = "\n".join(f"k{number} = 1" for number in range(3_000))
    began = time.perf_counter()
    with pytest.raises(StudyError, match="further problems") as refusal:
        parse_study(text)
    assert time.perf_counter() - began < 5
    assert len(refusal.value.problems) == MAX_TOLD + 1


def test_a_large_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    with (study / "study.toml").open("a") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(StudyError, match=f"has {MAX_BYTES + 1} bytes; a file of a study has at most {MAX_BYTES}"):
        read_sources(study)


@pytest.mark.parametrize("name", TRAVERSALS)
def test_no_name_in_a_study_leads_out_of_its_folder(tmp_path: Path, name: str) -> None:
    study = copy_study(tmp_path)
    file = study / "study.toml"
    said = name.replace("\\", "\\\\").replace("\x00", "\\u0000")
    original = file.read_text(encoding="utf-8")
    for old, new in (
        ("experiment1-a", said),
        ('languages = ["en"', f'languages = ["{said}"'),
        ('name = "sakai2021"', f'name = "{said}"'),
    ):
        assert old in original
        file.write_text(original.replace(old, new), encoding="utf-8")
        with pytest.raises(StudyError) as refusal:
            read_sources(study)
        assert "root:" not in str(refusal.value)
        assert "should" in str(refusal.value) or "use " in str(refusal.value)


def test_a_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    layout = next((study / "layouts").glob("*.txt"))
    layout.unlink()
    layout.symlink_to("/etc/passwd")
    with pytest.raises(StudyError) as refusal:
        read_sources(study)
    assert "is a symbolic link" in str(refusal.value)
    assert "root:" not in str(refusal.value)


def test_the_shipped_study_is_read(tmp_path: Path) -> None:
    """The control."""
    assert read_sources(copy_study(tmp_path)).study.name == "sakai2021"
