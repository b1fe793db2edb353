import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings

import webapp
from tests.worlds import LAYOUTS, lay_out, layouts, reachable_states
from webapp.explainer.pictures.render import draw
from webapp.explainer.pictures.words import PHRASE_KEYS, check_phrases, describe
from webapp.explainer.worlds.key_door import KeyDoorState
from webapp.explainer.worlds.layout import Layout
from webapp.explainer.worlds.view import Tile, View, egocentric_view

PLACES = {
    "left": "at L0",
    "right": "at R0",
    "both_sides": "at L0+R0",
    "ahead": "at M1",
    "ahead_left": "at L1",
    "ahead_right": "at R1",
    "ahead_both": "at L1+R1",
    "ahead_left_pair": "at L1+L2",
    "ahead_right_pair": "at R1+R2",
    "ahead_row": "at L1+M1+R1",
    "two_ahead": "at M2",
    "two_ahead_left": "at L2",
    "two_ahead_right": "at R2",
    "two_ahead_both": "at L2+R2",
    "two_ahead_row": "at L2+M2+R2",
    "left_column": "at L0+L1+L2",
    "right_column": "at R0+R1+R2",
}
PHRASES = PLACES | {
    "and": "{first} and {last}",
    "comma": "{first}, {next}",
    "semicolon": "{first}; {next}",
    "sentence": "{text}.",
    "sentences": "{first} {next}",
    "key": "a key {places}",
    "closed_door": "a locked door {places}",
    "open_door": "an open door {places}",
    "goal": "the goal {places}",
    "wall": "wall {places}",
    "unseen": "hidden {places}",
    "only_floor": "open floor",
    "on_open_door": "it stands in the door",
    "on_goal": "it stands on the goal",
    "holds_key": "it holds the key",
    "holds_no_key": "it holds no key",
}
NOUNS = {
    "a key": Tile.KEY,
    "a locked door": Tile.CLOSED_DOOR,
    "an open door": Tile.OPEN_DOOR,
    "the goal": Tile.GOAL,
    "wall": Tile.WALL,
    "hidden": Tile.UNSEEN,
}

ROOM = lay_out(
    "#######",
    "#>..#.#",
    "#..K#.#",
    "#...D.#",
    "#...#G#",
    "#######",
)


def all_views(*worlds: Layout) -> set[View]:
    return {egocentric_view(layout, state) for layout in worlds for state in reachable_states(layout)}


def understood(text: str) -> View:
    """Read a description back, as somebody would who knows the phrases and nothing else."""
    around, *own, hand = text.casefold().rstrip(".").split(". ")
    cells = [[Tile.FLOOR] * 3 for _ in range(3)]
    for clause in around.split("; "):
        if clause == "open floor":
            continue
        noun, _, _ = clause.partition(" at ")
        for place in re.findall(r"[lmr][012]", clause):
            row, column = 2 - int(place[1]), "lmr".index(place[0])
            assert cells[row][column] in {Tile.FLOOR, NOUNS[noun]}
            cells[row][column] = NOUNS[noun]
    cells[2][1] = (
        {"it stands in the door": Tile.OPEN_DOOR, "it stands on the goal": Tile.GOAL}[own[0]] if own else Tile.FLOOR
    )
    return View(tuple(tuple(row) for row in cells), has_key={"it holds the key": True, "it holds no key": False}[hand])


def test_the_words_hold_every_fact_of_every_view_of_the_study() -> None:
    for view in all_views(*LAYOUTS.values()):
        assert understood(describe(view, PHRASES)) == view


@settings(max_examples=60)
@given(layouts())
def test_the_words_hold_every_fact_of_any_view(layout: Layout) -> None:
    for view in all_views(layout):
        assert understood(describe(view, PHRASES)) == view


def assert_same_words_exactly_if_same_picture(views: set[View]) -> None:
    pairs = {(describe(view, PHRASES), draw(view, 24)) for view in views}
    words, pictures = {pair[0] for pair in pairs}, {pair[1] for pair in pairs}
    assert len(words) == len(pictures) == len(pairs) == len(views)


def test_views_of_the_study_have_the_same_words_exactly_if_they_have_the_same_picture() -> None:
    views = all_views(*LAYOUTS.values())
    assert len(views) > 100
    assert_same_words_exactly_if_same_picture(views)


def test_the_phrases_of_all_studies_tell_views_apart() -> None:
    path = Path(webapp.__file__).parent / "studies" / "texts" / "en.toml"
    phrases = tomllib.loads(path.read_text(encoding="utf-8"))["pictures"]
    check_phrases(phrases)
    views = all_views(*LAYOUTS.values())
    assert len({describe(view, phrases) for view in views}) == len(views)


@settings(max_examples=20)
@given(layouts())
def test_any_views_have_the_same_words_exactly_if_they_have_the_same_picture(layout: Layout) -> None:
    assert_same_words_exactly_if_same_picture(all_views(layout))


@pytest.mark.parametrize(
    ("state", "text"),
    [
        ((2, 3, 2, 1, 0), "Wall at L2+M2+R2. It holds the key."),
        ((1, 1, 0, 0, 0), "A key at R2; wall at L0+L1+L2. It holds no key."),
        ((3, 3, 0, 0, 0), "A key at L0; a locked door at M1; wall at L1+R1; hidden at L2+M2+R2. It holds no key."),
        ((4, 3, 0, 1, 1), "The goal at R1; wall at L2+M2+R2 and at L0+R0. It stands in the door. It holds the key."),
        (
            (5, 4, 1, 1, 1),
            "Wall at L1+M1+R1 and at L0+R0; hidden at L2+M2+R2. It stands on the goal. It holds the key.",
        ),
        ((5, 2, 3, 1, 0), "Wall at L2+M2+R2, at L0+L1+L2 and at R0+R1+R2. It holds the key."),
    ],
)
def test_a_view_is_described_from_the_telling_things_to_the_walls(state: tuple[int, ...], text: str) -> None:
    assert describe(egocentric_view(ROOM, KeyDoorState(*state)), PHRASES) == text


def test_a_view_of_nothing_but_floor_says_so() -> None:
    view = View(((Tile.FLOOR,) * 3,) * 3, has_key=False)
    assert describe(view, PHRASES) == "Open floor. It holds no key."


def test_phrases_that_tell_everything_apart_are_accepted() -> None:
    check_phrases(PHRASES)
    assert set(PHRASE_KEYS) == set(PHRASES)


def test_every_problem_with_phrases_is_named_at_once() -> None:
    phrases = PHRASES | {
        "wall": "wall",
        "goal": "the goal {place}",
        "key": "a key {places} {places}",
        "unseen": "hidden {places",
        "left": "at {side}",
        "two_ahead": "At M1 ",
        "wal": "wall",
    }
    del phrases["comma"]
    with pytest.raises(ValueError, match="comma") as caught:
        check_phrases(phrases)
    assert str(caught.value).split("; ") == [
        "the phrase 'comma' is missing",
        "there is no phrase 'wal'",
        "the phrase 'left' takes no placeholder",
        "the phrase 'key' must hold {places}",
        "the phrase 'goal' must hold {places}",
        "the phrase 'wall' must hold {places}",
        "the phrase 'unseen' cannot be read: expected '}' before end of string",
        "the phrases 'ahead', 'two_ahead' say the same",
    ]
