"""How long a study takes, before anybody has taken part: from what there is to read, look at, answer and steer.

Every number that goes in is named, so that it can be argued with; a pilot measures the rest.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from math import lcm
from statistics import fmean

from webapp.stimuli.arm_linter import explanation_words, shown
from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.reading import SECONDS_PER_PICTURE, WORDS_PER_MINUTE, num_words, reading_seconds
from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.experiments import SATISFACTION_ITEMS, Experiment
from webapp.study.protocol import Study
from webapp.study.session import Page, Trial, pages

SECONDS_PER_ANSWER = 5.0
SECONDS_PER_OWN_WORDS = 30.0
SECONDS_PER_ACTION = 2.0
SECONDS_PER_VIDEO_PICTURE = 1.0
SECONDS_PER_PAGE = 2.0
ACTIONS_PER_OPTIMAL_STEP = 1.5

ASSUMPTIONS: Mapping[str, str] = {
    "reading": f"{WORDS_PER_MINUTE} words per minute, silently (Brysbaert 2019); what every trial repeats, once",
    "pictures": f"{SECONDS_PER_PICTURE:g} seconds each, {SECONDS_PER_VIDEO_PICTURE:g} in a video",
    "answers": f"{SECONDS_PER_ANSWER:g} seconds each, {SECONDS_PER_OWN_WORDS:g} in own words",
    "steering": f"{SECONDS_PER_ACTION:g} seconds per action, {ACTIONS_PER_OPTIMAL_STEP:g} times the agent's actions",
    "pages": f"{SECONDS_PER_PAGE:g} seconds to load and to send each",
}
"""What the estimate rests on. All but the first are ours."""


@dataclass(frozen=True, slots=True)
class Duration:
    """How long participants need, over the arrangements of kinds and layouts, all equally likely.

    Attributes:
        shortest: In minutes.
        median: In minutes.
        longest: In minutes.
    """

    shortest: float
    median: float
    longest: float


def expected_duration(catalogue: Catalogue) -> Duration:
    """Estimate how long a study takes in its first language, from the consent to the last page."""
    totals = Counter({round(_around_the_trials(catalogue)): 1})
    for experiment in catalogue.study.experiments:
        own = Counter(round(seconds) for seconds in _per_arrangement(catalogue, experiment))
        sums: Counter[int] = Counter()
        for total, count in totals.items():
            for seconds, times in own.items():
                sums[total + seconds] += count * times
        totals = sums
    return Duration(min(totals) / 60, _median(totals) / 60, max(totals) / 60)


def full_round(study: Study) -> int:
    """Return after how many participants every arrangement and layout order of every experiment was used equally."""
    return lcm(*(len(arrangements(experiment)) * len(layout_orders(experiment)) for experiment in study.experiments))


def _around_the_trials(catalogue: Catalogue) -> float:
    """Consent, background, instructions, practice, quiz, thanks."""
    study = catalogue.study
    seconds = _reading(catalogue, "welcome.", "instructions.", "facts.", "done.") + 3 * SECONDS_PER_PAGE
    if study.background is not None:
        seconds += sum(
            SECONDS_PER_OWN_WORDS if question.type == "text" else SECONDS_PER_ANSWER
            for question in study.background.questions
        )
        seconds += _reading(catalogue, *(f"background.{question.id}." for question in study.background.questions))
        seconds += SECONDS_PER_PAGE
    if study.practice is not None:
        seconds += _drive(catalogue, study.practice.layout) + SECONDS_PER_PAGE
    if study.quiz is not None:
        seconds += len(study.quiz.questions) * SECONDS_PER_ANSWER + SECONDS_PER_PAGE
        for question in study.quiz.questions:
            seconds += _reading(catalogue, f"quiz.{question.id}.question", f"quiz.{question.id}.choices.")
    return seconds


def _per_arrangement(catalogue: Catalogue, experiment: Experiment) -> list[float]:
    """Return the seconds that each arrangement takes; an order of the layouts changes nothing."""
    num_trials, totals = len(experiment.layouts), []
    for kinds in arrangements(experiment):
        trials = [
            Trial(experiment.id, position, num_trials, layout, kind, 0 if kind == "random" else None)
            for position, (layout, kind) in enumerate(zip(experiment.layouts, kinds, strict=True), start=1)
        ]
        own = [(page, page.trial) for page in pages(catalogue.study, trials) if page.trial is not None]
        totals.append(sum(_of_page(catalogue, experiment, page, trial) for page, trial in own))
    return totals


def _of_page(catalogue: Catalogue, experiment: Experiment, page: Page, trial: Trial) -> float:
    is_first = trial.position == 1
    match page.kind:
        case "situation":
            seconds = _situation(catalogue, experiment, trial, is_first=is_first)
        case "explanation":
            seconds = _explanation(catalogue, experiment, trial, is_first=is_first)
        case "rating":
            seconds = _ratings(catalogue, experiment, trial, is_first=is_first)
        case "satisfaction":
            seconds = len(SATISFACTION_ITEMS) * SECONDS_PER_ANSWER
            seconds += _reading(catalogue, "satisfaction.") if is_first else 0.0
        case "probe":
            num_questions = len(catalogue.probes(experiment.id, trial.layout))
            seconds = num_questions * (2 * SECONDS_PER_ANSWER + SECONDS_PER_PICTURE)
        case _:
            seconds = _drive(catalogue, trial.layout)
    return seconds + SECONDS_PER_PAGE


def _situation(catalogue: Catalogue, experiment: Experiment, trial: Trial, *, is_first: bool) -> float:
    situation = catalogue.situation(trial, catalogue.study.languages[0])
    seconds = SECONDS_PER_PICTURE + reading_seconds(num_words(situation.announced))
    if situation.video is not None:
        seconds += len(situation.video.frames) * SECONDS_PER_VIDEO_PICTURE
    return seconds + (_reading(catalogue, f"experiments.{experiment.id}.introduction") if is_first else 0.0)


def _explanation(catalogue: Catalogue, experiment: Experiment, trial: Trial, *, is_first: bool) -> float:
    """Take the mean of the variants; what stands around the pictures counts once, what is between them each time."""
    times = []
    for strips in shown(catalogue, experiment, trial.layout, trial.kind):
        words = num_words(action for strip in strips for action in strip.actions)
        if is_first or not strips:
            words = explanation_words(catalogue, experiment, trial.kind, strips)
        times.append(reading_seconds(words, sum(len(strip.frames) for strip in strips)))
    return fmean(times)


def _ratings(catalogue: Catalogue, experiment: Experiment, trial: Trial, *, is_first: bool) -> float:
    items = experiment.items_for(trial.kind)
    checks = catalogue.study.checks_of(experiment.id, trial.position)
    seconds = (len(items) + len(checks)) * SECONDS_PER_ANSWER
    texts = catalogue.texts(catalogue.study.languages[0])
    if is_first:
        seconds += reading_seconds(num_words(texts.item(item.id, experiment.id).legend for item in items))
    rates_later = experiment.drive is not None and experiment.drive.when == "before_ratings"
    if rates_later and trial.kind != "none":
        return seconds
    return seconds + _explanation(catalogue, experiment, trial, is_first=is_first)


def _drive(catalogue: Catalogue, layout: str) -> float:
    return catalogue.world(layout).num_steps * ACTIONS_PER_OPTIMAL_STEP * SECONDS_PER_ACTION


def _reading(catalogue: Catalogue, *beginnings: str) -> float:
    """Return how long it takes to read all texts whose keys begin so."""
    entries = catalogue.texts(catalogue.study.languages[0]).entries
    found = (text for key, text in entries.items() if key.startswith(beginnings))
    return reading_seconds(num_words(part for text in found for part in ([text] if isinstance(text, str) else text)))


def _median(totals: Counter[int]) -> float:
    """Return the middle of a distribution given as counts, the mean of the two middle ones if there are two."""
    values = sorted(totals)
    up_to = list(accumulate(totals[value] for value in values))
    lower = next(value for value, number in zip(values, up_to, strict=True) if 2 * number >= up_to[-1])
    upper = next(value for value, number in zip(values, up_to, strict=True) if 2 * number > up_to[-1])
    return (lower + upper) / 2
