"""The allocation ledger read again: as rows for the data, and drawn anew to prove that it adds up."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, select

from webapp.storage.contents import Remembered, Source
from webapp.storage.database import Database
from webapp.storage.records import Action, told_by
from webapp.storage.scope import Scope
from webapp.storage.snapshot import snapshot
from webapp.storage.streams import stream
from webapp.storage.tables import arrangements, participants, record_contents, records, trials
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
    """Yield a row for each experiment of each draw, in order, with a few draws in memory at a time.

    Returns:
        Study, study version, mode, participant (None once erased), record, at, experiment, arrangement, layout order,
        word, uses (by `arrangement/order`), draws, and of the place: when and why it was last given back, and when it
        last counted again (None for never).
    """
    log, told = records.c, record_contents.c
    query = (
        select(log.study, log.study_version, log.mode, participants.c.code, log.number, log.at, told.content)
        .join(record_contents, told.number == log.number)
        .outerjoin(participants, participants.c.id == told.participant_id)
        .where(log.action == "allocated")
        .order_by(log.number)
    )
    returned = _returned(connection)
    for *place, content in stream(connection, query):
        draw = json.loads(content)
        back = returned.get(place[-2], _KEPT)
        for experiment in draw["experiments"]:
            yield (
                *place,
                *(experiment["experiment"], experiment["arrangement"], experiment["layout_order"], draw["word"]),
                *(experiment["uses"], draw["draws"], back.released_at, back.why, back.resumed_at),
            )


def replay(database: Database) -> Replay:
    """Draw everything again from what the ledgers hold, and compare it with what is there and with what people got."""
    problems: list[str] = []
    ledgers: dict[Scope, _Ledger] = {}
    num_allocations = num_before = 0
    with snapshot(database) as connection:
        scopes = _scopes(connection)
        source = Remembered(connection)
        for number, _, _, action, participant_id, _, content in told_by(connection, *_ACTIONS):
            ledger = ledgers.setdefault(scopes[number], _Ledger())
            if action == "allocated":
                num_allocations += 1
                num_before += content["word"] is None
                if participant_id is not None:
                    problems += [f"record {number}: {problem}" for problem in _given(source, participant_id, content)]
            problems += [f"record {number}: {problem}" for problem in ledger.take(number, action, content)]
    return Replay(num_allocations, num_before, tuple(problems))


def _given(source: Source, participant_id: int, content: Mapping[str, Any]) -> Iterator[str]:
    """Yield what a participant was given otherwise than the ledger says."""
    rows = source.rows(arrangements, participant_id)
    given = {row["experiment"]: (row["arrangement"], row["layout_order"]) for row in rows}
    drawn = {told["experiment"]: _cell(told) for told in content["experiments"]}
    if given != drawn:
        yield f"drew {drawn}, and the participant has {given}"
    draws = [row["draw"] for row in source.rows(trials, participant_id) if row["draw"] is not None]
    if content["word"] is not None and draws != content["draws"]:
        yield f"drew {content['draws']} for random explanations, and the participant has {draws}"


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


@dataclass(frozen=True, slots=True)
class _Returned:
    """When and why a place was last given back, and when it last counted again."""

    released_at: datetime | None = None
    why: str | None = None
    resumed_at: datetime | None = None


_KEPT = _Returned()


def _returned(connection: Connection) -> dict[int, _Returned]:
    """Return what became of places, by the number of the draw's record; of those alone that were ever given back."""
    found: dict[int, _Returned] = {}
    for _, at, _, action, _, _, content in told_by(connection, "slot_released", "slot_resumed", "erased"):
        slot = content["slot"]
        before = found.get(slot, _KEPT)
        if action == "slot_resumed":
            found[slot] = replace(before, resumed_at=at)
        else:
            found[slot] = replace(before, released_at=at, why=content.get("why", "erased"))
    return found


def _scopes(connection: Connection) -> dict[int, Scope]:
    query = select(records.c.number, records.c.study, records.c.study_version, records.c.mode)
    known: dict[tuple[str, str, str], Scope] = {}
    found: dict[int, Scope] = {}
    for number, *key in connection.execute(query.where(records.c.action.in_(_ACTIONS))):
        found[number] = known.setdefault(tuple(key), Scope(*key))
    return found


def uses_of(told: Mapping[str, Any]) -> dict[_Cell, int]:
    """Return the counts that an experiment was drawn from, by arrangement and order."""
    return {(int(a), int(o)): count for (a, o), count in ((cell.split("/"), n) for cell, n in told["uses"].items())}


def _cell(told: Mapping[str, Any]) -> _Cell:
    return told["arrangement"], told["layout_order"]
