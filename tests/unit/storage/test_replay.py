"""The ledger read as rows for the data: what became of each place, and how little of it is held at a time."""

import tracemalloc
from collections.abc import Iterator, Mapping
from datetime import datetime, timedelta
from typing import Any

from tests.unit.storage.people import NOW
from webapp.storage.database import Database
from webapp.storage.records import SYSTEM, Action, Entry, append
from webapp.storage.replay import allocation_rows
from webapp.storage.scope import Scope

SCOPE = Scope("sakai2021", "v1", "live")
CELLS = 24 * 24


def record(database: Database, *told: tuple[Action, Mapping[str, Any]]) -> list[int]:
    """Append records, one a minute, and return their numbers."""
    with database.write() as connection:
        return [
            append(connection, Entry(minute(number), SYSTEM, action, SCOPE, content=content))
            for number, (action, content) in enumerate(told)
        ]


def minute(number: int) -> datetime:
    return NOW + timedelta(minutes=number)


def draw(num_cells: int = 1) -> tuple[Action, Mapping[str, Any]]:
    uses = {f"{number // 24}/{number % 24}": 1000 + number for number in range(num_cells)}
    told = {"experiment": "1", "arrangement": 3, "layout_order": 2, "uses": uses, "sizes": [24, 24]}
    return "allocated", {"word": "ab", "experiments": [told], "draws": [4, 5], "num_draws": 10}


def rows(database: Database) -> list[tuple[object, ...]]:
    with database.read() as connection:
        return list(allocation_rows(connection))


def test_a_row_says_when_its_place_was_last_given_back_why_and_when_it_counted_again(database: Database) -> None:
    record(
        database,
        *(draw(), draw(), draw(), draw()),
        ("slot_released", {"slot": 2, "why": "expired"}),
        ("slot_resumed", {"slot": 2}),
        ("slot_released", {"slot": 2, "why": "withdrawn"}),
        ("slot_released", {"slot": 3, "why": "screened_out"}),
        ("erased", {"slot": 4}),
    )
    begun = [("sakai2021", "v1", "live", None, number, minute(number - 1), "1", 3, 2, "ab") for number in (1, 2, 3, 4)]
    drawn = ({"0/0": 1000}, [4, 5])
    assert rows(database) == [
        (*begun[0], *drawn, None, None, None),
        (*begun[1], *drawn, minute(6), "withdrawn", minute(5)),
        (*begun[2], *drawn, minute(7), "screened_out", None),
        (*begun[3], *drawn, minute(8), "erased", None),
    ]


def test_the_ledger_of_a_large_design_is_never_held_as_a_whole(database: Database) -> None:
    few, many = 700, 2100
    record(database, *(draw(CELLS) for _ in range(few)))
    of_few = peak_of(database)
    record(database, *(draw(CELLS) for _ in range(many - few)))
    assert len(rows(database)) == many
    assert peak_of(database) < 1.3 * of_few


def peak_of(database: Database) -> int:
    """The most bytes that Python holds while the rows go by."""
    with database.read() as connection:
        tracemalloc.start()
        try:
            _go_by(allocation_rows(connection))
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()


def _go_by(passing: Iterator[object]) -> None:
    for _ in passing:
        pass
