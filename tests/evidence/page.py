"""docs/evidence.md from the results; nothing is on it that is not in them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tests.conftest import ROOT
from tests.evidence.measurements import FAULTS, LOAD, Measurement
from tests.evidence.results import Result

PATH = ROOT / "docs/evidence.md"
NOT_RUN = "not run"

_HEAD = """# Evidence

Made by `make evidence` from the files in `results/evidence`, which `make soak` writes. What has no file there was not
run in full.

No loss in n acknowledged answers bounds the rate of losses below 3 / n with 95 % confidence (the rule of three); it
does not say that nothing is ever lost. A control is the same test without the protection: it has to fail, or the test
shows nothing. `+` after a commit: the program had been changed since.
"""


def render(results: Mapping[str, Result]) -> str:
    """Return the page."""
    lines = [_HEAD, "## Faults", "", *_table(FAULTS, results), "## Load", "", *_table(LOAD, results)]
    for measurement in (*FAULTS, *LOAD):
        for name in measurement.results:
            if name in results:
                lines += _section(measurement, results[name])
    return "\n".join(lines).rstrip("\n") + "\n"


def _table(measurements: Sequence[Measurement], results: Mapping[str, Result]) -> Iterator[str]:
    yield "| test | what | result | made | commit |"
    yield "| --- | --- | --- | --- | --- |"
    for measurement in measurements:
        found = [results[name] for name in measurement.results if name in results]
        if not found:
            yield f"| {measurement.id} | {measurement.what} | {NOT_RUN} | | |"
        for result in found:
            verdict = "as promised" if result.status == 0 else "**not as promised**"
            yield f"| {measurement.id} | {measurement.what} | {verdict} | {result.date} | {result.commit} |"
    yield ""


def _section(measurement: Measurement, result: Result) -> Iterator[str]:
    yield f"## {measurement.id}: {measurement.what}"
    yield ""
    yield f"`{result.command}`"
    yield ""
    versions = ", ".join(f"{name} {number}" for name, number in result.versions.items())
    yield f"{result.date} UTC, commit {result.commit}; {result.machine}; {versions}."
    if result.note:
        yield f"Note: {result.note}."
    yield ""
    for told in result.told:
        yield from _told(told)


def _told(told: Mapping[str, Any]) -> Iterator[str]:
    yield f"**{told['test']}**"
    yield ""
    counts = told.get("counts", {})
    if counts and all(isinstance(value, dict) for value in counts.values()):
        yield from _columns(counts)
    else:
        yield from (f"- {_words(name)}: {_value(value)}" for name, value in counts.items())
    yield from (f"- {_words(name)}: {_value(value)}" for name, value in told.items() if name not in {"test", "counts"})
    yield ""


def _columns(counts: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    names = list(dict.fromkeys(name for column in counts.values() for name in column))
    yield "| | " + " | ".join(counts) + " |"
    yield "| --- |" + " ---: |" * len(counts)
    for name in names:
        yield f"| {_words(name)} | " + " | ".join(_value(column.get(name, "")) for column in counts.values()) + " |"
    yield ""


def _words(name: str) -> str:
    return name.replace("_", " ")


def _value(value: object) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{_words(str(name))} {_value(inner)}" for name, inner in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_value, value))
    return str(value)
