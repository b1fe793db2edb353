"""A step in words: one sentence made from a state and the action taken in it (Sakai et al. 2021, future work).

A sentence says what is done, what is directly ahead and whether the agent stands in the doorway. It says whether the
key is in hand wherever that does not follow: who sees the key lying has none, and who stands before the open door or
in it has opened it with the key. Where nothing is said of what is ahead or underfoot, there is open floor.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path

from webapp.explainer.explanation import Explanation
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.phrase_tables import phrase_problems
from webapp.explainer.worlds.key_door import FORWARD, LEFT, PICKUP, RIGHT, TOGGLE, KeyDoorState, key_door_state
from webapp.explainer.worlds.layout import Layout
from webapp.explainer.worlds.view import AGENT, Tile, egocentric_view

_FOLDER = Path(__file__).with_name("phrases")

LANGUAGES = tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))
"""The languages that have a table of phrases, by their code."""

SENTENCE_PHRASES: Mapping[str, frozenset[str]] = {
    "sentence": frozenset({"step", "what"}),
    "forward_with_key": frozenset(),
    "forward_without_key": frozenset(),
    "forward_into_doorway": frozenset(),
    "forward_out_of_doorway": frozenset(),
    "forward_onto_goal": frozenset(),
    "forward_out_onto_goal": frozenset(),
    "forward_in_vain": frozenset({"scene"}),
    "turn_left": frozenset({"scene"}),
    "turn_right": frozenset({"scene"}),
    "pick_up_key": frozenset(),
    "pick_up_in_vain": frozenset({"scene"}),
    "open_door": frozenset(),
    "close_door": frozenset(),
    "toggle_in_vain": frozenset({"scene"}),
    "scene": frozenset({"ahead"}),
    "scene_with_key": frozenset({"ahead"}),
    "scene_without_key": frozenset({"ahead"}),
    "scene_in_doorway": frozenset({"ahead"}),
    "ahead_wall": frozenset(),
    "ahead_floor": frozenset(),
    "ahead_key": frozenset(),
    "ahead_closed_door": frozenset(),
    "ahead_open_door": frozenset(),
    "ahead_goal": frozenset(),
}
"""The names of the phrases that `sentence` needs, each with the placeholders that its text must hold."""

_BLOCKED = frozenset({Tile.WALL, Tile.KEY, Tile.CLOSED_DOOR})


def load_phrases(language: str, folder: Path = _FOLDER) -> Mapping[str, str]:
    """Read the phrases of a language.

    Args:
        language: Its code, such as `en`.
        folder: The folder that holds a table for each language.

    Raises:
        ValueError: There is no such language, or its table lacks a phrase; the message names what is wrong.
    """
    known = sorted(path.stem for path in folder.glob("*.toml"))
    if language not in known:
        raise ValueError(f"there are no sentences in the language {language!r}; use {' or '.join(known)}")
    phrases = tomllib.loads((folder / f"{language}.toml").read_text(encoding="utf-8"))
    if problems := phrase_problems(phrases, SENTENCE_PHRASES, joints=()):
        raise ValueError(f"the language {language!r} cannot be used: {'; '.join(problems)}")
    return phrases


def subgoal_sentences(
    layout: Layout, mdp: DeterministicMDP, explanation: Explanation, phrases: Mapping[str, str]
) -> dict[int, str]:
    """Say each subgoal of an explanation, the key points among them, in one sentence.

    Args:
        layout: The map.
        mdp: A world whose labels are the map's `KeyDoorState`s.
        explanation: Of a path in that world.
        phrases: A text for each of `SENTENCE_PHRASES`.

    Returns:
        The sentences by step, ascending.

    Raises:
        TypeError: A state is none of a key-door world.
    """
    sentences = {}
    for step in explanation.subgoals:
        state, action = explanation.path.pairs[step - 1]
        sentences[step] = sentence(layout, key_door_state(mdp, state), action, step, phrases)
    return sentences


def sentence(layout: Layout, state: KeyDoorState, action: int, step: int, phrases: Mapping[str, str]) -> str:
    """Say what the agent does at a step.

    Args:
        layout: The world.
        state: A state that can be reached in it, not on the goal.
        action: An index into `ACTIONS`; an action that cannot act is said to be in vain.
        step: The number of the step, from 1.
        phrases: A text for each of `SENTENCE_PHRASES`.

    Raises:
        ValueError: There is no such action.
        KeyError: A phrase is missing.
    """
    view = egocentric_view(layout, state)
    ahead, own = view.cells[AGENT[0] - 1][AGENT[1]], view.cells[AGENT[0]][AGENT[1]]
    in_doorway, has_key = own is Tile.OPEN_DOOR, bool(state.has_key)
    deed = phrases[_deed(action, ahead, in_doorway=in_doorway, has_key=has_key)]
    scene = phrases[_scene(ahead, in_doorway=in_doorway, has_key=has_key)]
    what = deed.format(scene=scene.format(ahead=phrases[f"ahead_{ahead.value}"]))
    return phrases["sentence"].format(step=step, what=what)


def _deed(action: int, ahead: Tile, *, in_doorway: bool, has_key: bool) -> str:
    """Return the name of the phrase for an action."""
    if action == FORWARD:
        return _advance(ahead, in_doorway=in_doorway, has_key=has_key)
    if action in (LEFT, RIGHT):
        return "turn_left" if action == LEFT else "turn_right"
    if action == PICKUP:
        return "pick_up_key" if ahead is Tile.KEY else "pick_up_in_vain"
    if action == TOGGLE:
        doors = {Tile.CLOSED_DOOR: "open_door", Tile.OPEN_DOOR: "close_door"}
        return doors.get(ahead, "toggle_in_vain") if has_key else "toggle_in_vain"
    raise ValueError(f"there are no words for action {action}; there are five, from 0")


def _advance(ahead: Tile, *, in_doorway: bool, has_key: bool) -> str:
    if ahead in _BLOCKED:
        return "forward_in_vain"
    if ahead is Tile.GOAL:
        return "forward_out_onto_goal" if in_doorway else "forward_onto_goal"
    if ahead is Tile.OPEN_DOOR:
        return "forward_into_doorway"
    if in_doorway:
        return "forward_out_of_doorway"
    return "forward_with_key" if has_key else "forward_without_key"


def _scene(ahead: Tile, *, in_doorway: bool, has_key: bool) -> str:
    """Return the name of the phrase for what surrounds an action; the hand is left out where it follows."""
    if in_doorway:
        return "scene_in_doorway"
    if ahead in (Tile.KEY, Tile.OPEN_DOOR):
        return "scene"
    return "scene_with_key" if has_key else "scene_without_key"
