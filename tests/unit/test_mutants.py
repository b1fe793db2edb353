"""The page about mutants follows from the recorded run, every survivor has a reason, and changes are what they say."""

import ast
from collections import Counter

import pytest

from tests.conftest import ROOT
from tests.evidence.results import Result, read_results
from tests.faults.mutation import drawn
from tests.faults.mutation_areas import AREAS, SHARE_TO_REACH
from tests.faults.mutation_page import NO_REASON, PATH, key_of, read_reasons, render
from tests.faults.source_changes import changes

MODULE = '''
"""A module."""

LIMIT: int = 5


@decorated
def view(limit: int = 3) -> bool:
    """Return whether it is so."""
    tell("begun")
    if not limit > LIMIT:
        raise ValueError
    return limit == 4 and LIMIT is not None


def plain(number: int) -> int:
    store(number)
    return number + 1
'''
EXPECTED = [
    ("", "5", "6"),
    ("view", "@decorated", ""),
    ("view", 'tell("begun")', "pass"),
    ("view", "not limit > LIMIT", "(not (not limit > LIMIT))"),
    ("view", "not limit > LIMIT", "limit > LIMIT"),
    ("view", "limit > LIMIT", "limit >= LIMIT"),
    ("view", "raise ValueError", "pass"),
    ("view", "limit == 4 and LIMIT is not None", "None"),
    ("view", "limit == 4 and LIMIT is not None", "limit == 4 or LIMIT is not None"),
    ("view", "limit == 4", "limit != 4"),
    ("view", "4", "5"),
    ("view", "LIMIT is not None", "LIMIT is None"),
    ("plain", "store(number)", "pass"),
]


def recorded() -> Result:
    return read_results()["mutants"]


def test_the_page_follows_from_the_recorded_run_byte_for_byte() -> None:
    assert PATH.read_text(encoding="utf-8") == render(recorded(), read_reasons())


def test_enough_mutants_are_killed_in_every_area() -> None:
    shares = {told["test"]: told["killed_share"] for told in recorded().told}
    assert set(shares) == {area.name for area in AREAS}
    assert {name: share for name, share in shares.items() if share < SHARE_TO_REACH} == {}


def test_the_counts_add_up_and_as_many_survivors_are_listed_as_there_are() -> None:
    for told in recorded().told:
        fates = [fate for counts in told["modules"].values() for fate, number in counts.items() for _ in range(number)]
        alive = [fate for fate in fates if fate in {"survived", "no_test"}]
        assert sorted(alive) == sorted(survivor["fate"] for survivor in told["survivors"])
        assert told["killed_share"] == pytest.approx(1 - len(alive) / len(fates), abs=1e-4)
        assert [module for module, counts in told["modules"].items() if not sum(counts.values())] == []


def test_every_survivor_has_a_reason_and_every_reason_a_survivor() -> None:
    survivors = {key_of(survivor) for told in recorded().told for survivor in told["survivors"]}
    reasons = read_reasons()
    assert survivors - set(reasons) == set()
    assert set(reasons) - survivors == set()
    assert [key for key, reason in reasons.items() if len(reason.split()) < 3] == []
    assert NO_REASON not in PATH.read_text(encoding="utf-8")


def test_every_module_and_every_test_that_is_named_is_there() -> None:
    named = [path for area in AREAS for module, tests in area.tests.items() for path in (module, *tests)]
    assert [path for path in named if not (ROOT / path).is_file()] == []


def test_changes_are_those_that_mutmut_leaves_out() -> None:
    found = list(changes(MODULE))
    assert [(change.function, change.old, change.new) for change in found] == EXPECTED


def test_what_is_drawn_is_always_the_same_and_comes_from_every_function_in_turns() -> None:
    found = [f"{function}{number}" for function, size in (("a", 2), ("b", 40), ("c", 9)) for number in range(size)]
    chosen = drawn(found, 12, lambda name: name[0])
    assert chosen == drawn(found, 12, lambda name: name[0])
    assert len(set(chosen)) == 12
    assert Counter(name[0] for name in chosen) == {"a": 2, "b": 5, "c": 5}
    assert drawn(found, None, str) == drawn(found, 51, str) == found


@pytest.mark.parametrize("module", [module for area in AREAS for module in area.tests])
def test_each_change_is_one_line_of_a_program_that_can_be_read(module: str) -> None:
    source = (ROOT / module).read_text(encoding="utf-8")
    made = [change.source for change in changes(source)]
    assert made
    assert len({*made, source}) == len(made) + 1
    assert all(ast.parse(text) for text in made)
