"""The paper's bar charts: means of all ratings by item and kind with t intervals, and unpaired t tests of the kinds."""

from collections.abc import Iterator

from webapp.analysis.censoring import Undefined
from webapp.analysis.means import Described, MeanDifference, describe, shapiro_wilk, unpaired_t
from webapp.analysis.two_samples import TestResult
from webapp.analysis.variances import brown_forsythe
from webapp.reports.blocks import Assumption, Block, Cell, Column, Section, Statement, Table
from webapp.reports.formatting import MINUS, counted
from webapp.reports.sections.paper_figures import bars_figure
from webapp.reports.sections.paper_numbers import COMPARISONS, MEANS, VARIANCES
from webapp.reports.sections.rated import (
    ALPHA,
    Rated,
    Undecided,
    independence,
    interval_scale,
    rated_experiments,
    rejections,
    titled,
    told_apart,
)
from webapp.reports.study_data import StudyData

_TITLE = "ratings by kind"
_INTRODUCTION = (
    "This section and the next two compute what Sakai et al. 2021, section 6, report, in the way in which they do. It "
    "is not the planned analysis: means take the steps of a scale for equal, and the tests take the ratings of one "
    "person for those of several."
)
_BESIDE = " Where the paper prints a number it stands beside ours."
_TEST = (
    "The paper does not name the tests behind its bar charts. Here they are two-sided unpaired t tests with equal "
    "variances (Student's), because the other tests that it names are unpaired t tests; the choice is ours. Nothing is "
    "corrected for the number of tests, as the paper mentions no correction. Differences are first minus second."
)
_UNPAIRED = "unpaired t tests of kinds, experiment {}"


def section(data: StudyData) -> Section:
    """Describe each kind on each item, and compare all pairs of kinds."""
    experiments = rated_experiments(data)
    title, apart = titled(data, _TITLE), told_apart(data, experiments)
    blocks: list[Block] = [_INTRODUCTION, apart] if apart else [_INTRODUCTION + _BESIDE]
    assumptions: list[Assumption] = []
    if not any(len(rated.frame) for rated in experiments):
        blocks.append(Statement("means of ratings", "there are 0 ratings"))
        return Section("paper_ratings", title, tuple(blocks))
    blocks.append(_TEST)
    for rated in experiments:
        if rated.frame.empty:
            blocks.append(Statement(f"means of ratings in experiment {rated.id}", "there are 0 ratings"))
            continue
        described = _described(rated)
        blocks += [bars_figure(rated, described), _means_table(rated, described), *_comparisons(rated)]
        assumptions += _assumptions(rated)
    return Section("paper_ratings", title, tuple(blocks), tuple(assumptions))


def _described(rated: Rated) -> dict[tuple[str, str], Described]:
    """Return what is known of each kind on each item that was rated."""
    found = {}
    for item in rated.items:
        for kind in rated.kinds:
            values = rated.ratings(kind, item)
            if values.size:
                found[kind, item] = describe(values)
    return found


def _means_table(rated: Rated, described: dict[tuple[str, str], Described]) -> Table:
    columns = [
        Column("item", "Item"),
        Column("kind", "Kind"),
        Column("num", "Ratings", "count"),
        Column("mean", "Mean", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
        Column("sd", "SD", "number"),
        Column("variance", "Variance", "number"),
    ]
    rows = []
    for item in rated.items:
        for kind in rated.kinds_of(item):
            one = described.get((kind, item))
            numbers: tuple[Cell, ...] = (0, None, None, None, None, None)
            if one:
                numbers = (one.num, one.mean, one.low, one.high, one.sd, one.variance)
            rows.append((item, kind, *numbers, *_printed_of(rated, kind, item)))
    if rated.paper:
        columns += [Column("paper", "Paper: mean"), Column("paper_variance", "Paper: variance")]
    note = "Intervals are t intervals of the mean, for independent ratings. Where all ratings are equal there is none."
    return Table(f"rating_means_{rated.id}", f"Ratings in experiment {rated.id}", tuple(columns), tuple(rows), note)


def _printed_of(rated: Rated, kind: str, item: str) -> tuple[Cell, ...]:
    if not rated.paper:
        return ()
    found = (printed.get((rated.paper, kind, item)) for printed in (MEANS, VARIANCES))
    return tuple(one.text if one else None for one in found)


def _comparisons(rated: Rated) -> Iterator[Block]:
    if len(rated.kinds) < 2:  # noqa: PLR2004 - one kind has no other.
        yield Statement(f"comparison of kinds in experiment {rated.id}", f"its only kind is {', '.join(rated.kinds)}")
        return
    columns = [
        Column("item", "Item"),
        Column("contrast", "First \N{MINUS SIGN} second"),
        Column("difference", "Difference", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
        Column("t", "t", "number"),
        Column("df", "df", "count"),
        Column("p", "p, two-sided", "p"),
        *([Column("paper", "Paper")] if rated.paper else []),
    ]
    undecided, rows, p_values = Undecided(), [], []
    for item in rated.items:
        for first, second in rated.pairs(item):
            found = _tested(rated, first, second, item, undecided)
            claim = COMPARISONS.get((rated.paper, frozenset({first, second}), item)) if rated.paper else None
            paper = (claim.text if claim else None,) if rated.paper else ()
            rows.append((item, f"{first} {MINUS} {second}", *_numbers(found), *paper))
            p_values += [found.p_two_sided] if found else []
    title = f"Kinds of explanation compared in experiment {rated.id}, uncorrected"
    yield Table(f"kind_comparisons_{rated.id}", title, tuple(columns), tuple(rows), _note(rated, p_values))
    yield from undecided.statements(f"unpaired t test in experiment {rated.id}")


def _tested(rated: Rated, first: str, second: str, item: str, undecided: Undecided) -> MeanDifference | None:
    try:
        return unpaired_t(rated.ratings(first, item), rated.ratings(second, item))
    except Undefined as reason:
        undecided.add(f"{item}, {first} {MINUS} {second}", reason)
        return None


def _numbers(found: MeanDifference | None) -> tuple[Cell, ...]:
    if found is None:
        return (None,) * 6
    gap = found.difference
    return gap.value, gap.low, gap.high, found.statistic, int(found.degrees_of_freedom), found.p_two_sided


def _note(rated: Rated, p_values: list[float]) -> str:
    chosen = (
        f"Of {len(rated.kinds)} kinds only the planned pairs are compared. " if rated.compares_planned_pairs else ""
    )
    return (chosen + _chance_note(p_values)).strip()


def _chance_note(p_values: list[float]) -> str:
    if not p_values:
        return ""
    below = sum(p_value < ALPHA for p_value in p_values)
    return (
        f"{below} of {counted(len(p_values), 'test')} have p < .05. If no two kinds differed at all, "
        f"{ALPHA * len(p_values):.1f} would be expected to."
    )


def _assumptions(rated: Rated) -> Iterator[Assumption]:
    test = _UNPAIRED.format(rated.id)
    normal, equal = list(_shapiro(rated)), list(_equal_variances(rated))
    yield rejections(test, "ratings of each kind on each item are normal", normal, "kinds and items")
    yield rejections(test, "the kinds have equal variances on each item", equal, "items")
    yield independence(test, rated, rated.items)
    yield interval_scale(test, rated.points)


def _shapiro(rated: Rated) -> Iterator[TestResult]:
    for item in rated.items:
        for kind in rated.kinds:
            try:
                yield shapiro_wilk(rated.ratings(kind, item))
            except Undefined:
                continue


def _equal_variances(rated: Rated) -> Iterator[TestResult]:
    for item in rated.items:
        samples = [rated.ratings(kind, item) for kind in rated.kinds]
        try:
            yield brown_forsythe(*(sample for sample in samples if sample.size))
        except Undefined:
            continue
