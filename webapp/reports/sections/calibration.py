"""Whether those who say that they understand do: ratings and confidence against drives and predictions."""

from collections.abc import Sequence

from webapp.analysis.binary_outcomes import BinaryFit, fit_binary
from webapp.analysis.calibration import Discrimination, discrimination, within_and_between
from webapp.analysis.censoring import Undefined
from webapp.analysis.correlation import repeated_measures
from webapp.analysis.shares import mean_of_several
from webapp.reports.blocks import Assumption, Block, Column, Section, Statement, Table
from webapp.reports.formatting import counted, number
from webapp.reports.kind_outcomes import (
    INTERVAL,
    SHARE_COLUMNS,
    enough_people,
    logistic_assumptions,
    share_cells,
    stream,
)
from webapp.reports.sections.felt_and_measured import Judged, by_rating, calibration_figure, judged_of
from webapp.reports.study_data import StudyData


def section(data: StudyData) -> Section:
    """Return the section."""
    judged = list(judged_of(data))
    title = "Calibration: felt against measured understanding"
    if not judged:
        reason = (
            "there are no ratings of understanding with a drive or a prediction in the same trial, and no confidence"
        )
        return Section("calibration", title, (Statement("Calibration", reason),))
    models = {each.name: _model(each) for each in judged}
    blocks = [_introduction(judged), _table(judged), calibration_figure(judged), *_gaps(judged)]
    blocks += [*_discriminations(judged), *_correlations(judged), *_model_blocks(models)]
    assumptions = _assumptions(judged)
    for name, model in models.items():
        assumptions += logistic_assumptions(f"Mixed logistic model of {name}", model)
    return Section("calibration", title, tuple(blocks), tuple(assumptions))


def _introduction(judged: Sequence[Judged]) -> str:
    items = sorted({each.item for each in judged} - {"confidence"})
    told = (
        f"What people feel is their rating of {' or '.join(items)}" if items else "What people feel is their confidence"
    )
    return (
        f"{told}; what they can do is whether the drive of the same trial reached the goal and whether predictions "
        "are the agent's action. If feeling follows knowing, the share that is right rises with the rating. Where it "
        "does not, an explanation gives an illusion of understanding. A rating is no probability: if the ends of the "
        "scale are taken for 0 and 1, felt minus measured says where people feel more than they can do, and compares "
        "kinds."
    )


def _table(judged: Sequence[Judged]) -> Table:
    columns = (
        Column("rating", "Rating", "count"),
        Column("item", "Felt"),
        Column("measure", "Measured by"),
        Column("experiment", "Experiment"),
        Column("num", "Right", "count"),
        Column("total", "Of", "count"),
        *SHARE_COLUMNS,
    )
    rows = tuple(
        (int(rating), each.item, each.measure, each.outcomes.experiment, *share_cells(share))
        for each in judged
        for rating, share in by_rating(each)
    )
    return Table("calibration", "Share that is right, by rating", columns, rows, "Intervals at 95 %.")


def _gaps(judged: Sequence[Judged]) -> list[Block]:
    columns = (
        Column("kind", "Kind"),
        Column("item", "Felt"),
        Column("measure", "Measured by"),
        Column("experiment", "Experiment"),
        Column("total", "Outcomes", "count"),
        Column("felt", "Felt", "percent", 0),
        Column("measured", "Measured", "percent", 0),
        Column("gap", "Felt \N{MINUS SIGN} measured", "number"),
        *INTERVAL,
    )
    rows = []
    for each in judged:
        felt = (each.frame["rating"] - 1) / (each.points - 1)
        gaps = felt - each.frame["right"].astype(float)
        for kind in each.outcomes.kinds:
            of_kind = each.frame["kind"] == kind
            mean = mean_of_several(each.frame.loc[of_kind, "participant"].tolist(), gaps[of_kind])
            shares = (float(felt[of_kind].mean()), float(each.frame.loc[of_kind, "right"].mean()))
            told = (kind, each.item, each.measure, each.outcomes.experiment, mean.total)
            rows.append((*told, *shares, mean.value, *(mean.interval or (None, None))))
    note = (
        "Felt: the mean of (rating \N{MINUS SIGN} 1) / (points \N{MINUS SIGN} 1). Above 0: people feel more than "
        "they can do, an illusion of understanding; of confidence, overconfidence. Intervals robust within persons."
    )
    return [Table("calibration_gaps", "Felt minus measured understanding, by kind", columns, tuple(rows), note)]


def _discriminations(judged: Sequence[Judged]) -> list[Block]:
    columns = (
        Column("item", "Felt"),
        Column("measure", "Measured by"),
        Column("experiment", "Experiment"),
        Column("right", "Right", "count"),
        Column("wrong", "Wrong", "count"),
        *_with_interval("area", "Area under the curve"),
        *_with_interval("gamma", "Gamma"),
    )
    rows: list[tuple[str | int | float | None, ...]] = []
    statements: list[Block] = []
    for each in judged:
        frame, rng = each.frame, stream(f"calibration/{each.name}")
        try:
            found = discrimination(frame["participant"].tolist(), frame["rating"], frame["right"], rng)
        except Undefined as undefined:
            statements.append(Statement(f"The discrimination of {each.name}", str(undefined)))
            continue
        rows.append((each.item, each.measure, each.outcomes.experiment, *_discrimination_cells(found)))
    note = (
        "Area: the chance that of a right and a wrong outcome the right one was rated higher, ties half; .5 is none. "
        "Gamma: Goodman and Kruskal's. Over all outcomes; bootstrap intervals over people."
    )
    title = "How far ratings tell right from wrong"
    table: list[Block] = [Table("calibration_discrimination", title, columns, tuple(rows), note)] if rows else []
    return [*table, *statements]


def _discrimination_cells(found: Discrimination) -> tuple[int | float | None, ...]:
    area, gamma = found.area_interval or (None, None), found.gamma_interval or (None, None)
    return (found.num_right, found.num_wrong, found.area, *area, found.gamma, *gamma)


def _with_interval(name: str, heading: str) -> tuple[Column, ...]:
    return (
        Column(name, heading, "number"),
        Column(f"{name}_low", "95 % low", "number"),
        Column(f"{name}_high", "high", "number"),
    )


def _correlations(judged: Sequence[Judged]) -> list[Block]:
    columns = (
        Column("item", "Felt"),
        Column("measure", "Measured by"),
        Column("experiment", "Experiment"),
        Column("trials", "Trials", "count"),
        Column("people", "People", "count"),
        *_with_interval("r", "r within persons"),
        Column("df", "df", "count"),
        Column("p", "p", "p"),
    )
    rows = []
    statements: list[Block] = []
    for each in judged:
        trials = each.frame.groupby(["participant", "trial"], as_index=False)[["rating", "right"]].mean()
        try:
            found = repeated_measures(trials["rating"], trials["right"], trials["participant"].tolist())
        except Undefined as undefined:
            statements.append(Statement(f"The correlation within persons of {each.name}", str(undefined)))
            continue
        told = (each.item, each.measure, each.outcomes.experiment, found.num_pairs, found.num_people)
        interval = (found.value.value, found.value.low, found.value.high)
        rows.append((*told, *interval, found.degrees_of_freedom, found.p_value))
    note = "Rating and share that is right per trial, as deviations from the person's mean (Bakdash and Marusich 2017)."
    title = "Correlation of felt and measured understanding within persons"
    table: list[Block] = [Table("calibration_correlations", title, columns, tuple(rows), note)] if rows else []
    return [*table, *statements]


def _model(judged: Judged) -> BinaryFit | str:
    frame = within_and_between(judged.frame, "rating")
    try:
        return fit_binary(frame, factors=("layout", "trial"), numbers=("between", "within"))
    except Undefined as undefined:
        return str(undefined)


def _model_blocks(models: dict[str, BinaryFit | str]) -> list[Block]:
    rows = []
    statements: list[Block] = []
    for name, model in models.items():
        for effect, words in (("between", "between persons"), ("within", "within a person")):
            try:
                if isinstance(model, str):
                    raise Undefined(model)  # noqa: TRY301 - one place says what is missing
                ratio = model.effect(effect)
            except Undefined as undefined:
                statements.append(Statement(f"The odds ratio {words} of {name}", str(undefined)))
                continue
            rows.append((name, words, ratio.value, ratio.low, ratio.high, ratio.t, ratio.df, ratio.p_value))
    columns = (
        Column("compared", "Compared"),
        Column("part", "Part"),
        Column("ratio", "Odds ratio per point", "number"),
        *INTERVAL,
        Column("t", "t", "number"),
        Column("df", "df", "count"),
        Column("p", "p", "p"),
    )
    note = (
        "Mixed logistic model of being right on the person's mean rating and the deviation from it, with layout and "
        "position. Between: those who rate higher on the whole are right more often. Within: people are right more "
        "often where they rate higher. Not adjusted for the number of tests."
    )
    title = "Odds of being right, per point of the rating"
    table: list[Block] = [Table("calibration_odds", title, columns, tuple(rows), note)] if rows else []
    return [*table, *statements]


def _assumptions(judged: Sequence[Judged]) -> list[Assumption]:
    fewest = min(each.frame["participant"].nunique() for each in judged)
    return [
        Assumption(
            "Felt minus measured",
            "The lowest rating means 0 and the highest 1, with equal steps between.",
            "The labels of ratings are no probabilities, so only differences between kinds can be read.",
            "not checkable",
        ),
        *enough_people(
            "Felt minus measured and shares by rating",
            [int(people) for each in judged for by in ("kind", "rating") for people in _people_by(each, by)],
        ),
        Assumption(
            "Area under the curve and gamma",
            "There are enough people for the percentile bootstrap.",
            f"At least {counted(fewest, 'person', 'people')}; below 20 such intervals are too narrow.",
            "holds" if fewest >= 20 else "doubtful",  # noqa: PLR2004 - as the sentence says
        ),
        Assumption(
            "Correlation within persons",
            "All people share one slope.",
            f"With {number(_per_person(judged), digits=1)} trials per person at most, slopes cannot be told apart.",
            "not checkable",
        ),
    ]


def _people_by(judged: Judged, column: str) -> list[int]:
    return [int(people) for people in judged.frame.groupby(column)["participant"].nunique()]


def _per_person(judged: Sequence[Judged]) -> float:
    return max(float(each.frame.groupby("participant")["trial"].nunique().mean()) for each in judged)
