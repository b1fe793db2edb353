"""Which behaviours take part, and how many bots each gets."""

import difflib
import math
from collections.abc import Mapping

from webapp.bots.behaviours import BEHAVIOURS
from webapp.bots.errors import BotError


def parse_mix(text: str) -> dict[str, float]:
    """Read `name=share,...`; shares are positive numbers of any sum.

    Returns:
        The shares by behaviour, summing to 1.

    Raises:
        BotError: Something else stands there.
    """
    shares: dict[str, float] = {}
    for part in text.split(","):
        name, equals, share = (word.strip() for word in part.partition("="))
        if not equals:
            raise BotError(f"--mix holds {part.strip()!r}; write name=share, separated by commas")
        if name not in BEHAVIOURS:
            raise BotError(f"--mix names {name!r}; {near(name, BEHAVIOURS, 'the behaviours')}")
        if name in shares:
            raise BotError(f"--mix names {name!r} twice; give it one share")
        shares[name] = _share(name, share)
    total = sum(shares.values())
    return {name: share / total for name, share in shares.items()}


def allot(shares: Mapping[str, float], num_bots: int) -> dict[str, int]:
    """Share bots out by largest remainders; between equal remainders the earlier behaviour gets the bot."""
    exact = {name: share * num_bots for name, share in shares.items()}
    counts = {name: math.floor(number) for name, number in exact.items()}
    by_remainder = sorted(exact, key=lambda name: counts[name] - exact[name])
    for name in by_remainder[: num_bots - sum(counts.values())]:
        counts[name] += 1
    return counts


def near(name: str, known: Mapping[str, object], what: str) -> str:
    """Return what may have been meant by a name that is not known."""
    found = difflib.get_close_matches(name, list(known), n=1)
    return f"did you mean {found[0]!r}?" if found else f"{what} are {', '.join(known)}"


def _share(name: str, text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = math.nan
    if not 0 < share < math.inf:
        raise BotError(f"--mix gives {name!r} the share {text!r}; use a number above 0")
    return share
