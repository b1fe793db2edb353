"""The allocation ledger read again: as rows for the data, and drawn anew to prove that it adds up."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, select

from webapp.storage.database import Database
from webapp.storage.records import Action, told_by
from webapp.storage.scope import Scope
from webapp.storage.snapshot import snapshot
from webapp.storage.tables import participants, records
from webapp.study.counterbalancing import choose_cell
from webapp.study.draws import Draws

_Cell = tuple[int, int]

_ACTIONS: tuple[Action, ...] = ("allocated", "slot_released", "slot_resumed", "erased")


@dataclass(frozen=True, slots=True)
class Replay:
    """What came of drawing everything again.

    Attributes:
        num_allocations: How many draws the ledgers hold.
        num_before: How many of them are from before there was a ledger: they count in what later ones were drawn from,
            and cannot be drawn again.
        problems: A line for each draw that cannot be reproduced; none if all is well.
    """

    num_allocations: int
    num_before: int
    problems: tuple[str, ...]


def allocation_rows(connection: Connection) -> Iterator[tuple[object, ...]]:
    """Yield a row for each experiment of each draw, in order.

    Returns:
        Study, study version, mode, participant (None once erased), record, at, experiment, arrangement, layout order,
        word, uses (by `arrangement/order`), draws, and of the place: when and why it was last given back, and when it
        last counted again (None for never).
    """
    for slot in _slots(connection).values():
        for told in slot.content["experiments"]:
            yield (
                *(slot.study, slot.study_version, slot.mode, slot.code, slot.number, slot.at),
                *(told["experiment"], told["arrangement"], told["layout_order"], slot.content["word"], told["uses"]),
                *(slot.content["draws"], slot.released_at, slot.why, slot.resumed_at),
            )


def replay(database: Database) -> Replay:
    """Draw everything again from what the ledgers hold, and compare."""
    problems: list[str] = []
    ledgers: dict[Scope, _Ledger] = {}
    num_allocations = num_before = 0
    with snapshot(database) as connection:
        scopes = _scopes(connection)
        for number, _, _, action, _, _, content in told_by(connection, *_ACTIONS):
            ledger = ledgers.setdefault(scopes[number], _Ledger())
            if action == "allocated":
                num_allocations += 1
                num_before += content["word"] is None
            problems += [f"record {number}: {problem}" for problem in ledger.take(number, action, content)]
    return Replay(num_allocations, num_before, tuple(problems))


@dataclass(slots=True)
class _Ledger:
    """One ledger as far as it has been read: how often each cell of each experiment counts, and who has which."""

    uses: Counter[tuple[str, _Cell]] = field(default_factory=Counter)
    slots: dict[int, tuple[tuple[str, _Cell], ...]] = field(default_factory=dict)
    free: set[int] = field(default_factory=set)

    def take(self, number: int, action: str, content: Mapping[str, Any]) -> Iterator[str]:
        """Take the next record, and yield what is wrong with it."""
        if action == "allocated":
            yield from self._draw(content)
            cells = tuple((told["experiment"], _cell(told)) for told in content["experiments"])
            self.slots[number] = cells
            self.uses.update(cells)
            return
        slot = content["slot"]
        if slot not in self.slots:
            yield f"is about the place of record {slot}, which was not given"
            return
        counts_before, counts_after = slot not in self.free, action == "slot_resumed"
        if counts_before and not counts_after:
            self.uses.subtract(self.slots[slot])
            self.free.add(slot)
        elif counts_after and not counts_before:
            self.uses.update(self.slots[slot])
            self.free.remove(slot)

    def _draw(self, content: Mapping[str, Any]) -> Iterator[str]:
        if content["word"] is None:
            return
        draws = Draws(content["word"])
        for told in content["experiments"]:
            experiment = told["experiment"]
            uses = {cell: count for (name, cell), count in self.uses.items() if name == experiment and count}
            if uses != uses_of(told):
                yield f"experiment {experiment!r} was drawn from other counts than the ledger gives"
            num_arrangements, num_orders = told["sizes"]
            try:
                drawn = choose_cell(uses_of(told), num_arrangements, num_orders, draws)
            except ValueError as error:
                yield f"experiment {experiment!r} cannot be drawn from what it was drawn from: {error}"
                continue
            if drawn != _cell(told):
                yield f"experiment {experiment!r} has {_cell(told)}, and its word gives {drawn}"
        again = [draws.randrange(content["num_draws"]) for _ in content["draws"]]
        if again != content["draws"]:
            yield f"has the draws {content['draws']}, and its word gives {again}"


@dataclass(slots=True)
class _Slot:
    number: int
    at: datetime
    study: str
    study_version: str
    mode: str
    code: str | None
    content: Mapping[str, Any]
    released_at: datetime | None = None
    why: str | None = None
    resumed_at: datetime | None = None


def _slots(connection: Connection) -> dict[int, _Slot]:
    scopes, codes = _scopes(connection), _codes(connection)
    found: dict[int, _Slot] = {}
    for number, at, _, action, participant_id, _, content in told_by(connection, *_ACTIONS):
        if action == "allocated":
            scope = scopes[number]
            code = codes.get(participant_id)
            found[number] = _Slot(number, at, scope.study, scope.study_version, scope.mode, code, content)
        elif (slot := found.get(content["slot"])) is not None and action == "slot_resumed":
            slot.resumed_at = at
        elif slot is not None:
            slot.released_at, slot.why = at, content.get("why", "erased")
    return found


def _scopes(connection: Connection) -> dict[int, Scope]:
    query = select(records.c.number, records.c.study, records.c.study_version, records.c.mode)
    known: dict[tuple[str, str, str], Scope] = {}
    found: dict[int, Scope] = {}
    for number, *key in connection.execute(query.where(records.c.action.in_(_ACTIONS))):
        found[number] = known.setdefault(tuple(key), Scope(*key))
    return found


def _codes(connection: Connection) -> dict[int, str]:
    return dict(tuple(row) for row in connection.execute(select(participants.c.id, participants.c.code)))


def uses_of(told: Mapping[str, Any]) -> dict[_Cell, int]:
    """Return the counts that an experiment was drawn from, by arrangement and order."""
    return {(int(a), int(o)): count for (a, o), count in ((cell.split("/"), n) for cell, n in told["uses"].items())}


def _cell(told: Mapping[str, Any]) -> _Cell:
    return told["arrangement"], told["layout_order"]
