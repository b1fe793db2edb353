"""The planned comparisons once more without the ordinal model: rank tests and t tests on differences within persons."""

from collections.abc import Sequence
from dataclasses import dataclass

from webapp.analysis.censoring import Undefined
from webapp.analysis.paired import (
    ENOUGH_FOR_T,
    FEWEST_FOR_SHAPE,
    MOST_EXACT,
    PairedT,
    Pairs,
    SignedRank,
    is_normal_enough,
    known_skewness,
    paired_t,
    pairs,
    signed_rank,
    skewness_error,
)
from webapp.analysis.rank_intervals import rank_biserial_interval, rank_sum_interval
from webapp.analysis.unpaired_ranks import RankSum, rank_sum
from webapp.reports.blocks import Assumption, Block, Column, Section, Statement, Table, Verdict
from webapp.reports.formatting import counted
from webapp.reports.kind_outcomes import holm_over
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Contrast

_TITLE = "Robustness: tests without a model"


@dataclass(frozen=True, slots=True)
class _Ranked:
    """A rank test with the interval of its effect or why there is none, and the skewness, None where it is unknown."""

    contrast: Contrast
    item: str
    sides: Pairs
    test: SignedRank | RankSum
    interval: tuple[float, float] | str
    skew: float | None


@dataclass(frozen=True, slots=True)
class _Missing:
    """A test that could not be made."""

    contrast: Contrast
    item: str
    reason: str


def section(data: StudyData) -> Section:
    """Return the section."""
    if data.ratings.empty:
        return Section("robustness", _TITLE, (Statement("The rank tests", "there are 0 ratings"),))
    planned = [(contrast, item) for contrast in data.plan.contrasts for item in data.plan.items_of(contrast)]
    sides = [_sides(data, contrast, item) for contrast, item in planned]
    ranked = [_ranked(*each, pair) for each, pair in zip(planned, sides, strict=True)]
    tested = [_t(pair) for pair in sides]
    made = [each for each in ranked if isinstance(each, _Ranked)]
    blocks = [_introduction(len(planned), made), *_rank_blocks(ranked), *_t_blocks(planned, tested)]
    assumptions = [*_rank_assumptions(made), *_t_assumptions(made, tested)]
    return Section("robustness", _TITLE, tuple(blocks), tuple(assumptions))


def _introduction(num_planned: int, ranked: Sequence[_Ranked]) -> str:
    unpaired = sum(isinstance(each.test, RankSum) for each in ranked)
    averaged = max((each.sides.num_averaged for each in ranked), default=0)
    told = (
        "Each planned comparison on each item, by differences within persons: Wilcoxon's signed-rank test with Pratt's "
        "treatment of zeros, which counts every choice of signs up to "
        f"{MOST_EXACT} people and takes the normal limit, corrected for ties, beyond. The effect is the matched-pairs "
        "rank-biserial correlation, from \N{MINUS SIGN}1 to 1, with an interval on Fisher's z by the jackknife over "
        "people and Student's t; where all differences lie on one side there is none. Holm's correction is over "
        f"{counted(num_planned, 'planned test')}."
    )
    alone = sum(
        isinstance(each.test, SignedRank) and each.sides.first_only.size + each.sides.second_only.size > 0
        for each in ranked
    )
    if alone:
        told += f" In {counted(alone, 'test')} whoever rated one kind alone is left out."
    if averaged:
        told += f" Up to {counted(averaged, 'person', 'people')} rated a kind more than once and count with the mean."
    if unpaired:
        told += (
            f" For {counted(unpaired, 'test')} fewer than half of those who rated either kind rated both; there the "
            "Mann-Whitney test compares those who rated one alone, whoever rated both is left out, and no t test is "
            "made."
        )
    return told


def _sides(data: StudyData, contrast: Contrast, item: str) -> Pairs:
    rows = data.ratings
    chosen = rows[(rows["experiment"] == contrast.experiment) & (rows["item"] == item)]
    return pairs(chosen, contrast.first, contrast.second)


def _ranked(contrast: Contrast, item: str, sides: Pairs) -> _Ranked | _Missing:
    counts = (sides.first.size + sides.first_only.size, sides.first.size + sides.second_only.size)
    if 0 in counts:
        kind = contrast.first if counts[0] == 0 else contrast.second
        return _Missing(contrast, item, f"nobody rated the kind {kind} on {item}")
    try:
        if sides.is_within:
            test: SignedRank | RankSum = signed_rank(sides.differences)
        else:
            test = rank_sum(sides.first_only, sides.second_only)
    except Undefined as undefined:
        return _Missing(contrast, item, _with_counts(sides, str(undefined)))
    skew = known_skewness(sides.differences) if sides.is_within else None
    return _Ranked(contrast, item, sides, test, _interval(sides), skew)


def _interval(sides: Pairs) -> tuple[float, float] | str:
    try:
        if sides.is_within:
            return rank_biserial_interval(sides.differences)
        return rank_sum_interval(sides.first_only, sides.second_only)
    except Undefined as undefined:
        return str(undefined)


def _with_counts(sides: Pairs, reason: str) -> str:
    told = (
        f"{sides.first.size} rated both, {sides.first_only.size} the first alone, {sides.second_only.size} the second"
    )
    return f"{reason} ({told})"


def _t(sides: Pairs) -> PairedT | str:
    if not sides.is_within:
        return ""  # The introduction says so, and the rank test says it if nobody rated a kind.
    try:
        return paired_t(sides.first, sides.second)
    except Undefined as undefined:
        return _with_counts(sides, str(undefined))


def _rank_blocks(ranked: Sequence[_Ranked | _Missing]) -> list[Block]:
    adjusted = holm_over([each.test.p_value if isinstance(each, _Ranked) else None for each in ranked])
    rows = tuple(_rank_row(each, p) for each, p in zip(ranked, adjusted, strict=True) if isinstance(each, _Ranked))
    columns = (
        Column("contrast", "First \N{MINUS SIGN} second"),
        Column("experiment", "Experiment"),
        Column("item", "Item"),
        Column("test", "Test"),
        Column("people", "People", "count"),
        Column("zeros", "Zeros", "count"),
        Column("statistic", "W+ or U", "number", 1),
        Column("z", "z", "number"),
        Column("p", "p", "p"),
        Column("p_holm", "p (Holm)", "p"),
        Column("rank_biserial", "r", "number"),
        Column("low", "95 % low", "number"),
        Column("high", "high", "number"),
        Column("skewness", "Skewness", "number"),
    )
    title = "Rank tests of the planned comparisons"
    note = (
        "W+: the sum of the ranks of positive differences. U: pairs in which the first is higher, ties half. "
        "r: rank-biserial correlation. Skewness: of the differences."
    )
    blocks: list[Block] = [Table("robustness", title, columns, rows, note)] if rows else []
    blocks += [_statement("rank test", each) for each in ranked if isinstance(each, _Missing)]
    blocks += [
        _statement("interval of r", _Missing(each.contrast, each.item, each.interval))
        for each in ranked
        if isinstance(each, _Ranked) and isinstance(each.interval, str)
    ]
    return blocks


def _statement(test: str, missing: _Missing) -> Statement:
    place = f"{missing.contrast} on {missing.item} in experiment {missing.contrast.experiment}"
    return Statement(f"The {test} of {place}", missing.reason)


def _rank_row(ranked: _Ranked, p_holm: float | None) -> tuple[str | int | float | None, ...]:
    test = ranked.test
    told: tuple[str | int | float | None, ...]
    if isinstance(test, SignedRank):
        told = (f"signed rank, {test.method}", test.num_people, test.num_zeros, test.plus, test.z)
    else:
        told = (f"rank sum, {test.method}", test.num_first + test.num_second, None, test.u, None)
    name = (str(ranked.contrast), ranked.contrast.experiment, ranked.item)
    interval = (None, None) if isinstance(ranked.interval, str) else ranked.interval
    return (*name, *told, test.p_value, p_holm, test.rank_biserial, *interval, ranked.skew)


def _t_blocks(planned: Sequence[tuple[Contrast, str]], tested: Sequence[PairedT | str]) -> list[Block]:
    adjusted = holm_over([each.p_value if isinstance(each, PairedT) else None for each in tested])
    rows = tuple(
        (str(contrast), contrast.experiment, item, *_t_cells(each, p_holm))
        for (contrast, item), each, p_holm in zip(planned, tested, adjusted, strict=True)
        if isinstance(each, PairedT)
    )
    columns = (
        Column("contrast", "First \N{MINUS SIGN} second"),
        Column("experiment", "Experiment"),
        Column("item", "Item"),
        Column("people", "People", "count"),
        Column("mean", "Mean", "number"),
        Column("low", "95 % low", "number"),
        Column("high", "high", "number"),
        Column("t", "t", "number"),
        Column("p", "p", "p"),
        Column("p_holm", "p (Holm)", "p"),
        *(
            Column(name, heading, "number")
            for name, heading in (("d_z", "d_z"), ("d_z_low", "low"), ("d_z_high", "high"))
        ),
        *(
            Column(name, heading, "number")
            for name, heading in (("d_av", "d_av"), ("d_av_low", "low"), ("d_av_high", "high"))
        ),
    )
    note = (
        "Differences in rating points. d_z: mean over standard deviation of the differences, interval by inverting the "
        "noncentral t. d_av: mean over the root of the mean of both variances, interval of Bonett 2008 (Psychological "
        "Methods 13, 99). Ratings are taken for numbers here."
    )
    blocks: list[Block] = [Table("robustness_t", "Paired t tests beside them", columns, rows, note)] if rows else []
    blocks += [
        _statement("paired t test", _Missing(contrast, item, each))
        for (contrast, item), each in zip(planned, tested, strict=True)
        if isinstance(each, str) and each
    ]
    return blocks


def _t_cells(test: PairedT, p_holm: float | None) -> tuple[float | int | None, ...]:
    d_av = test.d_av or (None, None, None)
    return (test.num_people, test.mean, test.low, test.high, test.t, test.p_value, p_holm, *test.d_z, *d_av)


def _rank_assumptions(ranked: Sequence[_Ranked]) -> list[Assumption]:
    found = []
    if any(isinstance(each.test, SignedRank) for each in ranked):
        check, verdict = _symmetry([each for each in ranked if isinstance(each.test, SignedRank)])
        found.append(
            Assumption(
                "Wilcoxon signed rank", "Without an effect, differences lie symmetrically about 0.", check, verdict
            )
        )
        found.append(_independence("Wilcoxon signed rank"))
    unpaired = [each for each in ranked if isinstance(each.test, RankSum)]
    if unpaired:
        left_out = max(each.sides.first.size for each in unpaired)
        found.append(
            Assumption(
                "Mann-Whitney",
                "The two groups are different people, and without an effect their ratings are distributed alike.",
                f"Whoever rated both is left out, up to {counted(left_out, 'person', 'people')}; kinds were drawn.",
                "by design",
            )
        )
    return found


def _symmetry(ranked: Sequence[_Ranked]) -> tuple[str, Verdict]:
    known = [(abs(each.skew) / skewness_error(each.sides.first.size), each) for each in ranked if each.skew is not None]
    if not known:
        return f"No test has {FEWEST_FOR_SHAPE} differences or more that vary.", "not checkable"
    far = [each for size, each in known if size > 1.96]  # noqa: PLR2004 - the 97.5 % quantile
    size, worst = max(known, key=lambda each: each[0])
    check = (
        f"Skewness is more than 1.96 standard errors from 0 in {len(far)} of {len(known)} tests; the farthest is "
        f"{worst.skew:.2f}, {size:.1f} standard errors ({worst.contrast} on {worst.item}).".replace(
            "-", "\N{MINUS SIGN}"
        )
    )
    return check, "holds" if not far else "doubtful"


def _t_assumptions(ranked: Sequence[_Ranked], tested: Sequence[PairedT | str]) -> list[Assumption]:
    sizes = [each.num_people for each in tested if isinstance(each, PairedT)]
    if not sizes:
        return []
    paired = [each for each in ranked if isinstance(each.test, SignedRank)]
    check, _ = _symmetry(paired)
    known = [(each.skew, each.sides.first.size) for each in paired if each.skew is not None]
    far = sum(not is_normal_enough(skew, size) for skew, size in known)
    normal = Assumption(
        "Paired t",
        f"The mean difference is normal, which from {ENOUGH_FOR_T} people on it nearly is unless they are skewed.",
        f"At least {counted(min(sizes), 'person', 'people')} per test. {check} In {far} of {len(known)} there are "
        f"fewer than {ENOUGH_FOR_T} people or than 25 times the squared skewness (Cochran 1977).",
        "not checkable" if not known else "doubtful" if far else "holds",
    )
    return [normal, _independence("Paired t")]


def _independence(test: str) -> Assumption:
    return Assumption(
        test, "People do not influence each other.", "One difference per person; each takes part alone.", "by design"
    )
