"""Hostile texts, all our own: what somebody might type or put into a link so that a browser runs it as part of a page.

Each one that would become an element or an attribute carries the marker `data-xss`; each one that would run calls
`hit()` or opens a dialog, and a policy that stops it says so. A page that shows them as texts has none of the three.
"""

from urllib.parse import quote_from_bytes

from tests.security.payload_families import FAMILIES

_BROKEN = "surrogateescape"
"""How bytes that are no UTF-8 stand in a text here."""


def as_sent(text: str) -> bytes:
    """Return what goes over the wire: UTF-8, but for the bytes that are meant to be broken."""
    return text.encode("utf-8", _BROKEN)


def as_read(text: str) -> str:
    """Return what a server that reads UTF-8 makes of it."""
    return as_sent(text).decode("utf-8", "replace")


def as_quoted(text: str) -> str:
    """Return what Werkzeug makes of it in an address: broken bytes stay as they were written there."""
    return "".join(f"%{ord(one) & 0xFF:02X}" if "\udc80" <= one <= "\udcff" else one for one in text)


def in_address(text: str) -> str:
    """Return the text for a part of an address."""
    return quote_from_bytes(as_sent(text), safe="")


def shown(text: str) -> str:
    """Return a text as it can be compared with what a page shows.

    HTML has no NUL, and a browser makes every kind of line break and of blank the same where it lays out a text.
    """
    return " ".join(text.replace("\0", "").replace("\ufffd", "").split())


PAYLOADS: tuple[str, ...] = tuple(dict.fromkeys(text for family in FAMILIES for text in family()))
"""More than 200 of them, no two the same."""


def fitting(length: int) -> tuple[str, ...]:
    """Return those that a field of so many characters takes whole, as a server reads them; no blanks at the ends."""
    read = dict.fromkeys(as_read(text).strip() for text in PAYLOADS)
    return tuple(text for text in read if 0 < len(text) <= length)
