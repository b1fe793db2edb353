"""The paper's comparison of variances of the general rating: the numbers, and three tests of which it names none."""

from collections.abc import Callable, Iterator
from typing import TypeVar

from webapp.analysis.censoring import Undefined
from webapp.analysis.correlation import pearson
from webapp.analysis.means import shapiro_wilk
from webapp.analysis.two_samples import TestResult
from webapp.analysis.variances import brown_forsythe, pitman_morgan, variance_interval, variance_ratio
from webapp.reports.blocks import Assumption, Block, Cell, Column, Section, Statement, Table
from webapp.reports.formatting import number
from webapp.reports.sections.paper_numbers import GENERAL, VARIANCES
from webapp.reports.sections.paper_printed import printed_variances
from webapp.reports.sections.rated import (
    Rated,
    Undecided,
    independence,
    interval_scale,
    rated_experiments,
    rejections,
    titled,
)
from webapp.reports.study_data import StudyData

_TITLE = "how far general ratings scatter"
_INTRODUCTION = (
    "For Experiment 2 the paper compares the variances of the general rating of two kinds, by their numbers alone: "
    "which test it used, if any, is unknown. Here are the F test, which is the usual and the least trustworthy one for "
    "ratings, as it takes them for normal; the Brown-Forsythe test, which does not; and the Pitman-Morgan test, which "
    "heeds that the same people rated both kinds. All are two-sided and uncorrected. A mean near an end of the scale "
    "makes a variance small by itself."
)
_T = TypeVar("_T")


def section(data: StudyData) -> Section:
    """Compare the variances of the general rating of all pairs of kinds."""
    blocks: list[Block] = [_INTRODUCTION]
    assumptions: list[Assumption] = []
    experiments = rated_experiments(data)
    for rated in experiments:
        subject = f"variances of the general rating in experiment {rated.id}"
        if GENERAL not in rated.items:
            blocks.append(Statement(subject, f"its items do not include {GENERAL}"))
        elif not (rated.frame["item"] == GENERAL).any():
            blocks.append(Statement(subject, f"there are 0 ratings of {GENERAL}"))
        else:
            blocks += [*_variances(rated), *_tests(rated)]
            assumptions += _assumptions(rated)
    if not experiments:
        blocks.append(Statement("variances of the general rating", "there are 0 experiments"))
    return Section("paper_variances", titled(data, _TITLE), tuple(blocks), tuple(assumptions))


def _variances(rated: Rated) -> Iterator[Block]:
    undecided, rows = Undecided(), []
    for kind in rated.kinds_of(GENERAL):
        values = rated.ratings(kind, GENERAL)
        numbers: tuple[Cell, ...] = (None, None, None)
        try:
            found = variance_interval(values)
            numbers = (found.value, found.low, found.high)
        except Undefined as reason:
            undecided.add(kind, reason)
        printed = VARIANCES.get((rated.paper, kind, GENERAL)) if rated.paper else None
        rows.append((kind, values.size, *numbers, *([printed.text if printed else None] if rated.paper == "2" else [])))
    columns = (
        Column("kind", "Kind"),
        Column("num", "Ratings", "count"),
        Column("variance", "Variance", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
        *([Column("paper", "Paper: variance")] if rated.paper == "2" else []),
    )
    title = f"Variances of the general rating in experiment {rated.id}"
    yield Table(f"general_variances_{rated.id}", title, columns, tuple(rows), "Intervals take ratings for normal.")
    yield from undecided.statements(f"variance in experiment {rated.id}")


def _tests(rated: Rated) -> Iterator[Block]:
    if not rated.pairs(GENERAL):
        only = ", ".join(rated.kinds_of(GENERAL))
        yield Statement(f"comparison of variances in experiment {rated.id}", f"the only kind rated is {only}")
        return
    columns = (
        Column("pair", "First / second"),
        Column("ratio", "Ratio of variances", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
        Column("df", "df"),
        Column("p_f", "p, F test", "p"),
        Column("p_brown_forsythe", "p, Brown-Forsythe", "p"),
        Column("pairs", "People with both", "count"),
        Column("p_pitman_morgan", "p, Pitman-Morgan", "p"),
    )
    undecided = Undecided()
    rows = tuple(_test_row(rated, first, second, undecided) for first, second in rated.pairs(GENERAL))
    title = f"Variances of the general rating compared in experiment {rated.id}, uncorrected"
    note = (
        "People with both are those with one rating of each kind. The F test's ratio and interval are of all ratings."
    )
    if rated.compares_planned_pairs:
        note += f" Of {len(rated.kinds)} kinds only the planned pairs are compared."
    yield Table(f"variance_tests_{rated.id}", title, columns, rows, note)
    yield from undecided.statements(f"comparison of variances in experiment {rated.id}")
    if rated.paper == "2":
        yield printed_variances()


def _test_row(rated: Rated, first: str, second: str, undecided: Undecided) -> tuple[Cell, ...]:
    subject = f"{first} / {second}"
    a, b = rated.ratings(first, GENERAL), rated.ratings(second, GENERAL)
    pairs = rated.paired(first, second, GENERAL)
    ratio = _tried(lambda: variance_ratio(a, b), subject, undecided)
    brown = _tried(lambda: brown_forsythe(a, b), subject, undecided)
    morgan = _tried(lambda: pitman_morgan(*pairs), subject, undecided)
    numbers: tuple[Cell, ...] = (None,) * 5
    if ratio:
        interval = ratio.ratio
        df = f"{ratio.freedoms[0]}, {ratio.freedoms[1]}"
        numbers = (interval.value, interval.low, interval.high, df, ratio.p_value)
    p_values = [found.p_value if found else None for found in (brown, morgan)]
    return f"{first} / {second}", *numbers, p_values[0], pairs[0].size, p_values[1]


def _tried(compute: Callable[[], _T], subject: str, undecided: Undecided) -> _T | None:
    try:
        return compute()
    except Undefined as reason:
        undecided.add(subject, reason)
        return None


def _assumptions(rated: Rated) -> Iterator[Assumption]:
    test = f"F tests of variances, experiment {rated.id}"
    yield rejections(test, "ratings of each kind are normal", list(_shapiro(rated)), "kinds")
    yield _unrelated(rated, test)
    yield independence(f"Brown-Forsythe tests, experiment {rated.id}", rated, (GENERAL,))
    yield rejections(
        f"Pitman-Morgan tests, experiment {rated.id}",
        "differences within pairs are normal",
        list(_shapiro_of_pairs(rated)),
        "pairs of kinds",
    )
    yield interval_scale(f"variances, experiment {rated.id}", [rated.points_of(GENERAL)])


def _shapiro(rated: Rated) -> Iterator[TestResult]:
    for kind in rated.kinds_of(GENERAL):
        try:
            yield shapiro_wilk(rated.ratings(kind, GENERAL))
        except Undefined:
            continue


def _shapiro_of_pairs(rated: Rated) -> Iterator[TestResult]:
    for pair in rated.pairs(GENERAL):
        a, b = rated.paired(*pair, GENERAL)
        try:
            yield shapiro_wilk(a - b)
        except Undefined:
            continue


def _unrelated(rated: Rated, test: str) -> Assumption:
    """Say how the ratings of two kinds by the same people correlate."""
    assumes, told, most = "the ratings of two kinds are of different people", [], 0
    for first, second in rated.pairs(GENERAL):
        a, b = rated.paired(first, second, GENERAL)
        most = max(most, a.size)
        try:
            found = pearson(a, b)
        except Undefined:
            continue
        told.append(f"{first}, {second}: r = {number(found.value.value)}")
    if most == 0:
        return Assumption(test, assumes, "nobody rated two kinds", "holds")
    check = "; ".join(told) or "no correlation can be computed"
    return Assumption(test, assumes, f"the same people rated both (up to {most}); {check}", "violated")
