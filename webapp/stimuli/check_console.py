"""A check of a study as a terminal shows it."""

from collections.abc import Mapping

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from webapp.stimuli.arm_linter import MEASURES, Arm, ArmReport, Measure, Spread
from webapp.stimuli.checking import Check
from webapp.stimuli.duration import ASSUMPTIONS

_ENOUGH_TO_ROUND = 10
_AGENTS = {
    "learned": "The arms are those of the built bundle.",
    "planner": "The arms are those of agents that know the world exactly: the study was not built since it changed.",
}
_UNKNOWN = "Required participants: not computed for this design and plan; run `xar power STUDY`."

_HEADINGS: Mapping[Measure, str] = {
    "pictures": "shown",
    "words": "words",
    "words_heard": "heard",
    "seconds": "seconds",
    "kilobytes": "kB",
}
_LEGEND = (
    "shown: pictures; words: to read; heard: in the pictures' descriptions, by screen reader; seconds: to take in; "
    "fidelity: P(reaching the goal) acting as shown, at random elsewhere - what the kinds are meant to differ in."
)


def render_check(check: Check) -> RenderableType:
    """Lay out what a check found: a table of the arms of each experiment, warnings, length and notes."""
    study = check.study
    duration = check.duration
    assumptions = "; ".join(f"{what}: {assumed}" for what, assumed in ASSUMPTIONS.items())
    summary = [
        f"Study {study.name}: its files can be used.",
        _AGENTS[check.agents],
        f"About {duration.median:.0f} minutes, by arrangement {duration.shortest:.1f} to {duration.longest:.1f}.",
        f"Assumed: {assumptions}.",
        f"Every arrangement is used equally often after each {check.full_round} participants.",
        _UNKNOWN if check.required is None else str(check.required),
    ]
    parts: list[RenderableType] = [part for report in check.arms for part in _experiment(report)]
    notes = [Text(f"Note: {note}") for note in check.notes]
    return Group(*parts, _LEGEND, "", *(Text(line) for line in summary), *notes)


def _experiment(report: ArmReport) -> list[RenderableType]:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column(f"experiment {report.experiment}", no_wrap=True)
    table.add_column("layout", no_wrap=True)
    for heading in (*(_HEADINGS[measure] for measure in MEASURES), "fidelity"):
        table.add_column(heading, justify="right")
    for arm in report.arms:
        table.add_row(*_row(arm))
    return [table, *(Text(f"Warning: {confound}") for confound in report.confounds)]


def _row(arm: Arm) -> list[str]:
    name = f"= {arm.kind}" if arm.is_like_subgoals else arm.kind
    return [name, arm.layout, *(_range(spread) for spread in arm.measures.values()), f"{arm.fidelity.mean:.2g}"]


def _range(spread: Spread) -> str:
    lowest, highest = _number(spread.lowest), _number(spread.highest)
    return lowest if lowest == highest else f"{lowest}-{highest}"


def _number(value: float) -> str:
    return f"{value:.0f}" if value >= _ENOUGH_TO_ROUND or value == int(value) else f"{value:.1f}"
