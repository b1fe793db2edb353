"""docs/mutants.md from the recorded run and the reasons in survivors.toml; nothing else is on it."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.conftest import ROOT
from tests.evidence.results import Result
from tests.faults.mutation_areas import AREAS, SHARE_TO_REACH

PATH = ROOT / "docs/mutants.md"
REASONS = Path(__file__).with_name("survivors.toml")
NO_REASON = "No reason is given yet."

_HEAD = """# Mutants

Tests that pass show little unless they fail when the program is wrong. `make mutants` makes the program wrong in one
small way after another, in a copy of the tree, and runs the tests of the changed module: a mutant is *killed* if one of
them fails or hangs. It writes this page; a test sees to it that at least {share} % are killed in each area and that
each survivor has its reason.

The mutants are those of [mutmut](https://github.com/boxed/mutmut) (operators, numbers, texts, arguments, assignments).
Mutmut leaves alone what has a decorator, such as the views, and what stands outside functions, such as limits and
prepared queries; it leaves out no statement and turns no condition round. That is done by
`tests/faults/source_changes.py`. Not changed: templates, migrations, and the modules that are not named
below. A mutant that lives is no fault of the program; it is a change that the tests of that module do not see.
"""

Told = Mapping[str, Any]
Key = tuple[str, tuple[str, ...]]


def write_page(result: Result) -> Path:
    """Write the page and return where it is."""
    PATH.write_text(render(result, read_reasons()), encoding="utf-8")
    return PATH


def read_reasons() -> dict[Key, str]:
    """Return why a survivor may live, by its module and the changed lines."""
    entries = tomllib.loads(REASONS.read_text(encoding="utf-8")).get("survivor", [])
    return {(entry["module"], tuple(entry["diff"])): entry["reason"] for entry in entries}


def key_of(survivor: Told) -> Key:
    """Return what a survivor's reason stands under."""
    return survivor["module"], tuple(survivor["diff"])


def render(result: Result, reasons: Mapping[Key, str]) -> str:
    """Return the page."""
    lines = [_HEAD.format(share=round(100 * SHARE_TO_REACH)), *_surroundings(result), *_table(result.told)]
    for told in result.told:
        lines += _survivors(told, reasons)
    return "\n".join(lines).rstrip("\n") + "\n"


def _surroundings(result: Result) -> Iterator[str]:
    versions = ", ".join(f"{name} {result.versions[name]}" for name in ("Python", "mutmut", "sqlalchemy", "flask"))
    yield f"{result.date} UTC, commit {result.commit} (`+`: the program had been changed since); {versions}."
    if result.note:
        yield f"Note: {result.note}."
    yield ""


def _table(told: Sequence[Told]) -> Iterator[str]:
    yield "| area | module | mutants | killed | by a time limit | survived | no test | share killed |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    for one in told:
        for module, counts in one["modules"].items():
            yield f"| {one['test']} | `{module}` | {_counts(counts)} |"
        total = {
            fate: sum(counts.get(fate, 0) for counts in one["modules"].values())
            for fate in ("killed", "timed_out", "survived", "no_test")
        }
        yield f"| **{one['test']}** | all | {_counts(total)} |"
    missing = [area.name for area in AREAS if area.name not in {one["test"] for one in told}]
    yield from (f"| {name} | | not run | | | | | |" for name in missing)
    yield ""
    for one in told:
        num_tested = sum(sum(counts.values()) for counts in one["modules"].values())
        if one.get("made", 0) > num_tested:
            drawn = f"{num_tested} mutants were drawn from {one['made']}, in turns from each function"
            yield f"{one['test'].capitalize()}: {drawn}."
            yield ""


def _counts(counts: Mapping[str, int]) -> str:
    fates = [counts.get(fate, 0) for fate in ("killed", "timed_out", "survived", "no_test")]
    share = (fates[0] + fates[1]) / max(sum(fates), 1)
    return " | ".join(map(str, (sum(fates), *fates))) + f" | {share:.1%}"


def _survivors(told: Told, reasons: Mapping[Key, str]) -> Iterator[str]:
    yield f"## Survivors: {told['test']}"
    yield ""
    if not told["survivors"]:
        yield "None."
        yield ""
    grouped: dict[tuple[str, str], list[Told]] = {}
    for survivor in told["survivors"]:
        reason = reasons.get(key_of(survivor), NO_REASON)
        grouped.setdefault((survivor["module"], reason), []).append(survivor)
    for (module, reason), survivors in grouped.items():
        yield f"`{module}`: {reason}"
        yield ""
        yield "```diff"
        for survivor in survivors:
            yield from survivor["diff"]
        yield "```"
        yield ""
