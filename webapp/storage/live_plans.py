"""What many participants have in common: the same trials in the same order, so the same pages and milestones."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TypeVar, cast

from webapp.study.experiments import SATISFACTION_ITEMS, Experiment, Item
from webapp.study.protocol import Study
from webapp.study.session import PageKind, Trial, pages

Arm = tuple[str, str]
"""Experiment and kind."""
CellKey = tuple[str, str, str]
"""Experiment, kind and layout."""
RatingKey = tuple[str, str, str]
"""Experiment, kind and item."""

_Value = TypeVar("_Value", bound=Hashable)

_BEFORE: tuple[tuple[PageKind, str], ...] = (
    ("background", "answered the background questions"),
    ("instructions", "read the instructions"),
    ("practice", "finished the practice"),
    ("quiz", "passed the quiz"),
)
_FIRST_STEP, _LAST_STEP = "gave consent", "completed the study"


@dataclass(frozen=True, slots=True)
class Plan:
    """The trials of some participants, with the pages that follow from them.

    Attributes:
        cells: By trial: experiment, kind and layout.
        arms: By trial: experiment and kind.
        page_kinds: By page.
        first_pages: By trial, the number of its first page.
        last_pages: By trial, the number of its last page.
        milestones: The pages whose sending is a step of the funnel, in order; completion is a step more.
        quiz_page: The number of the quiz's page; None where there is none.
    """

    cells: tuple[CellKey, ...]
    arms: tuple[Arm, ...]
    page_kinds: tuple[PageKind, ...]
    first_pages: tuple[int, ...]
    last_pages: tuple[int, ...]
    milestones: tuple[int, ...]
    quiz_page: int | None

    def num_started(self, num_stored: int) -> int:
        """Return how many trials were reached by somebody who sent so many pages, and was not screened out."""
        return sum(num_stored >= first - 1 for first in self.first_pages)

    def num_finished(self, num_stored: int) -> int:
        """Return how many trials were finished by somebody who sent so many pages."""
        return sum(num_stored >= last for last in self.last_pages)


class Plans:
    """The plans of one version of a study, each made once."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self.arms: tuple[Arm, ...] = tuple(
            (experiment.id, kind) for experiment in study.experiments for kind in experiment.kinds
        )
        self.cells: tuple[CellKey, ...] = tuple(
            (experiment.id, kind, layout)
            for experiment in study.experiments
            for kind in experiment.kinds
            for layout in experiment.layouts
        )
        self.points: dict[RatingKey, int] = {
            (experiment.id, kind, item.id): item.points
            for experiment in study.experiments
            for kind in experiment.kinds
            for item in _items(experiment)
        }
        self.rating_keys = tuple(self.points)
        self._rating_places = {key: place for place, key in enumerate(self.rating_keys)}
        self._arm_places = {arm: place for place, arm in enumerate(self.arms)}
        self._plans: dict[tuple[CellKey, ...], Plan] = {}
        self._shared: dict[Hashable, Hashable] = {}

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps of the funnel, in English."""
        declared = {"background": self.study.background, "practice": self.study.practice, "quiz": self.study.quiz}
        before = [words for kind, words in _BEFORE if kind == "instructions" or declared[kind] is not None]
        trials = [
            f"finished trial {position} of {len(experiment.layouts)} of experiment {experiment.id}"
            for experiment in self.study.experiments
            for position in range(1, len(experiment.layouts) + 1)
        ]
        return (_FIRST_STEP, *before, *trials[:-1], _LAST_STEP)

    def plan(self, cells: tuple[CellKey, ...]) -> Plan:
        """Return the plan of the participants who have these trials, in order."""
        known = self._plans.get(cells)
        if known is None:
            known = self._plans[cells] = _plan(self.study, cells)
        return known

    def shared(self, value: _Value) -> _Value:
        """Return the value that is equal to this one and was seen first, so that many participants hold only one."""
        return cast("_Value", self._shared.setdefault(value, value))

    def rating_place(self, arm: Arm, item: str) -> int:
        """Return the place of an item, rated in an arm, in `rating_keys`."""
        return self._rating_places[*arm, item]

    def arm_place(self, arm: Arm) -> int:
        """Return the place of an arm in `arms`."""
        return self._arm_places[arm]


def _items(experiment: Experiment) -> tuple[Item, ...]:
    satisfaction = SATISFACTION_ITEMS if experiment.satisfaction else ()
    return (*experiment.items, *(Item(id=item) for item in satisfaction))


def _plan(study: Study, cells: Sequence[CellKey]) -> Plan:
    in_order = pages(study, _trials(study, cells))
    before = [page for page in in_order if page.trial is None]
    of_trials: dict[Trial, list[int]] = {}
    for page in in_order:
        if page.trial is not None:
            of_trials.setdefault(page.trial, []).append(page.number)
    numbers = list(of_trials.values())
    return Plan(
        cells=tuple(cells),
        arms=tuple((experiment, kind) for experiment, kind, _ in cells),
        page_kinds=tuple(page.kind for page in in_order),
        first_pages=tuple(of_trial[0] for of_trial in numbers),
        last_pages=tuple(of_trial[-1] for of_trial in numbers),
        milestones=(*(page.number for page in before), *(of_trial[-1] for of_trial in numbers[:-1])),
        quiz_page=next((page.number for page in before if page.kind == "quiz"), None),
    )


def _trials(study: Study, cells: Sequence[CellKey]) -> list[Trial]:
    """Make trials of which only that matters on which pages depend: experiment and kind."""
    found: list[Trial] = []
    positions: dict[str, int] = {}
    for experiment_id, kind_name, layout in cells:
        experiment = study.experiment(experiment_id)
        kind = next(kind for kind in experiment.kinds if kind == kind_name)
        position = positions[experiment_id] = positions.get(experiment_id, 0) + 1
        draw = 0 if kind == "random" else None
        found.append(Trial(experiment_id, position, len(experiment.layouts), layout, kind, draw))
    return found
