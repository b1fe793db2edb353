"""What hides which arm is which: kinds of explanation become `Arm A`, `Arm B` and so on, in an order of their own.

Views hand templates numbers that went through the mask, so that no page, attribute or address can tell a kind.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, TypeVar

from webapp.storage.live_numbers import Cell, CellUse, Numbers
from webapp.storage.live_outcomes import Driven, DriveSummary
from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.experiments import TAILORED_KINDS, Experiment, Kind
from webapp.study.protocol import Study
from webapp.study.session import PageKind, Trial, pages

NO_EXPLANATION = "none"
"""The kind that asks less, because nothing was explained."""

_Row = TypeVar("_Row")


@dataclass(frozen=True, slots=True)
class Mask:
    """The mask of one account on one scope.

    Attributes:
        opened_at: Since when the account sees the arms; None while they are masked.
        labels: What each kind of an experiment is called while masked.
        has_looked: Whether the account saw what some participant of the scope was shown.
    """

    opened_at: datetime | None
    labels: Mapping[tuple[str, str], str]
    has_looked: bool = False

    @property
    def is_open(self) -> bool:
        """Whether the arms are seen."""
        return self.opened_at is not None

    @property
    def shows_arms(self) -> bool:
        """Whether there is anything by arm.

        Who knows what one participant was shown, and when that participant went on, would see the number of one letter
        grow with each trial, and so know all letters.
        """
        return self.is_open or not self.has_looked

    def name(self, experiment: str, kind: str) -> str:
        """Return what a kind is called on this account's pages."""
        return kind.replace("_", " ") if self.is_open else self.labels[experiment, kind]

    def numbers(self, numbers: Numbers, study: Study) -> Numbers:
        """Return the numbers with kinds by the names they have here, in an order that does not tell them either."""
        experiments = [experiment.id for experiment in study.experiments]
        ratings, drives = numbers.ratings, numbers.drives
        hidden = self.hidden_pages(study)
        if not self.is_open:
            ratings = tuple(row for row in ratings if asks_every_arm(study.experiment(row.experiment), row.item))
            drives = tuple(_without_telling(study.experiment(row.experiment), row) for row in drives)
        numbers = replace(
            numbers, page_times=tuple(entry for entry in numbers.page_times if entry.page_kind not in hidden)
        )
        # Whoever takes part once learns which kind goes with which layout: letters by layouts would tell the letters.
        cells = self._rows(numbers.cells, experiments) if self.is_open else ()
        if not self.shows_arms:
            return replace(numbers, cells=cells, arms=(), ratings=(), predictions=(), drives=())
        return replace(
            numbers,
            cells=cells,
            arms=self._rows(numbers.arms, experiments),
            ratings=self._rows(ratings, experiments),
            predictions=self._rows(numbers.predictions, experiments),
            drives=self._rows(drives, experiments),
        )

    def balance(self, cells: Sequence[Cell]) -> "tuple[LayoutBalance, ...]":
        """Return what is told of the cells while masked; nothing once the cells themselves are seen."""
        if self.is_open:
            return ()
        of_layouts: dict[tuple[str, str], list[Cell]] = {}
        for cell in cells:
            of_layouts.setdefault((cell.experiment, cell.layout), []).append(cell)
        return tuple(_balance(*place, theirs) for place, theirs in of_layouts.items())

    def leaves_out(self, study: Study) -> bool:
        """Tell whether something is left out while masked, because only some arms have it."""
        return not self.is_open and any(
            _telling_pages(study, experiment)
            or not all(asks_every_arm(experiment, item.id) for item in experiment.items)
            for experiment in study.experiments
        )

    def hidden_pages(self, study: Study) -> frozenset[PageKind]:
        """Return the kinds of pages about which nothing is told while masked: how many were sent tells who has them."""
        if self.is_open:
            return frozenset()
        return frozenset[PageKind]().union(*(_telling_pages(study, experiment) for experiment in study.experiments))

    def _rows(self, rows: Iterable[_Row], experiments: Sequence[str]) -> tuple[_Row, ...]:
        kinds: Iterable[Any] = rows
        named = [replace(row, kind=self.name(row.experiment, row.kind)) for row in kinds]
        if not self.is_open:
            named.sort(key=lambda row: (experiments.index(row.experiment), _place(row.kind)))
        return tuple(named)

    def arrangements(self, study: Study, uses: Iterable[CellUse]) -> "Sequence[Arranged]":
        """Return what each arrangement shows where; none while masked, because all of them tell the kinds."""
        return [self._arrangement(study, use) for use in uses] if self.is_open else ()

    def _arrangement(self, study: Study, use: CellUse) -> "Arranged":
        experiment = study.experiment(use.experiment)
        kinds = arrangements(experiment)[use.arrangement]
        order = layout_orders(experiment)[use.layout_order]
        shown = tuple((experiment.layouts[place], self.name(experiment.id, kinds[place])) for place in order)
        return Arranged(f"{use.arrangement}/{use.layout_order}", shown, use)


@dataclass(frozen=True, slots=True)
class LayoutBalance:
    """How evenly the arms of an experiment are spread on one layout, without which is which.

    Attributes:
        experiment: The experiment's id.
        layout: The layout's name.
        fewest_assigned: Of the arm to which fewest people were assigned on this layout.
        most_assigned: Of the arm to which most were.
        fewest_done: Of the arm whose trial fewest people have done on this layout.
        most_done: Of the arm whose trial most have.
    """

    experiment: str
    layout: str
    fewest_assigned: int
    most_assigned: int
    fewest_done: int
    most_done: int


@dataclass(frozen=True, slots=True)
class Arranged:
    """A row of the table of arrangements.

    Attributes:
        name: Arrangement and order of layouts by their numbers, as in the data.
        shown: Layouts with kinds, in the order in which participants see them.
        use: How often it was given.
    """

    name: str
    shown: tuple[tuple[str, str], ...]
    use: CellUse


def asks_every_arm(experiment: Experiment, item: str) -> bool:
    """Tell whether every arm is asked an item: who is not asked can be told by that."""
    if NO_EXPLANATION not in experiment.kinds or len(experiment.kinds) == 1:
        return True
    return item in {asked.id for asked in experiment.items_for(NO_EXPLANATION)}


def _telling_pages(study: Study, experiment: Experiment) -> frozenset[PageKind]:
    """Return the kinds of pages that some arms of an experiment have and others have not."""
    of_arms = [_pages_of(study, experiment, kind) for kind in experiment.kinds]
    return of_arms[0].union(*of_arms) - of_arms[0].intersection(*of_arms)


def _pages_of(study: Study, experiment: Experiment, kind: Kind) -> frozenset[PageKind]:
    trial = Trial(experiment.id, 1, 1, experiment.layouts[0], kind, 0 if kind == "random" else None)
    return frozenset(page.kind for page in pages(study, (trial,)) if page.trial is not None)


def _balance(experiment: str, layout: str, cells: Sequence[Cell]) -> LayoutBalance:
    assigned, done = [cell.assigned for cell in cells], [cell.done for cell in cells]
    return LayoutBalance(experiment, layout, min(assigned), max(assigned), min(done), max(done))


def _drives_in_every_arm(experiment: Experiment) -> bool:
    """Tell whether all arms, or none, drive before the explanation."""
    num_tailored = len(TAILORED_KINDS.intersection(experiment.kinds))
    drive = experiment.drive
    return drive is None or drive.baseline or num_tailored in {0, len(experiment.kinds)}


def _without_telling(experiment: Experiment, row: DriveSummary) -> DriveSummary:
    if _drives_in_every_arm(experiment):
        return row
    return replace(row, before=Driven(None, None), gain=None)


def _place(label: str) -> tuple[int, str]:
    """Sort `Arm Z` before `Arm AA`."""
    return len(label), label
