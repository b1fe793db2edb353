"""The list of texts that pages need, against the pages themselves."""

import re
from pathlib import Path

import pytest

from webapp.study.page_texts import PAGE_TEXTS
from webapp.study.protocol import parse_study
from webapp.study.texts import Texts, parse_texts, study_texts

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "webapp" / "studies" / "sakai2021"
STUDY = parse_study((FOLDER / "study.toml").read_text(encoding="utf-8"))
TEXTS = parse_texts((FOLDER / "texts" / "en.toml").read_text(encoding="utf-8"), "en", "en.toml")
TEMPLATES = [path for path in (ROOT / "templates").rglob("*.html") if path.parent.name != "researcher"]
SOURCES = {path: path.read_text(encoding="utf-8") for path in (*TEMPLATES, *(ROOT / "webapp" / "views").glob("*.py"))}
LITERALS = [
    literal for source in SOURCES.values() for literal in re.findall(r"""["']([a-z_]+(?:\.[a-z_]+)+)["']""", source)
]
CALLS = [
    (call, key, path)
    for path, source in SOURCES.items()
    for call, key in re.findall(r"""\bt(\.list)?\(\s*["']([a-z_.]+)["']\s*[,)]""", source)
]


def test_every_text_that_a_page_asks_for_is_in_the_list_with_its_shape() -> None:
    assert len(CALLS) > 50
    for call, key, path in CALLS:
        assert key in PAGE_TEXTS, f"{path.name} asks for {key}"
        assert PAGE_TEXTS[key].is_list == bool(call), f"{path.name} asks for {key}"


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
    assert filled or key.startswith("errors.rating_"), "the views fill those in by way of a table"


def test_the_paper_is_quoted_word_for_word() -> None:
    assert TEXTS.item("likeliness", "1").legend == "Could you predict the route that the agent took?"
    assert (
        TEXTS.item("likeliness", "2").legend == "Did you understand the reason for the next action taken by the agent?"
    )
    for experiment in ("1", "2"):
        assert TEXTS.item("loveliness", experiment).legend == "Was it a succinct explanation?"
        assert TEXTS.item("general", experiment).legend == "Comprehensive evaluation of explanation"


def test_a_study_needs_a_wording_for_every_fact_experiment_and_item() -> None:
    required = study_texts(STUDY, TEXTS)
    assert {f"facts.{fact}" for fact in STUDY.facts} <= required.keys() <= TEXTS.entries.keys()
    assert {"items.likeliness.1", "items.likeliness.2", "items.general", "experiments.2.title"} <= required.keys()
    without = Texts("en", {key: text for key, text in TEXTS.entries.items() if key != "items.general"})
    assert {"items.general.1", "items.general.2"} <= study_texts(STUDY, without).keys()


def test_the_shipped_texts_hold_nothing_that_nobody_reads() -> None:
    known = PAGE_TEXTS.keys() | study_texts(STUDY, TEXTS).keys()
    others = {key for key in TEXTS.entries if not key.startswith(("pictures.", "actions."))}
    assert others <= known
