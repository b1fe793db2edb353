"""Every language in which a study can be read says as much as English, where the texts were first written."""

import re
from pathlib import Path

import pytest

from tests.worlds import reachable_states
from webapp.explainer.pictures.words import PHRASES, describe
from webapp.explainer.worlds.layout import parse_layout
from webapp.explainer.worlds.view import View, egocentric_view
from webapp.stimuli.sources import SHARED_TEXTS, STUDIES
from webapp.study.page_texts import PAGE_TEXTS
from webapp.study.plurals import plural_categories
from webapp.study.protocol import parse_study
from webapp.study.texts import Texts, parse_texts

FOLDERS = [SHARED_TEXTS, *sorted(STUDIES.glob("*/texts"))]
TRANSLATIONS = [file for folder in FOLDERS for file in sorted(folder.glob("*.toml")) if file.stem != "en"]
STUDY_FILES = sorted(STUDIES.glob("*/study.toml"))
PLURALS = {key for key, wanted in PAGE_TEXTS.items() if wanted.is_plural}

PARAMETER = re.compile(r"\{[^}]*\}")
OWN_LETTERS = {"ja": re.compile(r"[\u3041-\u30fa\u4e00-\u9fff]")}
"""By language, letters that English has not; in Japanese kana and kanji."""


def read(file: Path) -> Texts:
    return parse_texts(file.read_text(encoding="utf-8"), file.stem, str(file))


def name_of(file: Path) -> str:
    return file.relative_to(STUDIES).as_posix()


def without_plural_forms(texts: Texts) -> set[str]:
    return {key.rpartition(".")[0] if key.rpartition(".")[0] in PLURALS else key for key in texts.entries}


def parts(entry: str | tuple[str, ...]) -> tuple[str, ...]:
    return (entry,) if isinstance(entry, str) else entry


def words(text: str) -> str:
    """Return a text's letters, without those of its parameters."""
    return "".join(letter for letter in PARAMETER.sub("", text) if letter.isalpha())


@pytest.fixture(params=TRANSLATIONS, ids=name_of)
def pair(request: pytest.FixtureRequest) -> tuple[Texts, Texts]:
    """A file in English, and the same in another language."""
    return read(request.param.with_name("en.toml")), read(request.param)


@pytest.mark.parametrize("file", STUDY_FILES, ids=name_of)
def test_every_language_of_a_study_has_a_file_beside_each_english_one(file: Path) -> None:
    languages = parse_study(file.read_text(encoding="utf-8")).languages
    for folder in (SHARED_TEXTS, file.parent / "texts"):
        assert {entry.stem for entry in folder.glob("*.toml")} >= {"en", *languages}


def test_both_studies_can_be_read_in_japanese() -> None:
    assert {name_of(file) for file in TRANSLATIONS} >= {
        "texts/ja.toml",
        "sakai2021/texts/ja.toml",
        "understanding/texts/ja.toml",
    }


def test_the_same_is_said_in_every_language(pair: tuple[Texts, Texts]) -> None:
    english, other = pair
    assert without_plural_forms(other) == without_plural_forms(english)


def test_a_text_that_depends_on_a_number_has_just_the_forms_of_its_language(pair: tuple[Texts, Texts]) -> None:
    for texts in pair:
        for plural in PLURALS & without_plural_forms(texts):
            forms = {form for key, _, form in (entry.rpartition(".") for entry in texts.entries) if key == plural}
            assert forms == set(plural_categories(texts.language)), plural


def test_a_list_has_as_many_texts_in_every_language(pair: tuple[Texts, Texts]) -> None:
    english, other = pair
    for key in english.entries.keys() & other.entries.keys():
        assert isinstance(other.entries[key], str) == isinstance(english.entries[key], str), key
        assert len(parts(other.entries[key])) == len(parts(english.entries[key])), key


def test_no_parameter_is_lost_or_added_by_a_translation(pair: tuple[Texts, Texts]) -> None:
    english, other = pair
    for key in english.entries.keys() & other.entries.keys():
        for original, translated in zip(parts(english.entries[key]), parts(other.entries[key]), strict=True):
            assert sorted(PARAMETER.findall(translated)) == sorted(PARAMETER.findall(original)), key


def test_no_text_is_left_in_english(pair: tuple[Texts, Texts]) -> None:
    english, other = pair
    for key, entry in other.entries.items():
        originals = parts(english.entries.get(key, ()))
        for text in filter(words, parts(entry)):
            assert text not in originals, key
            assert other.language not in OWN_LETTERS or OWN_LETTERS[other.language].search(text), key


def shipped_views() -> set[View]:
    maps = {file.read_text(encoding="utf-8") for file in STUDIES.glob("*/layouts/*.txt")}
    return {egocentric_view(layout, state) for layout in map(parse_layout, maps) for state in reachable_states(layout)}


def test_pictures_differ_in_words_in_every_language_exactly_where_they_do_in_english() -> None:
    views = shipped_views()
    assert len(views) > 100
    told = {}
    for file in sorted(SHARED_TEXTS.glob("*.toml")):
        phrases = {key: str(read(file).entries[f"pictures.{key}"]) for key in PHRASES}
        told[file.stem] = [describe(view, phrases) for view in views]
    for texts in told.values():
        assert len(set(texts)) == len(set(told["en"])) == len(set(zip(texts, told["en"], strict=True)))
