"""The table in docs/security.md: every requirement once, each with a test that exists, a decision or a deviation."""

import re

from tests.conftest import ROOT
from tests.security.asvs_numbers import NUMBERS

DOCUMENT = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
_ROW = re.compile(r"^\| (\d+\.\d+\.\d+) \| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)
_NOT_OURS = re.compile(r"^- ([\d., ]+): ", re.MULTILINE)
_TEST = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")


def rows(text: str) -> list[tuple[str, str, str]]:
    return _ROW.findall(text)


def missing_tests(text: str) -> list[str]:
    """The tests that are named and are not there."""
    named = _TEST.findall(text)
    contents = {file: (ROOT / file).read_text(encoding="utf-8") for file, _ in named if (ROOT / file).exists()}
    return [f"{file}::{name}" for file, name in named if f"def {name}(" not in contents.get(file, "")]


def test_every_requirement_of_levels_1_and_2_stands_there_once() -> None:
    told = [number for number, *_ in rows(DOCUMENT)]
    told += [number for line in _NOT_OURS.findall(DOCUMENT) for number in re.split(r", ", line)]
    assert len(NUMBERS) == 217
    assert NUMBERS - set(told) == set()
    assert sorted(told) == sorted(set(told))


def test_each_has_a_test_a_decision_or_a_deviation() -> None:
    for number, _, shown in rows(DOCUMENT):
        assert _TEST.search(shown) or re.search(r"(Decision|Deviation): \S", shown), number


def test_every_test_that_is_named_exists() -> None:
    assert len(_TEST.findall(DOCUMENT)) > 150
    assert missing_tests(DOCUMENT) == []
    # The control.
    gone = "`tests/security/test_routes.py::test_gone`"
    assert missing_tests(f"{gone} `tests/gone.py::test_x`") == [gone.strip("`"), "tests/gone.py::test_x"]


def test_the_levels_that_were_promised_are_reached() -> None:
    deviating = [number for number, _, shown in rows(DOCUMENT) if shown.startswith("Deviation")]
    assert len(set(deviating) & NUMBERS) <= 12
