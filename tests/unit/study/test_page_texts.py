"""The list of texts that pages need, against the pages themselves."""

import re
from pathlib import Path

import pytest

from webapp.study.page_texts import PAGE_TEXTS
from webapp.study.plurals import plural_categories
from webapp.study.protocol import parse_study
from webapp.study.study_texts import study_texts
from webapp.study.texts import Texts, Wanted, check_texts, parse_texts

ROOT = Path(__file__).parents[3]
STUDIES = ROOT / "webapp" / "studies"
SHIPPED = {
    path.parent.name: parse_study(path.read_text(encoding="utf-8")) for path in sorted(STUDIES.glob("*/study.toml"))
}
EVERY_LANGUAGE = [(name, language) for name, study in SHIPPED.items() for language in study.languages]
TEMPLATES = [path for path in (ROOT / "templates").rglob("*.html") if path.parent.name != "researcher"]
SOURCES = {path: path.read_text(encoding="utf-8") for path in (*TEMPLATES, *(ROOT / "webapp" / "views").glob("*.py"))}
LITERALS = {
    literal for source in SOURCES.values() for literal in re.findall(r"""["']([a-z_]+(?:\.[a-z_]+)+)["']""", source)
}
CALLS = [
    (call, key, path)
    for path, source in SOURCES.items()
    for call, key in re.findall(r"""\bt(?:exts\(\))?(\.list|\.plural)?\(\s*["']([a-z_.]+)["']\s*[,)]""", source)
]
OF_OTHERS = ("pictures.", "actions.")
"""What the build needs to put pictures and actions into words; the catalogue's own list names it."""


def read_texts(*files: Path, language: str = "en") -> Texts:
    """The texts of language files, a later one's in place of an earlier one's."""
    entries = {
        key: entry
        for file in files
        for key, entry in parse_texts(file.read_text(encoding="utf-8"), language, file.name).entries.items()
    }
    return Texts(language, entries)


def shipped_texts(name: str, language: str = "en") -> Texts:
    return read_texts(
        STUDIES / "texts" / f"{language}.toml", STUDIES / name / "texts" / f"{language}.toml", language=language
    )


def keys_of(wanted: dict[str, Wanted], language: str) -> set[str]:
    """The keys of the texts themselves: of a text that depends on a number, those of its forms."""
    forms = {
        key: [f".{name}" for name in plural_categories(language)] if text.is_plural else [""]
        for key, text in wanted.items()
    }
    return {key + form for key, endings in forms.items() for form in endings}


def test_every_text_that_a_page_asks_for_is_in_the_list_with_its_shape() -> None:
    assert len(CALLS) > 100
    for call, key, path in CALLS:
        assert key in PAGE_TEXTS, f"{path.name} asks for {key}"
        assert PAGE_TEXTS[key].is_list == (call == ".list"), f"{path.name} asks for {key}"
        assert PAGE_TEXTS[key].is_plural == (call == ".plural"), f"{path.name} asks for {key}"


@pytest.mark.parametrize("key", sorted(PAGE_TEXTS))
def test_no_text_is_in_the_list_that_no_page_asks_for(key: str) -> None:
    assert key in LITERALS


@pytest.mark.parametrize("key", sorted(key for key, wanted in PAGE_TEXTS.items() if wanted.parameters))
def test_pages_fill_in_the_parameters_that_the_list_promises(key: str) -> None:
    filled = [
        set(re.findall(r"\b([a-z_]+)=(?!=)", arguments))
        for source in SOURCES.values()
        for arguments in re.findall(rf"""["']{re.escape(key)}["']\s*,((?:[^()]|\([^()]*\))*)\)""", source)
    ]
    assert all(names == PAGE_TEXTS[key].parameters for names in filled), filled
    assert filled or key.startswith("errors."), "the views fill those in by way of a table"


def test_the_paper_is_quoted_word_for_word() -> None:
    texts = shipped_texts("sakai2021")
    assert texts.item("likeliness", "1").legend == "Could you predict the route that the agent took?"
    assert (
        texts.item("likeliness", "2").legend == "Did you understand the reason for the next action taken by the agent?"
    )
    for experiment in ("1", "2"):
        assert texts.item("loveliness", experiment).legend == "Was it a succinct explanation?"
        assert texts.item("general", experiment).legend == "Comprehensive evaluation of explanation"


def test_a_study_needs_a_wording_for_every_fact_experiment_and_item() -> None:
    study, texts = SHIPPED["sakai2021"], shipped_texts("sakai2021")
    required = study_texts(study, texts)
    assert {f"facts.{fact}" for fact in study.facts} <= required.keys() <= texts.entries.keys()
    assert {"items.likeliness.1", "items.likeliness.2", "items.general", "experiments.2.title"} <= required.keys()
    without = Texts("en", {key: text for key, text in texts.entries.items() if key != "items.general"})
    assert {"items.general.1", "items.general.2"} <= study_texts(study, without).keys()


def test_a_study_needs_a_wording_for_every_question_choice_and_disclosure() -> None:
    study = SHIPPED["understanding"]
    required = study_texts(study, shipped_texts("understanding")).keys()
    assert study.background is not None
    assert study.quiz is not None
    for question in study.background.questions:
        assert f"background.{question.id}.question" in required
        assert {f"background.{question.id}.choices.{choice}" for choice in question.choices} <= required
    for quizzed in study.quiz.questions:
        assert {f"quiz.{quizzed.id}.question", f"quiz.{quizzed.id}.feedback"} <= required
        assert {f"quiz.{quizzed.id}.choices.{choice}" for choice in quizzed.choices} <= required
    assert "debriefing.placebic" in required
    without = study.model_copy(update={"background": None, "quiz": None})
    left = {key.split(".")[0] for key in study_texts(without, shipped_texts("understanding"))}
    assert left == {"facts", "experiments", "items", "scales", "debriefing"}


@pytest.mark.parametrize(("name", "language"), EVERY_LANGUAGE)
def test_the_shipped_studies_have_every_text_in_every_language(name: str, language: str) -> None:
    texts = shipped_texts(name, language)
    wanted = {**PAGE_TEXTS, **study_texts(SHIPPED[name], texts)}
    assert check_texts(texts, wanted, f"{language}.toml") == ()


@pytest.mark.parametrize(("name", "language"), EVERY_LANGUAGE)
def test_every_language_has_the_same_lists_as_the_first(name: str, language: str) -> None:
    def lengths(texts: Texts) -> dict[str, int]:
        return {key: len(entry) for key, entry in texts.entries.items() if isinstance(entry, tuple)}

    assert lengths(shipped_texts(name, language)) == lengths(shipped_texts(name))


@pytest.mark.parametrize("language", sorted({language for _, language in EVERY_LANGUAGE}))
def test_the_shipped_texts_hold_nothing_that_nobody_reads(language: str) -> None:
    known = keys_of(dict(PAGE_TEXTS), language)
    for name, study in SHIPPED.items():
        known |= keys_of(study_texts(study, shipped_texts(name, language)), language)
    for folder in (STUDIES, *(STUDIES / name for name in SHIPPED)):
        texts = read_texts(folder / "texts" / f"{language}.toml", language=language)
        assert {key for key in texts.entries if not key.startswith(OF_OTHERS)} <= known, folder


@pytest.mark.parametrize("name", SHIPPED)
def test_texts_of_a_study_are_not_those_that_all_share(name: str) -> None:
    shared = read_texts(STUDIES / "texts" / "en.toml").entries
    own = read_texts(STUDIES / name / "texts" / "en.toml").entries
    assert [key for key, entry in own.items() if shared.get(key) == entry] == []


@pytest.mark.parametrize(("name", "language"), EVERY_LANGUAGE)
def test_a_text_that_depends_on_a_number_has_a_form_for_every_number(name: str, language: str) -> None:
    texts = shipped_texts(name, language)
    for key, wanted in PAGE_TEXTS.items():
        if wanted.is_plural:
            assert texts.plural(key, 1)
            for number in (0, 2, 5, 21):
                assert str(number) in texts.plural(key, number)


def test_the_satisfaction_scale_has_its_nine_items_and_five_labels() -> None:
    for name, language in EVERY_LANGUAGE:
        texts = shipped_texts(name, language)
        assert [len(texts.list(f"satisfaction.{part}")) for part in ("items", "labels")] == [9, 5]
