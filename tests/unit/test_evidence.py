"""docs/evidence.md follows from the committed results, and a result from what a program printed."""

import json
from pathlib import Path

from tests.evidence.measurements import FAULTS, LOAD
from tests.evidence.page import NOT_RUN, PATH, render
from tests.evidence.record import told_in
from tests.evidence.results import Result, read_results, write_result

A_RESULT = Result(
    told=({"test": "F13 simultaneous starts", "counts": {"rounds": 200, "worst": 1}, "control": {"worst": 9}},),
    status=0,
    command="python -m tests.faults.assignment --full",
    date="2031-03-01 09:30",
    commit="0123456789ab",
    machine="2 processors",
    versions={"Python": "3.11.7"},
)


def test_the_page_follows_from_the_committed_results_byte_for_byte() -> None:
    assert PATH.read_text(encoding="utf-8") == render(read_results())


def test_every_fault_from_f1_to_f20_has_its_row() -> None:
    assert [measurement.id for measurement in FAULTS] == [f"F{number}" for number in range(1, 21)]


def test_what_has_no_result_is_said_not_to_have_been_run() -> None:
    page = render({})
    assert page.count(NOT_RUN) == len(FAULTS) + len(LOAD) + _HEAD_MENTIONS
    assert "as promised" not in page


def test_a_result_is_told_with_its_numbers_its_control_and_its_surroundings(tmp_path: Path) -> None:
    write_result("assignment", A_RESULT, tmp_path)
    page = render(read_results(tmp_path))
    for told in ("rounds: 200", "control: worst 9", "0123456789ab", "python -m tests.faults.assignment --full"):
        assert told in page


def test_a_broken_promise_is_said_to_be_one(tmp_path: Path) -> None:
    broken = Result(**{name: getattr(A_RESULT, name) for name in Result.__slots__} | {"status": 1})
    write_result("assignment", broken, tmp_path)
    assert "**not as promised**" in render(read_results(tmp_path))


def test_a_result_is_read_as_it_was_written(tmp_path: Path) -> None:
    write_result("assignment", A_RESULT, tmp_path)
    assert read_results(tmp_path) == {"assignment": A_RESULT}


def test_only_lines_that_tell_of_a_test_are_kept() -> None:
    line = {"test": "F1", "counts": {}}
    assert told_in(f"starting\n{json.dumps({'people': 3})}\n{json.dumps(line)}\n") == [line]


def test_every_module_that_measures_is_there(root: Path) -> None:
    for measurement in (*FAULTS, *LOAD):
        if measurement.command:
            module = measurement.command.split()[0]
            assert (root / module.replace(".", "/")).with_suffix(".py").exists(), module


_HEAD_MENTIONS = render({}).split("## Faults")[0].count(NOT_RUN)
