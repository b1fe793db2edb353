"""A route as somebody writes it: actions by name, by first letter or in the words of the page, in any mixture."""

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence

from webapp.study.texts import Texts

MAX_ROUTE_ACTIONS = 200
"""How long a route may be; from every state of our layouts the goal is nearer."""

LETTERS: Mapping[str, str] = {
    "f": "forward",
    "l": "left",
    "r": "right",
    "p": "pickup",
    "t": "toggle",
    "o": "toggle",  # For "open", as on the keyboard of a drive.
}

_SEPARATORS = re.compile(r"[\s,、]+")


class UnknownActionError(ValueError):
    """A word in a route that is no action.

    Attributes:
        word: As it was written, but for its width and case.
    """

    def __init__(self, word: str) -> None:
        self.word = word
        super().__init__(f"there is no action {word!r}")


class RouteTooLongError(ValueError):
    """A route of too many actions.

    Attributes:
        num_actions: How many there are.
    """

    def __init__(self, num_actions: int) -> None:
        self.num_actions = num_actions
        super().__init__(f"a route has at most {MAX_ROUTE_ACTIONS} actions, not {num_actions}")


def parse_route(text: str, actions: Sequence[str], texts: Texts) -> tuple[str, ...]:
    """Read a route; blanks, commas and ideographic commas stand between its actions.

    Args:
        text: What was written. Width and case do not matter.
        actions: The names of the actions there are.
        texts: Where `actions.<name>` says what the page calls them.

    Returns:
        The names of the actions.

    Raises:
        UnknownActionError: Something is no action.
        RouteTooLongError: There are more than `MAX_ROUTE_ACTIONS`.
    """
    route = tuple(_read(_words(text), _known(actions, texts)))
    if len(route) > MAX_ROUTE_ACTIONS:
        raise RouteTooLongError(len(route))
    return route


def write_route(route: Sequence[str]) -> str:
    """Write a route so that `parse_route` reads it, whatever the language."""
    return " ".join(route)


def _words(text: str) -> tuple[str, ...]:
    plain = unicodedata.normalize("NFKC", text).casefold()
    return tuple(word for word in _SEPARATORS.split(plain) if word)


def _known(actions: Sequence[str], texts: Texts) -> Mapping[tuple[str, ...], str]:
    """Return what may be written, word by word, and the action that it means."""
    letters = {(letter,): action for letter, action in LETTERS.items() if action in actions}
    wordings = {_words(texts(f"actions.{action}")): action for action in actions}
    return letters | wordings | {(action,): action for action in actions}


def _read(words: Sequence[str], known: Mapping[tuple[str, ...], str]) -> Iterator[str]:
    """Yield the action that the longest run of words means, over and over."""
    lengths = sorted({len(phrase) for phrase in known}, reverse=True)
    place = 0
    while place < len(words):
        phrases = (tuple(words[place : place + length]) for length in lengths)
        phrase = next((phrase for phrase in phrases if phrase in known), None)
        if phrase is None:
            raise UnknownActionError(words[place])
        yield known[phrase]
        place += len(phrase)
