"""What one bot sent, entry by entry."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from webapp.storage.read_back import Entry


@dataclass(slots=True)
class Ledger:
    """What a bot sent: what was acknowledged by page number, and what was still under way when it stopped.

    Attributes:
        acknowledged: By page number.
        under_way: The same.
    """

    acknowledged: dict[int, list[Entry]] = field(default_factory=dict)
    under_way: dict[int, list[Entry]] = field(default_factory=dict)

    def send(self, number: int, entries: Sequence[Entry]) -> None:
        """Note what is about to be sent."""
        self.under_way = {number: list(entries)}

    def acknowledge(self) -> None:
        """Note that the server has it."""
        for number, entries in self.under_way.items():
            self.acknowledged.setdefault(number, []).extend(entries)
        self.under_way = {}

    @property
    def num_pages(self) -> int:
        """How many pages were acknowledged."""
        return sum(("page",) in entries for entries in self.acknowledged.values())
