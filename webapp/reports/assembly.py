"""The report of a study's data: which sections there are, in which order, and what frames them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from webapp.reports.blocks import Section
from webapp.reports.departures import departures
from webapp.reports.findings import Finding, findings, judged_as_good
from webapp.reports.in_doubt import in_doubt
from webapp.reports.methods import methods_section
from webapp.reports.origin import Origin
from webapp.reports.people import headcount
from webapp.reports.plan_and_run import plan_and_run
from webapp.reports.report import Report
from webapp.reports.sections import (
    calibration,
    drives,
    drop_out,
    equivalence,
    ordinal,
    paper_interaction,
    paper_ratings,
    paper_variances,
    reliability,
    robustness,
)
from webapp.reports.study_data import StudyData
from webapp.reports.summary import summary

Maker = Callable[[StudyData], Section]
"""What makes a section. It never raises on bad or scarce data; a bug raises, and then there is no report."""

SECTIONS: Mapping[str, Maker] = {
    "ordinal": ordinal.section,
    "robustness": robustness.section,
    "equivalence": equivalence.section,
    "drives": drives.section,
    "calibration": calibration.section,
    "reliability": reliability.section,
    "drop_out": drop_out.section,
    "paper_ratings": paper_ratings.section,
    "paper_interaction": paper_interaction.section,
    "paper_variances": paper_variances.section,
}
"""The sections between the plan and the assumptions, in the order in which they are read."""

_NOTHING = Section("nothing", "", ())


@dataclass(frozen=True, slots=True)
class Assembled:
    """A report, with what its first sentences rest on.

    Attributes:
        report: All of it.
        found: What came of each planned comparison.
        differences: From the registered plan, as sentences.
    """

    report: Report
    found: tuple[Finding, ...]
    differences: tuple[str, ...]


def assemble(
    data: StudyData,
    origin: Origin,
    makers: Mapping[str, Maker] = SECTIONS,
    first: tuple[Section, ...] = (),
    more: tuple[Section, ...] = (),
) -> Assembled:
    """Return the whole report.

    Args:
        data: What is analysed.
        origin: Where it comes from.
        makers: By name, what makes the sections between the plan and the assumptions.
        first: Sections that follow the summary.
        more: Sections after those of the makers, which need more than these data.
    """
    made = {name: make(data) for name, make in makers.items()}
    found = _planned_findings(data, made)
    differences = departures(data, found, origin)
    body = (*made.values(), *more)
    sections = (
        summary(data, found, judged_as_good(made.get("equivalence", _NOTHING)), differences),
        *first,
        plan_and_run(data, found, differences),
        *body,
        in_doubt(body),
        methods_section(data, origin, differences),
    )
    return Assembled(
        Report(f"Analysis of {data.study or 'ratings'}", _facts(data, origin), sections), found, differences
    )


def _planned_findings(data: StudyData, made: Mapping[str, Section]) -> tuple[Finding, ...]:
    """Return what came of the planned comparisons, from the section of the ordinal mixed model."""
    return findings(data, made.get("ordinal", _NOTHING))


def _facts(data: StudyData, origin: Origin) -> tuple[tuple[str, str], ...]:
    people = headcount(data)
    of_all = "" if people.everybody is None else f" of {people.everybody:,}"
    return (
        ("Version", data.study_version[:12] or "not told"),
        ("Mode", data.mode),
        ("Participants analysed", f"{people.analysed:,}{of_all}"),
        ("Ratings", f"{people.ratings:,}"),
        ("Input", origin.input_hash[:12]),
        ("xar", f"{origin.versions.get('xar', '')} ({origin.code[:12]})"),
    )
