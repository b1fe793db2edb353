"""The way of one participant through a study: the trials, their pages, and what may be sent when."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from webapp.study.counterbalancing import arrangements
from webapp.study.protocol import Kind, Study

PageKind = Literal["instructions", "situation", "rating"]

Decision = Literal["accept", "already_answered", "too_early"]
"""What becomes of an answer: it is stored; it was given before, and the first one stands; its page was not reached."""


class NoSuchPageError(LookupError):
    """The study has no page of this number."""


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
        trial: The trial it belongs to; None for the instructions.
    """

    number: int
    kind: PageKind
    trial: Trial | None

    def __post_init__(self) -> None:
        if (self.trial is None) != (self.kind == "instructions"):
            raise ValueError(f"a page of a trial has a trial and no other page has one, and this is {self.kind!r}")


def plan_trials(
    study: Study, arrangement_by_experiment: Mapping[str, int], draw: Callable[[], int]
) -> tuple[Trial, ...]:
    """Plan the trials of one participant.

    Args:
        study: The study.
        arrangement_by_experiment: For each experiment's id, an index into `arrangements(experiment)`.
        draw: Chooses a draw of the random kind, from 0 to `study.explanation.num_draws - 1`; called once for each
            trial of that kind.

    Raises:
        KeyError: An experiment has no arrangement.
        ValueError: An arrangement or a draw does not exist.
    """
    return tuple(
        trial
        for experiment in study.experiments
        for trial in _trials_of(study, experiment.id, arrangement_by_experiment[experiment.id], draw)
    )


def pages(trials: Sequence[Trial]) -> tuple[Page, ...]:
    """Return a participant's pages in order: the instructions, then situation and rating of each trial."""
    kinds: list[tuple[PageKind, Trial | None]] = [("instructions", None)]
    for trial in trials:
        kinds += [("situation", trial), ("rating", trial)]
    return tuple(Page(number, kind, trial) for number, (kind, trial) in enumerate(kinds, start=1))


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


def _trials_of(study: Study, experiment_id: str, arrangement: int, draw: Callable[[], int]) -> tuple[Trial, ...]:
    experiment = study.experiment(experiment_id)
    choices = arrangements(experiment)
    if not 0 <= arrangement < len(choices):
        raise ValueError(f"experiment {experiment_id!r} has {len(choices)} arrangements, from 0, not {arrangement}")
    return tuple(
        Trial(
            experiment=experiment_id,
            position=position,
            num_trials=len(experiment.layouts),
            layout=layout,
            kind=kind,
            draw=_checked_draw(study, draw) if kind == "random" else None,
        )
        for position, (layout, kind) in enumerate(zip(experiment.layouts, choices[arrangement], strict=True), start=1)
    )


def _checked_draw(study: Study, draw: Callable[[], int]) -> int:
    drawn = draw()
    if not 0 <= drawn < study.explanation.num_draws:
        raise ValueError(f"there is no draw {drawn}; there are {study.explanation.num_draws}, from 0")
    return drawn
