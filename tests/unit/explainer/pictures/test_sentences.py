"""Sentences are read back by somebody who knows the languages, and not the program that wrote them."""

import re
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings

from tests.worlds import LAYOUTS, lay_out, layouts, reachable_states
from webapp.explainer.explanation import Explanation, explain
from webapp.explainer.importance import Importance, exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures import sentences
from webapp.explainer.pictures.sentences import LANGUAGES, SENTENCE_PHRASES, load_phrases, sentence, subgoal_sentences
from webapp.explainer.solvers import Trajectory, plan
from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState, key_door_state, start_state, step, tabulate
from webapp.explainer.worlds.layout import Layout

FOLDER = Path(sentences.__file__).with_name("phrases")
CORRIDOR = lay_out("#######", "#>KD.G#", "#######")


class Facts(NamedTuple):
    """What a sentence says; None where it says nothing."""

    step: int
    action: str
    works: bool
    ahead: str
    underfoot: str
    has_key: bool | None
    door_open: bool | None


# What is done: the action, whether it works, what is ahead, what is underfoot, whether the key is in hand.
WHOLE = {
    "en": {
        "go forward over open floor, with the key in hand": ("forward", "floor", "floor", True),
        "go forward over open floor, without the key": ("forward", "floor", "floor", False),
        "go forward, into the open doorway": ("forward", "open door", "floor", True),
        "go forward, out of the doorway": ("forward", "floor", "open door", True),
        "go forward, onto the goal": ("forward", "goal", "floor", None),
        "go forward, out of the doorway and onto the goal": ("forward", "goal", "open door", True),
        "pick up the key directly ahead": ("pickup", "key", "floor", False),
        "open the locked door directly ahead with the key": ("toggle", "locked door", "floor", True),
        "close the open door directly ahead": ("toggle", "open door", "floor", True),
    },
    "ja": {
        "鍵を手に持ち、何もない床の上を前に進む": ("forward", "floor", "floor", True),
        "鍵を持たず、何もない床の上を前に進む": ("forward", "floor", "floor", False),
        "前に進んで、開いているドアの戸口に入る": ("forward", "open door", "floor", True),
        "前に進んで、戸口から出る": ("forward", "floor", "open door", True),
        "前に進んで、ゴールに着く": ("forward", "goal", "floor", None),
        "前に進んで戸口から出て、ゴールに着く": ("forward", "goal", "open door", True),
        "目の前の鍵を拾う": ("pickup", "key", "floor", False),
        "目の前の鍵のかかったドアを、鍵を使って開ける": ("toggle", "locked door", "floor", True),
        "目の前の開いているドアを閉める": ("toggle", "open door", "floor", True),
    },
}
SENTENCES = {"en": r"At step (\d+), (.+)\.", "ja": r"ステップ(\d+)では、(.+)。"}
SCENES = {
    "en": r"(?P<deed>.+?)(?P<doorway> in the doorway)?, with (?P<ahead>.+?) directly ahead(?: and (?P<hand>.+))?",
    "ja": r"(?P<hand>鍵を手に持ち|鍵を持たず)?、?(?P<doorway>戸口で)?、?(?P<ahead>.+)を前にして、(?P<deed>.+)",
}
DEEDS = {
    "en": {
        "try in vain to go forward": ("forward", False),
        "turn left": ("left", True),
        "turn right": ("right", True),
        "try in vain to pick something up": ("pickup", False),
        "try in vain to open a door": ("toggle", False),
    },
    "ja": {
        "前に進もうとするが、進めない": ("forward", False),
        "左に向きを変える": ("left", True),
        "右に向きを変える": ("right", True),
        "何かを拾おうとするが、拾えない": ("pickup", False),
        "ドアを開けようとするが、開けられない": ("toggle", False),
    },
}
NOUNS = {
    "en": {
        "a wall": "wall",
        "open floor": "floor",
        "the key": "key",
        "the locked door": "locked door",
        "the open door": "open door",
        "the goal": "goal",
    },
    "ja": {
        "壁": "wall",
        "何もない床": "floor",
        "鍵": "key",
        "鍵のかかったドア": "locked door",
        "開いているドア": "open door",
        "ゴール": "goal",
    },
}
HANDS = {"the key in hand": True, "no key in hand": False, "鍵を手に持ち": True, "鍵を持たず": False}


def understood(text: str, language: str) -> Facts:
    found = re.fullmatch(SENTENCES[language], text)
    assert found, text
    number, what = int(found[1]), found[2]
    if what in WHOLE[language]:
        action, ahead, underfoot, has_key = WHOLE[language][what]
        return Facts(number, action, True, ahead, underfoot, has_key, door_in({ahead, underfoot}))
    scene = re.fullmatch(SCENES[language], what)
    assert scene, text
    action, works = DEEDS[language][scene["deed"]]
    ahead, underfoot = NOUNS[language][scene["ahead"]], "open door" if scene["doorway"] else "floor"
    implied = ahead != "key" if ahead == "key" or "open door" in (ahead, underfoot) else None
    has_key = implied if scene["hand"] is None else HANDS[scene["hand"]]
    assert has_key is not None, text
    return Facts(number, action, works, ahead, underfoot, has_key, door_in({ahead, underfoot}))


def door_in(things: set[str]) -> bool | None:
    if things & {"open door", "locked door"}:
        return "open door" in things
    return None


def truth(layout: Layout, state: KeyDoorState, action: int, number: int) -> Facts:
    def thing(x: int, y: int) -> str:
        if (x, y) == layout.door:
            return "open door" if state.door_open else "locked door"
        if (x, y) == layout.key and not state.has_key:
            return "key"
        return "goal" if (x, y) == layout.goal else "wall" if (x, y) in layout.walls else "floor"

    dx, dy = {0: (1, 0), 1: (0, 1), 2: (-1, 0), 3: (0, -1)}[state.heading]
    works = step(layout, state, action)[0] != state
    ahead, underfoot = thing(state.x + dx, state.y + dy), thing(state.x, state.y)
    return Facts(number, ACTIONS[action], works, ahead, underfoot, bool(state.has_key), bool(state.door_open))


def check(layout: Layout, state: KeyDoorState, action: int, number: int, language: str) -> None:
    text = sentence(layout, state, action, number, load(language))
    said, true = understood(text, language), truth(layout, state, action, number)
    silent = {name: getattr(true, name) for name in ("has_key", "door_open") if getattr(said, name) is None}
    assert said._replace(**silent) == true, text


PHRASES = {language: load_phrases(language) for language in LANGUAGES}


def load(language: str) -> dict[str, str]:
    return dict(PHRASES[language])


def explained(layout: Layout, random_steps: int = 10) -> tuple[DeterministicMDP, Explanation]:
    mdp = tabulate(layout)
    policy = plan(mdp)
    return mdp, explain(mdp, policy, lambda path: exact_importance("ace", mdp, policy, path, random_steps))


def test_there_are_two_languages() -> None:
    assert LANGUAGES == ("en", "ja")


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", LAYOUTS)
def test_the_sentence_of_every_step_of_a_path_is_true(name: str, language: str) -> None:
    layout = LAYOUTS[name]
    mdp, explanation = explained(layout)
    for number, (state, action) in enumerate(explanation.path.pairs, start=1):
        check(layout, key_door_state(mdp, state), action, number, language)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", ["simulation", "experiment1-b"])
def test_every_action_in_every_state_is_told_truly(name: str, language: str) -> None:
    layout = LAYOUTS[name]
    for state in reachable_states(layout):
        for action in range(len(ACTIONS) if (state.x, state.y) != layout.goal else 0):
            check(layout, state, action, 1, language)


@given(layout=layouts(6))
@settings(max_examples=40)
def test_on_maps_that_nobody_chose_every_sentence_is_true(layout: Layout) -> None:
    for state in reachable_states(layout):
        for action in range(len(ACTIONS) if (state.x, state.y) != layout.goal else 0):
            for language in LANGUAGES:
                check(layout, state, action, 7, language)


@pytest.mark.parametrize("language", LANGUAGES)
def test_from_the_doorway_a_wall_and_the_goal_are_seen(language: str) -> None:
    layout = lay_out("######", "#>KDG#", "#..#.#", "######")
    in_doorway = KeyDoorState(*layout.door, 0, 1, 1)
    for heading in range(4):
        for action in range(len(ACTIONS)):
            check(layout, in_doorway._replace(heading=heading), action, 3, language)


@pytest.mark.parametrize(
    ("language", "wanted"),
    [
        (
            "en",
            {
                7: "At step 7, pick up the key directly ahead.",
                16: "At step 16, go forward, out of the doorway.",
                20: "At step 20, go forward, onto the goal.",
            },
        ),
        (
            "ja",
            {
                7: "ステップ7では、目の前の鍵を拾う。",
                16: "ステップ16では、前に進んで、戸口から出る。",
                20: "ステップ20では、前に進んで、ゴールに着く。",
            },
        ),
    ],
)
def test_each_subgoal_has_its_sentence(language: str, wanted: dict[int, str]) -> None:
    layout = LAYOUTS["simulation"]
    mdp = tabulate(layout)
    policy = plan(mdp)
    found = explain(mdp, policy, lambda path: exact_importance("return_probability", mdp, policy, path, 10))
    assert subgoal_sentences(layout, mdp, found, load_phrases(language)) == wanted


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("key", SENTENCE_PHRASES)
def test_a_missing_phrase_is_refused_with_its_name(tmp_path: Path, language: str, key: str) -> None:
    lines = (FOLDER / f"{language}.toml").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith(f"{key} = ")]
    assert len(kept) == len(lines) - 1
    (tmp_path / f"{language}.toml").write_text("\n".join(kept), encoding="utf-8")
    with pytest.raises(ValueError, match=rf"^the language '{language}' cannot be used: the phrase '{key}' is missing$"):
        load_phrases(language, tmp_path)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("ahead_wall =", "ahead_hedge =", "the phrase 'ahead_wall' is missing; there is no phrase 'ahead_hedge'"),
        ('"a wall"', '"open floor"', "the phrases 'ahead_floor', 'ahead_wall' say the same"),
        ("turn left{scene}", "turn left", "the phrase 'turn_left' must hold {scene}"),
        ("turn left{scene}", "turn left{scene", "the phrase 'turn_left' cannot be read"),
        ('"a wall"', '"a wall{x}"', "the phrase 'ahead_wall' takes no placeholder"),
    ],
)
def test_phrases_that_cannot_be_used_are_refused(tmp_path: Path, before: str, after: str, message: str) -> None:
    text = (FOLDER / "en.toml").read_text(encoding="utf-8")
    (tmp_path / "en.toml").write_text(text.replace(before, after), encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(message)):
        load_phrases("en", tmp_path)


def test_a_language_that_nobody_wrote_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^there are no sentences in the language 'tlh'; use en or ja$"):
        load_phrases("tlh")
    shutil.copy(FOLDER / "en.toml", tmp_path)
    with pytest.raises(ValueError, match=r"in the language 'ja'; use en$"):
        load_phrases("ja", tmp_path)


@pytest.mark.parametrize("action", [-1, 5])
def test_there_are_no_words_for_an_action_that_does_not_exist(action: int) -> None:
    with pytest.raises(ValueError, match=f"there are no words for action {action}"):
        sentence(CORRIDOR, start_state(CORRIDOR), action, 1, load("en"))


def test_only_key_door_worlds_can_be_put_into_words() -> None:
    end = np.array([False, True])
    other = DeterministicMDP(("a", "b"), ("go",), np.array([[1], [1]], dtype=np.int32), end, end.copy(), 0)
    found = Explanation(Trajectory((0, 1), (0,)), Importance(np.array([0.9, 0.0]), None), (1,), None, 1, ())
    with pytest.raises(TypeError, match="'a' is no state of one"):
        subgoal_sentences(CORRIDOR, other, found, load("en"))
