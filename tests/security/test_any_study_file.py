"""Whatever stands in a file of a study: it is read, or refused in words; nothing else ends the reader, and soon."""

import re
import time
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import ROOT
from webapp.explainer.worlds.layout import LayoutError, parse_layout
from webapp.study.problems import StudyError
from webapp.study.protocol import Study, parse_study
from webapp.study.texts import Texts, parse_texts

STUDY = ROOT / "webapp/studies/sakai2021"
NUM_EXAMPLES = 150
LONGEST_S = 5.0
"""A hundredth of it where nothing else runs."""

PIECES = st.sampled_from(
    (
        "[", "]", "[[", "]]", "{", "}", "=", ".", ",", '"', "'", '"""', "'''", "#", "\n", "\r", "\t", "\\", "\\u0000",
        "\\x", '"\\u001b[2J" = 1', "\0", "\x1b[2J", "\x7f", "\u202e", "\ufeff", "\ud800", "0x", "1e999", "nan",
        "-inf", "1_0", "9" * 400, "true", "1979-05-27T07:32:00Z", "experiments", "[[experiments]]", "kinds = []",
        "items", "name", "{0}", "{name.__class__}", "{{", "{}", "%", "languages", "é" * 300, "a = " * 50, "../..",
    )
)  # fmt: skip
TREE = st.recursive(
    st.booleans() | st.integers() | st.floats() | st.text(max_size=12),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)
MOVES_A_CURSOR = r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]"

READERS: dict[str, tuple[str, Callable[[str], Study | Texts | object]]] = {
    "study": (STUDY.joinpath("study.toml").read_text(encoding="utf-8"), parse_study),
    "texts": (
        STUDY.joinpath("../texts/en.toml").read_text(encoding="utf-8"),
        lambda text: parse_texts(text, "en", "en.toml"),
    ),
    "layout": (next(STUDY.joinpath("layouts").glob("*.txt")).read_text(encoding="utf-8"), parse_layout),
}


def outcome(read: Callable[[str], object], text: str) -> str:
    """Return what a reader says of a text; empty if it takes it.

    Raises:
        Exception: Whatever else than a refusal ended it.
    """
    began = time.perf_counter()
    try:
        read(text)
    except (StudyError, LayoutError) as refusal:
        told = str(refusal)
    else:
        told = ""
    assert time.perf_counter() - began < LONGEST_S
    return told


@st.composite
def edited(draw: st.DrawFn, text: str) -> str:
    """Edit a text here and there: leave out, put in, double, exchange lines."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.sampled_from((0, 0, 1, 3, 20, 200))))
        put = draw(PIECES | st.text(max_size=8) | st.just(text[start:end] * 2) | TREE.map(repr))
        text = text[:start] + put + text[end:]
    return text


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=NUM_EXAMPLES)
@given(data=st.data())
def test_a_file_that_was_edited_anyhow_is_read_or_refused_in_words(name: str, data: st.DataObject) -> None:
    text, read = READERS[name]
    told = outcome(read, data.draw(edited(text)))
    assert told == "" or all(len(line) < 2000 for line in told.splitlines())
    assert not re.search(MOVES_A_CURSOR, told)


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=NUM_EXAMPLES)
@given(text=st.text(max_size=200) | st.lists(PIECES, max_size=30).map("".join))
def test_any_text_is_read_or_refused_in_words(name: str, text: str) -> None:
    outcome(READERS[name][1], text)


def test_the_files_themselves_are_read_and_a_reader_that_fails_is_found() -> None:
    """The controls."""
    for text, read in READERS.values():
        assert outcome(read, text) == ""
    said = outcome(parse_study, '"a\\u001b[2J\\nb\\u202e" = 1')
    assert "a\\x1b[2J\\nb\\u202e" in said
    with pytest.raises(ZeroDivisionError):
        outcome(lambda text: 1 // text.count("#"), "")
