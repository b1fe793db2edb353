"""Which kinds are rated alike but for the margin: "as good as the full sequence"."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from webapp.analysis.censoring import Undefined
from webapp.analysis.equivalence_paired import Tost, conclusion, level_with_skewness, paired_tost
from webapp.analysis.paired import ENOUGH_FOR_T, FEWEST_FOR_SHAPE, Pairs, known_skewness, pairs
from webapp.explainer.pictures.figure_style import BLUE, GREEN, GREY, INK, VERMILION
from webapp.reports.blocks import Assumption, Block, Column, Figure, Section, Statement, Table, Verdict
from webapp.reports.formatting import counted, number
from webapp.reports.kind_outcomes import holm_over
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Contrast

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_MOST_OFF = 0.01
"""How far skewness may shift the level of a one-sided test."""
_COLOURS = {"equivalent": GREEN, "equivalent though different": GREEN, "different": VERMILION, "undecided": BLUE}


@dataclass(frozen=True, slots=True)
class _Judged:
    """An equivalence test with what follows from it, adjusted for the family."""

    contrast: Contrast
    item: str
    sides: Pairs
    test: Tost
    p_equivalence: float
    p_difference: float
    p_as_good: float
    verdict: str
    is_as_good: bool

    @property
    def num_left_out(self) -> int:
        """People who rated one of the two kinds alone."""
        return self.sides.first_only.size + self.sides.second_only.size

    @property
    def skew(self) -> float | None:
        """Of the differences, None where there are too few."""
        return known_skewness(self.sides.differences)


def section(data: StudyData) -> Section:
    """Return the section."""
    planned = [(contrast, item) for contrast in data.plan.equivalences for item in data.plan.items_of(contrast)]
    title = "Equivalence: as good as the other"
    if not planned:
        kinds = "no pair of kinds is declared for it, and the study has none of which the paper claims it"
        return Section("equivalence", title, (Statement("Equivalence", kinds),))
    if data.ratings.empty:
        return Section("equivalence", title, (Statement("Equivalence", "there are 0 ratings"),))
    sides = [_sides(data, contrast, item) for contrast, item in planned]
    tests = [_test(data, contrast, pair) for (contrast, _), pair in zip(planned, sides, strict=True)]
    judged = _judged(data, planned, sides, tests)
    blocks: list[Block] = [_introduction(data, len(planned)) + _left_out(judged)]
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
        f"{counted(num_planned, 'test')} of each of the three questions, at {number(data.plan.alpha)}. Whether the two "
        "differ is secondary here, asked in a family of its own by another test: what decides whether kinds differ are "
        "the planned comparisons."
    )


def _left_out(judged: Sequence[_Judged]) -> str:
    most = max(judged, key=lambda each: each.num_left_out, default=None)
    if most is None or not most.num_left_out:
        return ""
    of = counted(most.test.num_people + most.num_left_out, "person", "people")
    return (
        f" Whoever rated one kind of a pair alone is left out: of {most.contrast} on {most.item} up to "
        f"{most.num_left_out} of {of} who rated either, so that it speaks of the {most.test.num_people} who rated both."
    )


def _sides(data: StudyData, contrast: Contrast, item: str) -> Pairs:
    rows = data.ratings
    chosen = rows[(rows["experiment"] == contrast.experiment) & (rows["item"] == item)]
    return pairs(chosen, contrast.first, contrast.second)


def _test(data: StudyData, contrast: Contrast, sides: Pairs) -> Tost | str:
    try:
        return paired_tost(sides.differences, data.plan.margin, data.plan.alpha)
    except Undefined as undefined:
        alone = f"{sides.first_only.size} rated {contrast.first} alone and {sides.second_only.size} {contrast.second}"
        return f"{undefined} ({sides.first.size} rated both, {alone})"


def _judged(
    data: StudyData,
    planned: Sequence[tuple[Contrast, str]],
    sides: Sequence[Pairs],
    tests: Sequence[Tost | str],
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
            *(contrast, item, pair, test, same, other, good),
            verdict=conclusion(same, other, data.plan.alpha),
            is_as_good=good < data.plan.alpha,
        )
        for (contrast, item), pair, test, (same, other, good) in zip(planned, sides, known, adjusted, strict=True)
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
        Column("people", "Rated both", "count"),
        Column("left_out", "One alone", "count"),
        Column("mean", "Mean", "number"),
        Column("low", "Low", "number"),
        Column("high", "High", "number"),
        Column("p_equivalence_holm", "p equivalent", "p"),
        Column("p_difference_holm", "p different (secondary)", "p"),
        Column("p_as_good_holm", "p as good", "p"),
        Column("conclusion", "Conclusion"),
        Column("is_as_good", "As good"),
    )
    rows = tuple(
        (
            *(str(each.contrast), each.contrast.experiment, each.item),
            *(each.test.num_people, each.num_left_out, each.test.mean, each.test.low, each.test.high),
            *(each.p_equivalence, each.p_difference, each.p_as_good, each.verdict, each.is_as_good),
        )
        for each in judged
    )
    note = (
        "Low and high: the interval at 1 \N{MINUS SIGN} 2 alpha, 90 % at .05, not adjusted. Conclusions follow from "
        "the p-values, which are Holm's. Different: secondary, see the planned comparisons. One alone: people left out "
        "since they rated one of the two kinds."
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
        Column("skewness", "Skewness", "number"),
    )
    rows = tuple(
        (
            *(str(each.contrast), each.contrast.experiment, each.item),
            *(each.test.standard_error, each.test.t_lower, each.test.p_lower, each.test.t_upper, each.test.p_upper),
            *(each.test.p_difference, each.test.num_people - 1, each.skew),
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
    check, verdict = _normality(judged, data.plan.alpha)
    whose = "The study file declares it." if data.plan.is_margin_declared else "It is ours; no study file declares it."
    return (
        Assumption(
            "Equivalence (TOST)",
            f"The mean difference is normal, which from {ENOUGH_FOR_T} people on it nearly is unless differences are "
            "skewed.",
            check,
            verdict,
        ),
        Assumption(
            "Equivalence (TOST)",
            f"A difference below {number(data.plan.margin)} points does not matter, and points are equally far apart.",
            whose,
            "not checkable",
        ),
        Assumption(
            "Equivalence (TOST)",
            "Those who rated both kinds answer as the others would.",
            f"At most {counted(max(each.num_left_out for each in judged), 'person', 'people')} per test rated one kind "
            "alone; which kinds somebody saw was drawn.",
            "by design",
        ),
        Assumption(
            "Equivalence (TOST)", "People do not influence each other.", "One difference per person.", "by design"
        ),
    )


def _normality(judged: Sequence[_Judged], alpha: float) -> tuple[str, Verdict]:
    fewest = counted(min(each.test.num_people for each in judged), "person", "people")
    known = [
        (level_with_skewness(each.skew, each.test.num_people, alpha), each.skew, each)
        for each in judged
        if each.skew is not None
    ]
    if not known:
        return f"At least {fewest} per test; skewness of fewer than {FEWEST_FOR_SHAPE} says nothing.", "not checkable"
    level, skew, worst = max(known, key=lambda each: each[0])
    check = (
        f"At least {fewest} per test. The skewness shifts the level of the one-sided tests from "
        f"{number(alpha, digits=3)} to {number(level, digits=3)} at most (Hall 1992), with {number(skew)} in "
        f"{worst.contrast} on {worst.item}; {number(alpha + _MOST_OFF, digits=3)} is near enough."
    )
    is_sound = len(known) == len(judged) and all(
        size <= alpha + _MOST_OFF and each.test.num_people >= ENOUGH_FOR_T for size, _, each in known
    )
    return check, "holds" if is_sound else "doubtful"
