"""The log of a page, as the browser sends it: which events there are, and what is kept of them."""

import json
from collections.abc import Iterator

from webapp.study.answers import Event
from webapp.study.questionnaire import MAX_RESPONSE_TIME_MS

TIMING_EVENTS = frozenset({"painted", "changed", "focus_lost", "focus_regained", "pictures_ready", "picture_failed"})
"""How long things took: measured for everybody, as the consent says."""

BEHAVIOUR_EVENTS = frozenset({"visible", "attended", "replayed", "stepped_back", "texts_opened", "texts_closed"})
"""How the pictures were looked at: only where the study declares it, and then the consent does too."""

EVENTS = TIMING_EVENTS | BEHAVIOUR_EVENTS

MAX_EVENTS = 400
"""The most events of a page that are kept."""

_MAX_LENGTH = 64
_FIELDS = 4


def parse_events(text: str, *, behaviour: bool) -> tuple[Event, ...]:
    """Read the log that came with a page.

    An answer is never refused for its log: whatever makes no sense is left out.

    Args:
        text: A JSON list of `[event, target, value, at_ms]`; empty where the browser sent none.
        behaviour: Whether the study logs how pictures are looked at; if not, such events are left out.
    """
    try:
        entries = json.loads(text) if text else []
    except (ValueError, RecursionError):
        return ()
    allowed = EVENTS if behaviour else TIMING_EVENTS
    return tuple(_events(entries, allowed))[:MAX_EVENTS] if isinstance(entries, list) else ()


def _events(entries: list[object], allowed: frozenset[str]) -> Iterator[Event]:
    for entry in entries:
        if not isinstance(entry, list) or len(entry) != _FIELDS:
            continue
        name, target, value, at_ms = entry
        if not isinstance(name, str) or name not in allowed:
            continue
        if not isinstance(at_ms, int) or isinstance(at_ms, bool) or not 0 <= at_ms <= MAX_RESPONSE_TIME_MS:
            continue
        yield Event(name, _short(target), _short(value), at_ms)


def _short(value: object) -> str:
    text = "" if value is None else str(value)
    return "".join(character for character in text if character.isprintable())[:_MAX_LENGTH]
