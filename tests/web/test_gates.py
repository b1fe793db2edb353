from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.faults.gates import CONTROLLED, OPEN_GATES, Gate, Start, gates, prepare, start
from tests.faults.read_only import take_and_give_back

pytestmark = pytest.mark.sqlite_only(reason="the gates are those of SQLite's file and of the settings")


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An instance that has served."""
    folder = tmp_path_factory.mktemp("served") / "instance"
    prepare(folder)
    return folder


@pytest.fixture
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(2) as pool:
        yield pool


def test_a_server_in_order_starts_without_a_word(served: Path) -> None:
    assert start(served, Gate("nothing", "")) == Start(None, ())


def test_every_gate_is_closed_or_told_in_one_line(served: Path, pool: ThreadPoolExecutor) -> None:
    starts = list(pool.map(lambda gate: (gate, start(served, gate)), gates()))
    assert [(gate.name, begun) for gate, begun in starts if not begun.is_right(gate)] == []


def test_a_program_whose_gates_are_open_is_found_out(served: Path, pool: ThreadPoolExecutor) -> None:
    chosen = [gate for gate in gates() if gate.name in CONTROLLED]
    starts = list(pool.map(lambda gate: (gate, start(served, gate, OPEN_GATES)), chosen))
    assert [gate.name for gate, begun in starts if begun.is_right(gate)] == []


def test_a_folder_that_turns_read_only_loses_nothing_and_people_are_asked_to_wait(tmp_path: Path) -> None:
    outcome = take_and_give_back(tmp_path / "instance", 1)
    assert outcome.is_clean, outcome
