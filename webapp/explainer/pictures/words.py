"""A view in words: the same facts as its picture, no more and no fewer.

Two views have the same words exactly if they have the same picture. The phrases come as a table, so that a study can
bring its own language.
"""

from collections.abc import Mapping

from webapp.explainer.pictures.phrase_tables import phrase_problems
from webapp.explainer.worlds.view import AGENT, SIZE, Tile, View

PHRASES: Mapping[str, frozenset[str]] = {
    "ahead": frozenset(),
    "ahead_left": frozenset(),
    "ahead_right": frozenset(),
    "ahead_both": frozenset(),
    "ahead_row": frozenset(),
    "ahead_left_pair": frozenset(),
    "ahead_right_pair": frozenset(),
    "two_ahead": frozenset(),
    "two_ahead_left": frozenset(),
    "two_ahead_right": frozenset(),
    "two_ahead_both": frozenset(),
    "two_ahead_row": frozenset(),
    "left": frozenset(),
    "right": frozenset(),
    "both_sides": frozenset(),
    "left_column": frozenset(),
    "right_column": frozenset(),
    "and": frozenset({"first", "last"}),
    "comma": frozenset({"first", "next"}),
    "semicolon": frozenset({"first", "next"}),
    "sentence": frozenset({"text"}),
    "sentences": frozenset({"first", "next"}),
    "key": frozenset({"places"}),
    "closed_door": frozenset({"places"}),
    "open_door": frozenset({"places"}),
    "goal": frozenset({"places"}),
    "wall": frozenset({"places"}),
    "unseen": frozenset({"places"}),
    "only_floor": frozenset(),
    "on_open_door": frozenset(),
    "on_goal": frozenset(),
    "holds_key": frozenset(),
    "holds_no_key": frozenset(),
}
"""The names of the phrases that `describe` needs, each with the placeholders that its text must hold."""

PHRASE_KEYS = tuple(PHRASES)
"""The names of the phrases that `describe` needs."""

_Place = tuple[int, int]

_GROUPS: tuple[tuple[str, frozenset[_Place]], ...] = (
    ("ahead_row", frozenset({(1, 0), (1, 1), (1, 2)})),
    ("two_ahead_row", frozenset({(0, 0), (0, 1), (0, 2)})),
    ("left_column", frozenset({(2, 0), (1, 0), (0, 0)})),
    ("right_column", frozenset({(2, 2), (1, 2), (0, 2)})),
    ("both_sides", frozenset({(2, 0), (2, 2)})),
    ("ahead_both", frozenset({(1, 0), (1, 2)})),
    ("two_ahead_both", frozenset({(0, 0), (0, 2)})),
    ("ahead_left_pair", frozenset({(1, 0), (0, 0)})),
    ("ahead_right_pair", frozenset({(1, 2), (0, 2)})),
    ("left", frozenset({(2, 0)})),
    ("right", frozenset({(2, 2)})),
    ("ahead", frozenset({(1, 1)})),
    ("ahead_left", frozenset({(1, 0)})),
    ("ahead_right", frozenset({(1, 2)})),
    ("two_ahead", frozenset({(0, 1)})),
    ("two_ahead_left", frozenset({(0, 0)})),
    ("two_ahead_right", frozenset({(0, 2)})),
)
"""What each phrase for places covers, as rows and columns of a view; the phrases for more cells come first."""

_IN_ORDER = (Tile.KEY, Tile.CLOSED_DOOR, Tile.OPEN_DOOR, Tile.GOAL, Tile.WALL, Tile.UNSEEN)
"""What is mentioned, the telling things first. Floor is what is not mentioned."""


def describe(view: View, phrases: Mapping[str, str]) -> str:
    """Say what a view shows: what stands where as the agent sees it, what is underfoot, whether it holds the key.

    Args:
        view: The view.
        phrases: A text for each of `PHRASE_KEYS`, as `check_phrases` wants them.

    Raises:
        KeyError: A phrase is missing.
    """
    clauses = [
        phrases[tile.value].format(places=_places(where, phrases))
        for tile in _IN_ORDER
        if (where := _where(view, tile))
    ]
    facts = [_chain(clauses or [phrases["only_floor"]], phrases["semicolon"])]
    own = view.cells[AGENT[0]][AGENT[1]]
    if own is not Tile.FLOOR:
        facts.append(phrases[f"on_{own.value}"])
    facts.append(phrases["holds_key" if view.has_key else "holds_no_key"])
    return _chain([_sentence(fact, phrases) for fact in facts], phrases["sentences"])


def check_phrases(phrases: Mapping[str, str]) -> None:
    """Check that a table of phrases can describe every view, and tell different views apart.

    Raises:
        ValueError: Phrases are missing, unknown, alike, or without their placeholders; the message names them all.
    """
    joints = {"and", "comma", "semicolon", "sentence", "sentences"}
    if problems := phrase_problems(phrases, PHRASES, joints):
        raise ValueError("; ".join(problems))


def _where(view: View, tile: Tile) -> frozenset[_Place]:
    """Return the places around the agent where a tile is seen."""
    return frozenset(
        (row, column)
        for row, tiles in enumerate(view.cells)
        for column, here in enumerate(tiles)
        if here is tile and (row, column) != AGENT
    )


def _places(where: frozenset[_Place], phrases: Mapping[str, str]) -> str:
    """Name places in few phrases: whole rows and columns, which may cross, then pairs, then single cells."""
    named: list[str] = []
    covered: set[_Place] = set()
    for key, group in _GROUPS:
        num_new = len(group - covered)
        if group <= where and (num_new == len(group) or (num_new and len(group) == SIZE)):
            named.append(phrases[key])
            covered |= group
    *before, last = named
    if not before:
        return last
    return phrases["and"].format(first=_chain(before, phrases["comma"]), last=last)


def _chain(parts: list[str], joint: str) -> str:
    text, *others = parts
    for part in others:
        text = joint.format(first=text, next=part)
    return text


def _sentence(fact: str, phrases: Mapping[str, str]) -> str:
    return phrases["sentence"].format(text=fact[:1].upper() + fact[1:])
