"""The paper's two-factor analysis of variance of the general rating, and the simple effects that follow it."""

from collections.abc import Iterator

from webapp.analysis.censoring import Undefined
from webapp.analysis.factorial_anova import Anova, SumsOfSquares, simple_effects, two_by_two
from webapp.analysis.means import unpaired_t
from webapp.reports.blocks import Block, Cell, Column, Statement, Table
from webapp.reports.sections.paper_cut import CLASS_NAMES, Cut, classes_of
from webapp.reports.sections.paper_numbers import LIKELINESS, LOVELINESS, PRINTED_F, SIMPLE_EFFECTS
from webapp.reports.sections.paper_printed import printed_anova, printed_direction
from webapp.reports.sections.rated import Rated, Undecided

TYPES = (
    "The paper does not say which sums of squares it used; they differ where cells are of different size. Type III "
    "stands first: it compares the unweighted means of the cells, so that how many ratings fall into a cell, which is "
    "an outcome here, does not weigh in, and it is the default of the statistics programs most used for such analyses. "
    "II and I (likeliness first) stand beside it. Partial eta squared is given with a 90 % interval, which leaves out "
    "0 exactly where p < .05."
)
_TYPE_NAMES: dict[SumsOfSquares, str] = {3: "III", 2: "II", 1: "I"}
_EFFECT_NAMES = {"first": LIKELINESS, "second": LOVELINESS, "interaction": f"{LIKELINESS} × {LOVELINESS}"}  # noqa: RUF001


def analysed(made: Cut) -> tuple[tuple[Anova, ...], str]:
    """Return the analyses of variance, type III first, or why there are none."""
    try:
        return tuple(two_by_two(made.general, made.likely, made.lovely, kind) for kind in _TYPE_NAMES), ""
    except Undefined as reason:
        return (), str(reason)


def anova_blocks(rated: Rated, found: tuple[Anova, ...], reason: str) -> Iterator[Block]:
    """Show the analyses of variance, or say why there are none, and what is wrong with those that the paper prints.

    Args:
        rated: The experiment.
        found: Of `analysed`.
        reason: Likewise.
    """
    if not found:
        yield Statement(f"two-factor analysis of variance, experiment {rated.id}", reason)
    else:
        yield _anova_table(rated, found)
    if rated.paper == "1":
        yield from printed_anova()


def _anova_table(rated: Rated, found: tuple[Anova, ...]) -> Table:
    printed: dict[str, str] = {one.effect: one.text for one in PRINTED_F}
    has_paper = rated.paper == "1"
    columns = (
        Column("effect", "Effect"),
        Column("type", "Type"),
        Column("sum_of_squares", "Sum of squares", "number"),
        Column("f", "F", "number"),
        Column("df", "df"),
        Column("p", "p", "p"),
        Column("partial_eta_squared", "Partial \N{GREEK SMALL LETTER ETA}²", "number", 3),
        Column("low", "90 % from", "number", 3),
        Column("high", "to", "number", 3),
        *([Column("paper", "Paper")] if has_paper else []),
    )
    rows: list[tuple[Cell, ...]] = []
    for one in found:
        for effect in one.effects:
            share = effect.partial_eta_squared
            numbers = (effect.sum_of_squares, effect.statistic, f"1, {one.degrees_of_freedom}", effect.p_value)
            paper = [printed[effect.name]] if has_paper else []
            kind = _TYPE_NAMES[one.sums_of_squares]
            rows.append((_EFFECT_NAMES[effect.name], kind, *numbers, share.value, share.low, share.high, *paper))
    title = f"Two-factor analysis of variance of the general rating in experiment {rated.id}"
    note = f"The residual sum of squares is {found[0].residual:.2f}."
    return Table(f"general_anova_{rated.id}", title, columns, tuple(rows), note)


def simple_effect_blocks(made: Cut) -> Iterator[Block]:
    """Compare the classes of loveliness at each class of likeliness, with the paper's p values."""
    rated, undecided = made.rated, Undecided()
    has_paper = rated.paper == "1"
    columns = (
        Column("likeliness", "Likeliness"),
        Column("difference", "Loveliness high \N{MINUS SIGN} low", "number"),
        Column("low", "95 % from", "number"),
        Column("high", "to", "number"),
        Column("t", "t", "number"),
        Column("df", "df", "count"),
        Column("p_high_larger", "p, one-sided: high > low", "p"),
        Column("p_observed", "p, one-sided: as observed", "p"),
        Column("p_two_sided", "p, two-sided", "p"),
        Column("p_all_cells", "p, two-sided, by the spread of all cells", "p"),
        *([Column("paper", "Paper: one-sided")] if has_paper else []),
    )
    rows = [
        (
            f"{CLASS_NAMES[likely]} ({classes_of(rated)[likely]})",
            *_simple_effect(made, undecided, likely=likely),
            _by_all_cells(made, likely=likely),
            *([SIMPLE_EFFECTS[likely].text] if has_paper else []),
        )
        for likely in (False, True)
    ]
    note = (
        "Unpaired t tests with equal variances, as in the paper. One-sided as observed means in the direction that "
        "the data happen to have: half the two-sided p value, and no valid test of a hypothesis stated before."
    )
    title = f"Simple effects of loveliness on the general rating in experiment {rated.id}"
    yield Table(f"general_simple_effects_{rated.id}", title, columns, tuple(rows), note)
    yield from undecided.statements(f"simple effect of loveliness in experiment {rated.id}")
    if has_paper:
        yield printed_direction()


def _simple_effect(made: Cut, undecided: Undecided, *, likely: bool) -> tuple[Cell, ...]:
    try:
        found = unpaired_t(made.cell(likely=likely, lovely=True), made.cell(likely=likely, lovely=False))
    except Undefined as reason:
        undecided.add(f"{CLASS_NAMES[likely]} likeliness", reason)
        return (None,) * 8
    gap, observed = found.difference, min(found.p_first_larger, found.p_second_larger)
    numbers = (gap.value, gap.low, gap.high, found.statistic, int(found.degrees_of_freedom))
    return *numbers, found.p_first_larger, observed, found.p_two_sided


def _by_all_cells(made: Cut, *, likely: bool) -> float | None:
    try:
        return simple_effects(made.general, made.likely, made.lovely)[likely].p_two_sided
    except Undefined:
        return None
