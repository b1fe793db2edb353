"""Which kinds are rated alike but for the margin: "as good as the full sequence"."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from webapp.analysis.censoring import Undefined
from webapp.analysis.equivalence_paired import Tost, conclusion, paired_tost
from webapp.analysis.paired import pairs
from webapp.explainer.pictures.figure_style import BLUE, GREEN, GREY, INK, VERMILION
from webapp.reports.blocks import Assumption, Block, Column, Figure, Section, Statement, Table
from webapp.reports.formatting import counted, number
from webapp.reports.kind_outcomes import holm_over
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Contrast

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_ENOUGH = 30
_COLOURS = {"equivalent": GREEN, "equivalent though different": GREEN, "different": VERMILION, "undecided": BLUE}


@dataclass(frozen=True, slots=True)
class _Judged:
    """An equivalence test with what follows from it, adjusted for the family."""

    contrast: Contrast
    item: str
    test: Tost
    p_equivalence: float
    p_difference: float
    p_as_good: float
    verdict: str
    is_as_good: bool


def section(data: StudyData) -> Section:
    """Return the section."""
    planned = [(contrast, item) for contrast in data.plan.equivalences for item in data.plan.items_of(contrast)]
    title = "Equivalence: as good as the other"
    if not planned:
        kinds = "no pair of kinds is declared for it, and the study has none of which the paper claims it"
        return Section("equivalence", title, (Statement("Equivalence", kinds),))
    if data.ratings.empty:
        return Section("equivalence", title, (Statement("Equivalence", "there are 0 ratings"),))
    tests = [_test(data, contrast, item) for contrast, item in planned]
    judged = _judged(data, planned, tests)
    blocks: list[Block] = [_introduction(data, len(planned))]
    if judged:
        blocks += [_table(judged), _figure(data, judged), _statistics(judged)]
    blocks += [
        Statement(f"Equivalence of {contrast} on {item} in experiment {contrast.experiment}", test)
        for (contrast, item), test in zip(planned, tests, strict=True)
        if isinstance(test, str)
    ]
    return Section("equivalence", title, tuple(blocks), _assumptions(data, judged))


def _introduction(data: StudyData, num_planned: int) -> str:
    margin = number(data.plan.margin)
    whose = "as the study file declares" if data.plan.is_margin_declared else "ours, since the study file declares none"
    return (
        "That no difference is found does not show that there is none. Two one-sided t tests on differences within "
        f"persons ask whether the mean difference lies within {margin} rating points of 0 ({whose}). Equivalent: it "
        "does. Different: it is not 0. Both can be true of a small difference, and neither where data are too few: "
        "then it is undecided. \N{LEFT DOUBLE QUOTATION MARK}As good\N{RIGHT DOUBLE QUOTATION MARK} asks for the "
        f"lower side alone: the first is worse by less than {margin}. Holm's correction is over "
        f"{counted(num_planned, 'test')} of each of the three questions, at {number(data.plan.alpha)}."
    )


def _test(data: StudyData, contrast: Contrast, item: str) -> Tost | str:
    rows = data.ratings
    chosen = rows[(rows["experiment"] == contrast.experiment) & (rows["item"] == item)]
    sides = pairs(chosen, contrast.first, contrast.second)
    try:
        return paired_tost(sides.differences, data.plan.margin, data.plan.alpha)
    except Undefined as undefined:
        alone = f"{sides.first_only.size} rated {contrast.first} alone and {sides.second_only.size} {contrast.second}"
        return f"{undefined} ({sides.first.size} rated both, {alone})"


def _judged(
    data: StudyData, planned: Sequence[tuple[Contrast, str]], tests: Sequence[Tost | str]
) -> tuple[_Judged, ...]:
    known = [test if isinstance(test, Tost) else None for test in tests]
    adjusted = zip(
        holm_over([None if test is None else test.p_equivalence for test in known]),
        holm_over([None if test is None else test.p_difference for test in known]),
        holm_over([None if test is None else test.p_lower for test in known]),
        strict=True,
    )
    return tuple(
        _Judged(
            contrast, item, test, same, other, good, conclusion(same, other, data.plan.alpha), good <= data.plan.alpha
        )
        for (contrast, item), test, (same, other, good) in zip(planned, known, adjusted, strict=True)
        if test is not None and same is not None and other is not None and good is not None
    )


def _named() -> tuple[Column, ...]:
    return (
        Column("contrast", "First \N{MINUS SIGN} second"),
        Column("experiment", "Experiment"),
        Column("item", "Item"),
    )


def _table(judged: Sequence[_Judged]) -> Table:
    columns = (
        *_named(),
        Column("people", "People", "count"),
        Column("mean", "Mean", "number"),
        Column("low", "Low", "number"),
        Column("high", "High", "number"),
        Column("p_equivalence_holm", "p equivalent", "p"),
        Column("p_difference_holm", "p different", "p"),
        Column("p_as_good_holm", "p as good", "p"),
        Column("conclusion", "Conclusion"),
        Column("is_as_good", "As good"),
    )
    rows = tuple(
        (
            *(str(each.contrast), each.contrast.experiment, each.item),
            *(each.test.num_people, each.test.mean, each.test.low, each.test.high),
            *(each.p_equivalence, each.p_difference, each.p_as_good, each.verdict, each.is_as_good),
        )
        for each in judged
    )
    note = (
        "Low and high: the interval at 1 \N{MINUS SIGN} 2 alpha, 90 % at .05, not adjusted. Conclusions follow from "
        "the p-values, which are Holm's."
    )
    return Table("equivalence", "Equivalence tests", columns, rows, note)


def _statistics(judged: Sequence[_Judged]) -> Table:
    columns = (
        *_named(),
        Column("standard_error", "Standard error", "number", 3),
        Column("t_lower", "t against \N{MINUS SIGN}margin", "number"),
        Column("p_lower", "p", "p"),
        Column("t_upper", "t against +margin", "number"),
        Column("p_upper", "p", "p"),
        Column("p_difference", "p of 0", "p"),
        Column("df", "df", "count"),
    )
    rows = tuple(
        (
            *(str(each.contrast), each.contrast.experiment, each.item),
            *(each.test.standard_error, each.test.t_lower, each.test.p_lower, each.test.t_upper, each.test.p_upper),
            *(each.test.p_difference, each.test.num_people - 1),
        )
        for each in judged
    )
    return Table("equivalence_statistics", "Statistics of the equivalence tests, not adjusted", columns, rows)


def _figure(data: StudyData, judged: Sequence[_Judged]) -> Figure:
    margin = data.plan.margin
    counts = {verdict: sum(each.verdict == verdict for each in judged) for verdict in _COLOURS}
    told = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    band = f"a band from \N{MINUS SIGN}{margin:g} to {margin:g} rating points"
    height = 0.9 + 0.27 * len(judged)
    return Figure(
        "equivalence_intervals",
        "Mean differences with their intervals against the margin",
        f"Intervals of {counted(len(judged), 'mean difference')} against {band}: {told}.",
        (7.2, height),
        lambda canvas: _fill(canvas, judged, margin),
    )


def _fill(canvas: "Canvas", judged: Sequence[_Judged], margin: float) -> None:
    axes = canvas.subplots()
    axes.axvspan(-margin, margin, color=GREY, alpha=0.22, linewidth=0)
    axes.axvline(0, color=INK, linewidth=0.6)
    for place, each in enumerate(reversed(judged)):
        colour = _COLOURS[each.verdict]
        axes.plot([each.test.low, each.test.high], [place, place], color=colour, linewidth=1.6, solid_capstyle="butt")
        axes.plot(each.test.mean, place, "o", color=colour, markersize=4)
        axes.annotate(
            each.verdict,
            (1.01, place),
            xycoords=("axes fraction", "data"),
            verticalalignment="center",
            color=colour,
            fontsize=7,
        )
    names = [f"{each.contrast}, {each.item} ({each.contrast.experiment})" for each in reversed(judged)]
    axes.set_yticks(range(len(judged)), names)
    axes.set_ylim(-0.6, len(judged) - 0.4)
    ends = [abs(end) for each in judged for end in (each.test.low, each.test.high)]
    reach = 1.08 * max(*ends, margin)
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("Mean difference in rating points; the band is the margin")


def _assumptions(data: StudyData, judged: Sequence[_Judged]) -> tuple[Assumption, ...]:
    if not judged:
        return ()
    fewest = min(each.test.num_people for each in judged)
    whose = "The study file declares it." if data.plan.is_margin_declared else "It is ours; no study file declares it."
    return (
        Assumption(
            "Equivalence (TOST)",
            "The mean difference is normal, which from some thirty people on it nearly is.",
            f"At least {counted(fewest, 'person', 'people')} per test; the section on robustness has the skewness.",
            "holds" if fewest >= _ENOUGH else "doubtful",
        ),
        Assumption(
            "Equivalence (TOST)",
            f"A difference below {number(data.plan.margin)} points does not matter, and points are equally far apart.",
            whose,
            "not checkable",
        ),
        Assumption(
            "Equivalence (TOST)", "People do not influence each other.", "One difference per person.", "by design"
        ),
    )
