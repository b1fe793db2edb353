"""What the arms of an experiment differ in besides what they are meant to differ in.

Per kind and layout: pictures, words, the time to take them in, bytes, and the fidelity that the kinds are meant to
differ in. A kind that differs from the others by more than a stated threshold is warned about: a difference in the
ratings could then come from that. In the paper the random arm has a picture more or fewer than the subgoals at most;
its full arm has many more.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any, Literal

from webapp.stimuli.catalogue import Catalogue, Strip
from webapp.stimuli.reading import num_words, reading_seconds
from webapp.study.experiments import TAILORED_KINDS, Experiment, Kind
from webapp.study.session import Trial

Measure = Literal["pictures", "words", "words_heard", "seconds", "kilobytes"]

MEASURES: Mapping[Measure, str] = {
    "pictures": "pictures",
    "words": "words to read",
    "words_heard": "words to hear",
    "seconds": "seconds to take in",
    "kilobytes": "kilobytes",
}
"""What is compared, in words. Heard are the pictures' descriptions, by whoever uses a screen reader."""

THRESHOLDS: Mapping[Measure, tuple[float, float]] = {
    "pictures": (1.0, 0.0),
    "words": (10.0, 0.25),
    "words_heard": (10.0, 0.25),
    "seconds": (5.0, 0.25),
    "kilobytes": (50.0, 0.25),
}
"""A difference is warned about if it is above both: so many, and such a share of what the other kind has."""

_BY_DESIGN: frozenset[str] = frozenset({"none"})
"""Kinds that are there to show nothing; they are compared with no other."""


@dataclass(frozen=True, slots=True)
class Spread:
    """A number over the variants of a kind: draws of the random kind, or what a participant's own drive calls for."""

    lowest: float
    mean: float
    highest: float

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Return the spread of some values, at least one."""
        return cls(min(values), fmean(values), max(values))


@dataclass(frozen=True, slots=True)
class Arm:
    """One kind with one layout.

    Attributes:
        layout: The layout's name.
        kind: The kind.
        measures: What is compared.
        fidelity: `P(reach | shown)`, see `arm_fidelity`.
        is_like_subgoals: Whether a comparison arm happens to show exactly what the subgoals show.
    """

    layout: str
    kind: str
    measures: Mapping[Measure, Spread]
    fidelity: Spread
    is_like_subgoals: bool


@dataclass(frozen=True, slots=True)
class Confound:
    """A kind that differs from another in more than it is meant to.

    Attributes:
        kind: The kind.
        other: The one that it is compared with: the middle one of the experiment.
        measure: In what they differ.
        layout: Where they differ most.
        value: What the kind has there.
        other_value: What the other has.
    """

    kind: str
    other: str
    measure: Measure
    layout: str
    value: float
    other_value: float

    def __str__(self) -> str:
        number, share = THRESHOLDS[self.measure]
        difference = self.value - self.other_value
        limit = f"{number:g}" + (f" and {share:.0%}" if share else "")
        return (
            f"{self.kind!r} has {abs(difference):.0f} {'more' if difference > 0 else 'fewer'} {MEASURES[self.measure]} "
            f"than {self.other!r} in layout {self.layout!r} ({self.value:.0f} and {self.other_value:.0f}; "
            f"warned about above {limit})"
        )


@dataclass(frozen=True, slots=True)
class ArmReport:
    """The arms of one experiment.

    Attributes:
        experiment: Its id.
        arms: Each kind with each layout.
        confounds: What to think about before launch.
    """

    experiment: str
    arms: tuple[Arm, ...]
    confounds: tuple[Confound, ...]


def compare_arms(catalogue: Catalogue, folder: Path, report: Sequence[Mapping[str, Any]]) -> tuple[ArmReport, ...]:
    """Compare the arms of each experiment, as its participants meet them in the study's first language.

    Args:
        catalogue: A bundle.
        folder: Its folder.
        report: The bundle's build report, a part for each layout.
    """
    by_layout = {part["layout"]: part for part in report}
    reports = []
    for experiment in catalogue.study.experiments:
        arms = tuple(
            _arm(catalogue, folder, experiment, layout, kind, by_layout[layout])
            for kind in experiment.kinds
            for layout in experiment.layouts
        )
        reports.append(ArmReport(experiment.id, arms, tuple(_confounds(arms))))
    return tuple(reports)


def _arm(
    catalogue: Catalogue, folder: Path, experiment: Experiment, layout: str, kind: Kind, report: Mapping[str, Any]
) -> Arm:
    variants = [
        _measured(catalogue, folder, experiment, kind, strips) for strips in shown(catalogue, experiment, layout, kind)
    ]
    return Arm(
        layout,
        kind,
        {measure: Spread.of([variant[measure] for variant in variants]) for measure in MEASURES},
        Spread(*report["fidelity"][experiment.id][kind]),
        kind in report["arms_like_subgoals"][experiment.id],
    )


def shown(catalogue: Catalogue, experiment: Experiment, layout: str, kind: Kind) -> list[tuple[Strip, ...]]:
    """Return what each variant of a kind shows of a layout; nothing at all for the kind that explains nothing.

    A tailored kind may show each of the subgoals ahead by itself or, unless it shows the first alone, all of them.
    """
    if kind == "none":
        return [()]
    language, num_trials = catalogue.study.languages[0], len(experiment.layouts)
    if kind in TAILORED_KINDS:
        trial = Trial(experiment.id, 1, num_trials, layout, kind, None)
        from_step = catalogue.from_step(trial)
        ahead = [step for step in catalogue.world(layout).subgoals if step >= from_step]
        choices = [[step] for step in ahead] + ([ahead] if kind != "tailored_first" else [])
        return [catalogue.explanation(trial, language, steps) for steps in choices]
    draws = range(catalogue.study.explanation.num_draws) if kind == "random" else (None,)
    trials = [Trial(experiment.id, 1, num_trials, layout, kind, draw) for draw in draws]
    return [catalogue.explanation(trial, language) for trial in trials]


def explanation_words(catalogue: Catalogue, experiment: Experiment, kind: Kind, strips: Sequence[Strip]) -> float:
    """Count the words that stand around and between the pictures of an explanation."""
    texts = catalogue.texts(catalogue.study.languages[0])
    if not strips:
        return num_words([texts("explanation.title_none"), texts("explanation.none")])
    keys = ["explanation.title", f"experiments.{experiment.id}.explanation", "explanation.lead"]
    keys += ["explanation.moments"] if len(strips) > 1 else []
    keys += ["explanation.placebic"] if kind == "placebic" else []
    keys += ["tailored.missing"] if kind in TAILORED_KINDS else []
    actions = [action for strip in strips for action in strip.actions]
    return num_words([*(texts(key) for key in keys), *actions])


def _measured(
    catalogue: Catalogue, folder: Path, experiment: Experiment, kind: Kind, strips: Sequence[Strip]
) -> dict[Measure, float]:
    frames = [frame for strip in strips for frame in strip.frames]
    words = explanation_words(catalogue, experiment, kind, strips)
    files = {folder / "pictures" / f"{frame.digest}.png" for frame in frames}
    return {
        "pictures": len(frames),
        "words": words,
        "words_heard": num_words([frame.alt for frame in frames]),
        "seconds": reading_seconds(words, len(frames)),
        "kilobytes": sum(file.stat().st_size for file in files) / 1000,
    }


def _confounds(arms: Sequence[Arm]) -> list[Confound]:
    """Find for each kind and measure the layout in which it differs most from the middle kind, if that is too much."""
    found: dict[tuple[str, Measure], Confound] = {}
    for layout in dict.fromkeys(arm.layout for arm in arms):
        here = [arm for arm in arms if arm.layout == layout and arm.kind not in _BY_DESIGN]
        for measure in MEASURES if len(here) > 1 else ():
            ranked = sorted(here, key=lambda arm: arm.measures[measure].mean)
            middle = ranked[(len(ranked) - 1) // 2]
            for arm in here:
                confound = _confound(arm, middle, measure)
                known = found.get((arm.kind, measure))
                if confound is not None and (known is None or _size(confound) > _size(known)):
                    found[arm.kind, measure] = confound
    return list(found.values())


def _confound(arm: Arm, middle: Arm, measure: Measure) -> Confound | None:
    """Compare the extremes where people of one arm see unequally much, the means of draws otherwise."""
    spread, other = arm.measures[measure], middle.measures[measure].mean
    values = (spread.lowest, spread.highest) if arm.kind in TAILORED_KINDS else (spread.mean,)
    value = max(values, key=lambda value: abs(value - other))
    number, share = THRESHOLDS[measure]
    difference = abs(value - other)
    if arm is middle or difference <= number or difference <= share * other:
        return None
    return Confound(arm.kind, middle.kind, measure, arm.layout, value, other)


def _size(confound: Confound) -> float:
    return abs(confound.value - confound.other_value)
