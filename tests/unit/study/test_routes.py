"""Routes as people write them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.stimuli.sources import SHARED_TEXTS
from webapp.study.routes import MAX_ROUTE_ACTIONS, RouteTooLongError, UnknownActionError, parse_route, write_route
from webapp.study.texts import Texts, parse_texts

ACTIONS = ("forward", "left", "right", "pickup", "toggle")
TEXTS = {
    language: parse_texts((SHARED_TEXTS / f"{language}.toml").read_text(encoding="utf-8"), language, language)
    for language in ("en", "ja")
}
SEPARATORS = st.text(st.sampled_from(" ,、\uff0c\u3000\t\r\n"), min_size=1, max_size=3)


def read(text: str, language: str = "en") -> tuple[str, ...]:
    return parse_route(text, ACTIONS, TEXTS[language])


def ways_to_write(action: str, texts: Texts) -> st.SearchStrategy[str]:
    letters = {"toggle": ("t", "o")}.get(action, (action[0],))
    spellings = [action, action.upper(), *letters, texts(f"actions.{action}"), texts(f"drive.buttons.{action}")]
    wide = ["".join(chr(ord(letter) + 0xFEE0) for letter in action)]
    return st.sampled_from([*spellings, *wide])


@given(st.lists(st.sampled_from(ACTIONS), max_size=20), st.sampled_from(sorted(TEXTS)), st.data())
def test_names_letters_and_the_words_of_the_page_mean_the_same(
    route: list[str], language: str, data: st.DataObject
) -> None:
    written = data.draw(st.sampled_from(["", " ", ", "]))
    for action in route:
        written += data.draw(ways_to_write(action, TEXTS[language])) + data.draw(SEPARATORS)
    assert read(written, language) == tuple(route)


@given(st.lists(st.sampled_from(ACTIONS), max_size=MAX_ROUTE_ACTIONS), st.sampled_from(sorted(TEXTS)))
def test_a_route_that_the_page_wrote_is_read_in_every_language(route: list[str], language: str) -> None:
    assert read(write_route(route), language) == tuple(route)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("jump", "jump"),
        ("forward, jump, swim", "jump"),
        ("fl", "fl"),
        ("forwards", "forwards"),
        ("go", "go"),
        ("pick up the", "pick"),
        ("forward;left", "forward;left"),
        ("\uff2aump", "jump"),
        ("<b>", "<b>"),
    ],
)
def test_the_first_word_that_is_no_action_is_named(text: str, word: str) -> None:
    with pytest.raises(UnknownActionError) as caught:
        read(text)
    assert caught.value.word == word
    assert repr(word) in str(caught.value)


def test_words_of_another_language_than_the_pages_are_not_known() -> None:
    assert read("前に進む、左に向きを変える", "ja") == ("forward", "left")
    with pytest.raises(UnknownActionError):
        read("前に進む", "en")


def test_letters_of_actions_that_a_world_does_not_have_mean_nothing() -> None:
    assert parse_route("f, l", ("forward", "left"), TEXTS["en"]) == ("forward", "left")
    with pytest.raises(UnknownActionError):
        parse_route("p", ("forward", "left"), TEXTS["en"])


def test_a_route_has_at_most_two_hundred_actions() -> None:
    assert len(read("f " * 200)) == 200
    with pytest.raises(RouteTooLongError, match="at most 200 actions, not 201"):
        read("f " * 201)


def test_a_very_long_text_is_read_at_once() -> None:
    with pytest.raises(RouteTooLongError):
        read("f" + " ," * 500_000 + "l f " * 100_000)
