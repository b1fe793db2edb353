"""What was acknowledged against what is stored: the one judge of all fault tests.

Participants write down what they send before they send it, and once more when they were told that it is stored. After
the fault, with the database recovered, the two must agree with its rows.
"""

import json
import threading
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from sqlalchemy import Connection, text

PageKey = tuple[str, int]
"""Whose page: the hash of the participant's token, and the page's number."""

_CONSENTS = "SELECT token_hash FROM participants"
_PAGES = """
SELECT participants.token_hash, pages.number, pages.nonce
FROM pages JOIN participants ON participants.id = pages.participant_id
"""
_RATINGS = """
SELECT participants.token_hash, ratings.page_number, ratings.item, ratings.rating
FROM ratings JOIN participants ON participants.id = ratings.participant_id
"""


@dataclass(frozen=True, slots=True)
class Sheet:
    """A page as it was sent or stored.

    Attributes:
        key: Whose page; page 0 is the consent.
        nonce: The nonce that came with it.
        ratings: By item; empty for a page that has none.
    """

    key: PageKey
    nonce: str
    ratings: tuple[tuple[str, int], ...] = ()


@dataclass(slots=True)
class Ledger:
    """What participants sent and what was acknowledged. Threads may share it."""

    sent: set[Sheet] = field(default_factory=set)
    acknowledged: list[Sheet] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def send(self, sheet: Sheet) -> None:
        """Note what is about to be sent."""
        with self.lock:
            self.sent.add(sheet)

    def acknowledge(self, sheet: Sheet) -> None:
        """Note that the sender was told that it is stored."""
        with self.lock:
            self.acknowledged.append(sheet)

    @property
    def num_ratings(self) -> int:
        """How many ratings were acknowledged."""
        return sum(len(sheet.ratings) for sheet in self.acknowledged)


@dataclass(frozen=True, slots=True)
class Verdict:
    """How many pages are not as they should be; all 0 if nothing went wrong.

    Attributes:
        lost: Acknowledged, and not there.
        wrong: Acknowledged, and there with something else on it.
        doubled: There more than once.
        ghosts: There, and never sent like that.
    """

    lost: int = 0
    wrong: int = 0
    doubled: int = 0
    ghosts: int = 0

    @property
    def is_clean(self) -> bool:
        """Whether everything is as it should be."""
        return self == Verdict()

    def __add__(self, other: "Verdict") -> "Verdict":
        return Verdict(*(mine + theirs for mine, theirs in zip(_counts(self), _counts(other), strict=True)))

    def to_json(self) -> dict[str, int]:
        """Return the counts by name."""
        return asdict(self)


def judge(acknowledged: Iterable[Sheet], sent: Iterable[Sheet], stored: Iterable[Sheet]) -> Verdict:
    """Compare what was acknowledged and sent with what is stored."""
    rows = list(stored)
    by_key = {sheet.key: sheet for sheet in rows}
    copies = Counter(sheet.key for sheet in rows)
    told = {sheet.key: sheet for sheet in acknowledged}
    return Verdict(
        lost=sum(key not in by_key for key in told),
        wrong=sum(key in by_key and by_key[key] != sheet for key, sheet in told.items()),
        doubled=sum(number - 1 for number in copies.values()),
        ghosts=len(set(rows) - set(sent)),
    )


def stored_sheets(connection: Connection) -> list[Sheet]:
    """Read every stored consent and page."""
    consents = [Sheet((str(token_hash), 0), "") for (token_hash,) in connection.execute(text(_CONSENTS))]
    ratings: dict[PageKey, list[tuple[str, int]]] = {}
    for token_hash, number, item, rating in connection.execute(text(_RATINGS)):
        ratings.setdefault((token_hash, number), []).append((item, rating))
    return consents + [
        Sheet(key, nonce, tuple(sorted(ratings.get(key, ()))))
        for *key_parts, nonce in connection.execute(text(_PAGES))
        for key in [(str(key_parts[0]), int(key_parts[1]))]
    ]


def bound(num_acknowledged: int) -> str:
    """Say what no loss in so many proves: the rate is below 3 / n with 95 % confidence (the rule of three)."""
    return f"< {3 / num_acknowledged:.1e} lost per acknowledgement at 95 %" if num_acknowledged else "nothing measured"


def evidence(test: str, counts: Mapping[str, Any], **more: object) -> str:
    """Return the line of JSON that a fault test leaves."""
    return json.dumps({"test": test, "counts": dict(counts)} | more)


def _counts(verdict: Verdict) -> tuple[int, ...]:
    return (verdict.lost, verdict.wrong, verdict.doubled, verdict.ghosts)
