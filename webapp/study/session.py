"""The way of one participant through a study: the trials, their pages, and what may be sent when."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.experiments import TAILORED_KINDS, Experiment, Kind
from webapp.study.protocol import Study

_Choice = TypeVar("_Choice")

PageKind = Literal[
    "background",
    "instructions",
    "practice",
    "quiz",
    "situation",
    "first_drive",
    "explanation",
    "probe",
    "drive",
    "rating",
    "satisfaction",
]
"""What stands on a page.

On `practice`, `first_drive` (before the explanation) and `drive` the participant steers the agent.
"""

DRIVEN: Mapping[PageKind, Literal["practice", "before", "after"]] = {
    "practice": "practice",
    "first_drive": "before",
    "drive": "after",
}
"""The pages on which the participant steers the agent, and what the data call them."""

_BEFORE_THE_TRIALS: frozenset[PageKind] = frozenset({"background", "instructions", "practice", "quiz"})

Decision = Literal["accept", "already_answered", "too_early"]
"""What becomes of an answer: it is stored; it was given before, and the first one stands; its page was not reached."""


class NoSuchPageError(LookupError):
    """The study has no page of this number."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """What was chosen for one participant in one experiment.

    Attributes:
        arrangement: An index into `arrangements(experiment)`: which kind goes with which layout.
        layout_order: An index into `layout_orders(experiment)`.
    """

    arrangement: int
    layout_order: int = 0


@dataclass(frozen=True, slots=True)
class Trial:
    """One explanation to be rated.

    Attributes:
        experiment: The experiment's id.
        position: The place within the experiment, from 1.
        num_trials: The number of trials of the experiment.
        layout: The layout's name.
        kind: The kind of explanation.
        draw: Which draw is shown, from 0, for the random kind; else None.
    """

    experiment: str
    position: int
    num_trials: int
    layout: str
    kind: Kind
    draw: int | None

    def __post_init__(self) -> None:
        if not 1 <= self.position <= self.num_trials:
            raise ValueError(f"the position must be from 1 to {self.num_trials}, not {self.position}")
        if (self.draw is not None) != (self.kind == "random"):
            raise ValueError(f"a draw belongs to the random kind and to no other, and this is {self.kind!r}")
        if self.draw is not None and self.draw < 0:
            raise ValueError(f"the draw must be 0 or larger, not {self.draw}")


@dataclass(frozen=True, slots=True)
class Page:
    """One page that is sent in.

    Attributes:
        number: From 1.
        kind: What stands on it.
        trial: The trial it belongs to; None before the trials.
        trial_number: Which of the participant's trials that is, from 1; None before the trials.
    """

    number: int
    kind: PageKind
    trial: Trial | None
    trial_number: int | None = None

    def __post_init__(self) -> None:
        if (self.trial is None) != (self.kind in _BEFORE_THE_TRIALS):
            raise ValueError(f"a page of a trial has a trial and no other page has one, and this is {self.kind!r}")
        if (self.trial is None) != (self.trial_number is None):
            raise ValueError(f"a page has a trial and its number or neither, not {self.trial_number!r}")


def plan_trials(study: Study, assignments: Mapping[str, Assignment], draw: Callable[[], int]) -> tuple[Trial, ...]:
    """Plan the trials of one participant.

    Args:
        study: The study.
        assignments: What was chosen for each experiment, by its id.
        draw: Chooses a draw of the random kind, from 0 to `study.explanation.num_draws - 1`; called once for each
            trial of that kind.

    Raises:
        KeyError: An experiment has no assignment.
        ValueError: An arrangement, an order of the layouts or a draw does not exist.
    """
    return tuple(
        trial
        for experiment in study.experiments
        for trial in _trials_of(study, experiment, assignments[experiment.id], draw)
    )


def pages(study: Study, trials: Sequence[Trial]) -> tuple[Page, ...]:
    """Return a participant's pages in order: what comes before the trials, then the pages of each trial."""
    before: dict[PageKind, bool] = {
        "background": study.background is not None,
        "instructions": True,
        "practice": study.practice is not None,
        "quiz": study.quiz is not None,
    }
    kinds: list[tuple[PageKind, Trial | None, int | None]] = [
        (kind, None, None) for kind, is_there in before.items() if is_there
    ]
    for trial_number, trial in enumerate(trials, start=1):
        kinds += [(kind, trial, trial_number) for kind in _kinds_of(study.experiment(trial.experiment), trial.kind)]
    return tuple(Page(number, *page) for number, page in enumerate(kinds, start=1))


def _kinds_of(experiment: Experiment, kind: Kind) -> Iterator[PageKind]:
    """Yield the pages of a trial. Predictions come before the drive, which would teach what is asked."""
    drive = experiment.drive
    is_explained = kind != "none"
    yield "situation"
    if drive is not None and (drive.baseline or kind in TAILORED_KINDS):
        yield "first_drive"
    rates_last = drive is not None and drive.when == "before_ratings"
    if rates_last and is_explained:
        yield "explanation"
    rating: tuple[PageKind, ...] = ("rating",) if experiment.items_for(kind) else ()
    if experiment.satisfaction and is_explained:
        rating = (*rating, "satisfaction")
    if not rates_last:
        yield from rating
    if experiment.probe is not None:
        yield "probe"
    if drive is not None:
        yield "drive"
    if rates_last:
        yield from rating


def decide(number: int, num_stored: int, num_pages: int) -> Decision:
    """Say what becomes of an answer to page `number` when the first `num_stored` pages are answered.

    Raises:
        NoSuchPageError: The number is not from 1 to `num_pages`.
    """
    if not 1 <= number <= num_pages:
        raise NoSuchPageError(f"there is no page {number}; there are {num_pages}, from 1")
    if number <= num_stored:
        return "already_answered"
    return "accept" if number == num_stored + 1 else "too_early"


def _trials_of(
    study: Study, experiment: Experiment, assignment: Assignment, draw: Callable[[], int]
) -> Iterator[Trial]:
    kinds = _chosen(arrangements(experiment), assignment.arrangement, f"arrangements of experiment {experiment.id!r}")
    order = _chosen(layout_orders(experiment), assignment.layout_order, f"orders of experiment {experiment.id!r}")
    for position, place in enumerate(order, start=1):
        yield Trial(
            experiment=experiment.id,
            position=position,
            num_trials=len(experiment.layouts),
            layout=experiment.layouts[place],
            kind=kinds[place],
            draw=_checked_draw(study, draw) if kinds[place] == "random" else None,
        )


def _chosen(choices: Sequence[_Choice], number: int, what: str) -> _Choice:
    if not 0 <= number < len(choices):
        raise ValueError(f"there are {len(choices)} {what}, from 0, and no {number}")
    return choices[number]


def _checked_draw(study: Study, draw: Callable[[], int]) -> int:
    drawn = draw()
    if not 0 <= drawn < study.explanation.num_draws:
        raise ValueError(f"there is no draw {drawn}; there are {study.explanation.num_draws}, from 0")
    return drawn
