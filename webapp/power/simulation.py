"""The simulated studies: how often each planned contrast is significant, by effect and number of participants.

A study is simulated once at its largest number of participants; its first N people are the study of N. So the studies
of all N and of all effects share their noise (common random numbers), which makes curves smooth. What is drawn depends
on the seed and the study's number alone: neither on the workers nor on which other effects and numbers are asked for.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from webapp.analysis.censoring import Undefined
from webapp.analysis.planned_model import fit_planned
from webapp.explainer.seeding import stream
from webapp.power.design import Questions, trials_of
from webapp.power.generation import draw_noise, rate, rated_frame
from webapp.power.settings import PowerSettings
from webapp.runs.provenance import maker_of_rows
from webapp.runs.run_folders import Row, RunFolder
from webapp.study.analysis_plan import Contrast

STUDIES_PER_UNIT = 20
"""Few enough that units finish often, and many enough that handing them out costs nothing."""

ReportStudies = Callable[[int, int], None]
"""Takes how many units are done, and how many there are."""


@dataclass(frozen=True, slots=True)
class Levels:
    """Where a p-value counts as significant.

    Attributes:
        first: At the first step of Holm's correction, alpha / m: the worst case for a contrast.
        last: At the last step, alpha: the best.
    """

    first: float
    last: float


@dataclass(frozen=True, slots=True)
class Unit:
    """A piece of work: some studies on some items.

    Attributes:
        questions: What is asked.
        first_study: The number of the first study, from 0.
        num_studies: How many there are.
    """

    questions: Questions
    first_study: int
    num_studies: int


def simulate(
    questions: Sequence[Questions],
    settings: PowerSettings,
    levels: Levels,
    folder: RunFolder,
    workers: int,
    report: ReportStudies,
) -> pd.DataFrame:
    """Run what the folder does not have yet and return the counts over all studies.

    Args:
        questions: What is asked, and which contrasts are planned.
        settings: How much is simulated.
        levels: Of significance.
        folder: Where each finished unit is kept at once.
        workers: How many processes.
        report: Told of every finished unit.

    Returns:
        One row per questions, contrast, effect and number of participants, in this order: `experiment`, `items`,
        `points`, `first`, `second`, `effect`, `participants`, and the counts of `COUNTS`.
    """
    units = dict(enumerate(_units(questions, settings.num_studies)))
    report(len(folder.finished), len(units))
    todo = [(number, unit, settings, levels) for number, unit in units.items() if number not in folder.finished]
    for number, rows in _worked_off(todo, workers):
        folder.keep(number, rows, maker_of_rows())
        report(len(folder.finished), len(units))
    rows = pd.DataFrame([row for number in sorted(folder.finished) for row in folder.finished[number]])
    return rows.groupby(list(_KEYS), sort=False, as_index=False)[list(COUNTS)].sum()


def _units(questions: Sequence[Questions], num_studies: int) -> Iterator[Unit]:
    for each in questions:
        for first in range(0, num_studies, STUDIES_PER_UNIT):
            yield Unit(each, first, min(STUDIES_PER_UNIT, num_studies - first))


def _worked_off(
    todo: Sequence[tuple[int, Unit, PowerSettings, Levels]], workers: int
) -> Iterator[tuple[int, list[Row]]]:
    if workers == 1:
        yield from (_numbered(*each) for each in todo)
        return
    from joblib import Parallel, delayed, parallel_config  # noqa: PLC0415 - one worker needs none of it.

    with parallel_config("loky", n_jobs=workers, inner_max_num_threads=1):
        yield from Parallel(return_as="generator_unordered")(delayed(_numbered)(*each) for each in todo)


def _numbered(number: int, unit: Unit, settings: PowerSettings, levels: Levels) -> tuple[int, list[Row]]:
    return number, run_unit(unit, settings, levels)


def run_unit(unit: Unit, settings: PowerSettings, levels: Levels) -> list[Row]:
    """Simulate the studies of a unit and count."""
    questions = unit.questions
    trials = trials_of(questions.experiment, max(settings.participants))
    num_people, num_trials = trials.kinds.shape
    cells = {(contrast, effect, num): _Count() for contrast, effect, num in _cells(questions, settings)}
    for study in range(unit.first_study, unit.first_study + unit.num_studies):
        rng = stream(settings.seed, "power", questions.name, f"study {study}")
        noise = draw_noise(rng, num_people, num_trials, settings.between_sd)
        for shifted, effect in _planted(questions, settings):
            ratings = rate(questions, trials, noise, {} if shifted is None else {shifted: effect})
            contrasts = [each for each in questions.contrasts if shifted in (None, each.first)]
            for num in settings.participants:
                counts = [cells[contrast, effect, num] for contrast in contrasts]
                frame = rated_frame(questions, trials, ratings, num)
                _count(frame, contrasts, counts, levels)
    return [_row(questions, contrast, effect, num, count) for (contrast, effect, num), count in cells.items()]


@dataclass(slots=True)
class _Count:
    studies: int = 0
    undefined: int = 0
    first: int = 0
    last: int = 0
    estimates: float = 0.0


def _cells(questions: Questions, settings: PowerSettings) -> Iterator[tuple[Contrast, float, int]]:
    for contrast in questions.contrasts:
        for effect in (0.0, *settings.effects):
            for num_people in settings.participants:
                yield contrast, effect, num_people


def _planted(questions: Questions, settings: PowerSettings) -> Iterator[tuple[str | None, float]]:
    """Yield nothing planted once, for all contrasts, then each effect on each first kind."""
    yield None, 0.0
    for kind in questions.first_kinds:
        yield from ((kind, effect) for effect in settings.effects)


def _count(frame: pd.DataFrame, contrasts: Sequence[Contrast], counts: Sequence[_Count], levels: Levels) -> None:
    """Fit the planned model once and count each contrast; what the ratings do not determine is not significant."""
    try:
        fit = fit_planned(frame)
    except Undefined:
        fit = None
    for contrast, count in zip(contrasts, counts, strict=True):
        count.studies += 1
        try:
            found = None if fit is None else fit.contrast(contrast.first, contrast.second)
        except Undefined:
            found = None
        if found is None:
            count.undefined += 1
            continue
        count.first += bool(found.p_value <= levels.first)
        count.last += bool(found.p_value <= levels.last)
        count.estimates += float(found.d)


def _row(questions: Questions, contrast: Contrast, effect: float, num_people: int, count: _Count) -> Row:
    return {
        "experiment": questions.experiment.id,
        "items": " ".join(questions.items),
        "points": questions.points,
        "first": contrast.first,
        "second": contrast.second,
        "effect": effect,
        "participants": num_people,
        "num_studies": count.studies,
        "num_undefined": count.undefined,
        "num_significant_first_step": count.first,
        "num_significant_last_step": count.last,
        "sum_of_estimates": count.estimates,
    }


_KEYS = ("experiment", "items", "points", "first", "second", "effect", "participants")
COUNTS = (
    "num_studies",
    "num_undefined",
    "num_significant_first_step",
    "num_significant_last_step",
    "sum_of_estimates",
)
"""How many studies, in how many the model was undetermined, and where it was not: significant ones, sum of d."""
