"""How likeliness and loveliness go with the general rating: correlations, the two-factor analysis, simple effects."""

from collections.abc import Iterator

import numpy as np

from webapp.analysis.censoring import Undefined
from webapp.analysis.correlation import Correlation, pearson, repeated_measures
from webapp.analysis.factorial_anova import Anova
from webapp.analysis.means import Described, describe, shapiro_wilk
from webapp.analysis.variances import brown_forsythe
from webapp.reports.blocks import Assumption, Block, Cell, Column, Section, Statement, Table
from webapp.reports.formatting import counted
from webapp.reports.sections.paper_anova import TYPES, analysed, anova_blocks, simple_effect_blocks
from webapp.reports.sections.paper_cut import CLASS_NAMES, Cut, classes_of, cut
from webapp.reports.sections.paper_figures import interaction_figure
from webapp.reports.sections.paper_numbers import (
    CELLS,
    CORRELATIONS,
    GENERAL,
    ITEMS,
    LIKELINESS,
    LOVELINESS,
)
from webapp.reports.sections.rated import (
    Undecided,
    independence,
    interval_scale,
    rated_experiments,
    rejections,
    titled,
)
from webapp.reports.study_data import StudyData

_TITLE = "what the general rating goes with"
_CAVEATS = (
    "As in the paper, all kinds of explanation are pooled, and both factors are ratings themselves, cut above the "
    "middle of their scale (1 to 3 against 4 and 5 where there are five points). They are therefore measured, not "
    "assigned: that one goes with the general rating does not say that it causes it. Cutting discards what lies within "
    "a class and can make an interaction out of a curve. Several ratings of one person enter as if they were of "
    "several, the t tests are unpaired, and nothing is corrected for the number of tests."
)


def section(data: StudyData) -> Section:
    """Relate the general rating to the other two, in each experiment that asks for all three."""
    blocks: list[Block] = []
    assumptions: list[Assumption] = []
    for rated in rated_experiments(data):
        made = cut(rated)
        if isinstance(made, Statement):
            blocks.append(made)
            continue
        cells = _cells(made)
        found, reason = analysed(made)
        blocks += [*_correlations(made), _cells_table(made, cells), interaction_figure(rated, cells, classes_of(rated))]
        blocks += [*anova_blocks(rated, found, reason), *simple_effect_blocks(made)]
        assumptions += _assumptions(made, found)
    if not blocks:
        blocks.append(Statement("correlations with the general rating", "there are 0 experiments"))
    if any(not isinstance(block, Statement) for block in blocks):
        blocks[:0] = [_CAVEATS, TYPES]
    return Section("paper_interaction", titled(data, _TITLE), tuple(blocks), tuple(assumptions))


def _correlations(made: Cut) -> Iterator[Block]:
    rated, undecided, rows = made.rated, Undecided(), []
    has_paper = rated.paper == "1"
    people = list(made.wide["participant"])
    for item in (LIKELINESS, LOVELINESS):
        x, y = made.column(item), made.general
        for over in ("all ratings", "within persons"):
            found: Correlation | None = None
            try:
                found = pearson(x, y) if over == "all ratings" else repeated_measures(x, y, people)
            except Undefined as reason:
                undecided.add(f"{item} with {GENERAL}, {over}", reason)
            printed = CORRELATIONS[item].text if over == "all ratings" else None
            rows.append((f"{item}, {GENERAL}", over, *_correlation_numbers(found), *([printed] if has_paper else [])))
    columns = (
        Column("pair", "Ratings"),
        Column("over", "Over"),
        Column("r", "r", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
        Column("num", "Pairs", "count"),
        Column("df", "df", "count"),
        Column("p", "p, two-sided", "p"),
        *([Column("paper", "Paper: r")] if has_paper else []),
    )
    note = (
        "Over all ratings: Pearson's r with Fisher's interval, as if each rating were of another person. Within "
        "persons: the repeated measures correlation (Bakdash and Marusich 2017), which is free of who rates everything "
        "high."
    )
    title = f"Correlations with the general rating in experiment {rated.id}"
    yield Table(f"general_correlations_{rated.id}", title, columns, tuple(rows), note)
    yield from undecided.statements(f"correlation in experiment {rated.id}")


def _correlation_numbers(found: Correlation | None) -> tuple[Cell, ...]:
    if found is None:
        return (None,) * 6
    value = found.value
    return value.value, value.low, value.high, found.num_pairs, found.degrees_of_freedom, found.p_value


def _cells(made: Cut) -> dict[tuple[bool, bool], Described]:
    """Return what is known of each cell that has ratings."""
    found = {(a, b): made.cell(likely=a, lovely=b) for a in (False, True) for b in (False, True)}
    return {place: describe(values) for place, values in found.items() if values.size}


def _cells_table(made: Cut, cells: dict[tuple[bool, bool], Described]) -> Table:
    rated, classes = made.rated, classes_of(made.rated)
    has_paper = rated.paper == "1"
    columns = (
        Column("likeliness", "Likeliness"),
        Column("loveliness", "Loveliness"),
        Column("num", "Ratings", "count"),
        Column("mean", "Mean", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
        Column("sd", "SD", "number"),
        *([Column("paper", "Paper: mean")] if has_paper else []),
    )
    rows = []
    for likely, lovely in CELLS:
        one = cells.get((likely, lovely))
        numbers: tuple[Cell, ...] = (one.num, one.mean, one.low, one.high, one.sd) if one else (0, *(None,) * 4)
        names = (f"{CLASS_NAMES[likely]} ({classes[likely]})", f"{CLASS_NAMES[lovely]} ({classes[2 + lovely]})")
        rows.append((*names, *numbers, *([CELLS[likely, lovely].text] if has_paper else [])))
    title = f"The general rating by likeliness and loveliness in experiment {rated.id}"
    return Table(f"general_cells_{rated.id}", title, columns, tuple(rows))


def _assumptions(made: Cut, found: tuple[Anova, ...]) -> Iterator[Assumption]:
    rated = made.rated
    if found:
        test = f"analysis of variance and simple effects, experiment {rated.id}"
        yield _normal_residuals(made, test)
        yield _equal_variances(made, test)
        yield independence(test, rated, (GENERAL,))
        yield interval_scale(test, [rated.points_of(GENERAL)])
        yield Assumption(
            test,
            "the factors are assigned and measured without error",
            f"both are ratings of the same {counted(made.general.size, 'trial')}, cut in two",
            "violated",
        )
    test = f"correlations over all ratings, experiment {rated.id}"
    yield independence(test, rated, ITEMS)
    yield interval_scale(test, [rated.points_of(item) for item in ITEMS])


def _normal_residuals(made: Cut, test: str) -> Assumption:
    codes = 2 * made.likely + made.lovely
    means = np.bincount(codes, made.general, 4) / np.maximum(np.bincount(codes, minlength=4), 1)
    assumes = "residuals are normal"
    try:
        return rejections(test, assumes, [shapiro_wilk(made.general - means[codes])], "analyses")
    except Undefined as reason:
        return Assumption(test, assumes, str(reason), "not checkable")


def _equal_variances(made: Cut, test: str) -> Assumption:
    assumes = "the four cells have equal variances"
    try:
        found = brown_forsythe(*(made.cell(likely=a, lovely=b) for a, b in CELLS))
    except Undefined as reason:
        return Assumption(test, assumes, str(reason), "not checkable")
    return rejections(test, assumes, [found], "analyses")
