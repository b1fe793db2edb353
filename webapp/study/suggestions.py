"""What somebody probably meant by a name that is not there."""

import difflib
from collections.abc import Iterable


def meant(value: object, known: Iterable[str]) -> str:
    """Return the beginning of a wish, `did you mean 'x'? `, or nothing where no known name is near."""
    near = nearest(str(value), known)
    return "" if near is None else f"did you mean {near!r}? "


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that is most like another, or None if none is much like it."""
    return next(iter(difflib.get_close_matches(name, list(known), n=1, cutoff=0.75)), None)
