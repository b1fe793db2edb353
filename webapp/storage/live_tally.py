"""Sums over participants to which one can be added and from which one can be taken away again.

All of them are whole numbers: after any history they are exactly what counting anew would give.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence

from webapp.storage.live_plans import Arm, CellKey
from webapp.storage.live_summaries import DRIVE_NUMBERS, End, PersonSummary
from webapp.study.quality import Rule

Numbers = tuple[int, ...]
Histogram = Counter[Numbers]
"""How many people gave exactly these numbers."""


class SortedNumbers:
    """Numbers in order, of which many come and few go."""

    def __init__(self) -> None:
        self._in_order: list[int] = []
        self._is_in_order = True

    def add(self, number: int) -> None:
        """Add a number; it finds its place when the order is asked for."""
        self._in_order.append(number)
        self._is_in_order = False

    def remove(self, number: int) -> None:
        """Take away one that is there."""
        in_order = self.in_order()
        del in_order[bisect_left(in_order, number)]

    def in_order(self) -> list[int]:
        """Return the numbers themselves, from the least to the largest."""
        if not self._is_in_order:
            self._in_order.sort()
            self._is_in_order = True
        return self._in_order


class Tally:
    """What the dashboard's numbers are computed from.

    Attributes:
        open: Whoever may still go on, by id: whether they are stalled depends on when one asks.
        ends: How many participants ended how.
        num_excluded: How many are excluded.
        steps: By number of funnel steps made, how many participants made just so many.
        assigned: By cell, how many participants are to see it.
        done: By cell, how many finished its trial.
        started: By arm, how many trials were started.
        finished: By arm, how many trials were finished.
        dropped: By arm, in how many trials somebody withdrew.
        uses: By experiment, arrangement and order: how many participants were given it.
        held: Likewise: how many hold their place.
        completed: Likewise: how many finished the study.
        lost: Likewise: how many withdrew or were screened out.
        times: By kind of page, the microseconds that it took.
        flagged: By rule, how many it flags; whoever may still go on is not judged by `incomplete`.
        judged: By rule, how many can be judged by it; likewise.
        num_left_window: How many left the window.
        num_with_pages: How many sent a page.
        languages: By language, how many read it.
        ratings: By place of the rating's key, how many people gave this sum in this number of ratings.
        predictions: By arm's place, how many people made so many predictions, so many right, so many as good.
        confidences: By arm's place, how many predictions have this confidence and are right (1) or not (0).
        drives: By arm's place, how many people have these numbers, see `DRIVE_NUMBERS`.
    """

    def __init__(self) -> None:
        self.open: dict[int, PersonSummary] = {}
        self.ends: Counter[End | None] = Counter()
        self.num_excluded = 0
        self.steps: Counter[int] = Counter()
        self.assigned: Counter[CellKey] = Counter()
        self.done: Counter[CellKey] = Counter()
        self.started: Counter[Arm] = Counter()
        self.finished: Counter[Arm] = Counter()
        self.dropped: Counter[Arm] = Counter()
        self.uses: Counter[tuple[str, int, int]] = Counter()
        self.held: Counter[tuple[str, int, int]] = Counter()
        self.completed: Counter[tuple[str, int, int]] = Counter()
        self.lost: Counter[tuple[str, int, int]] = Counter()
        self.times: dict[str, SortedNumbers] = {}
        self.flagged: Counter[Rule] = Counter()
        self.judged: Counter[Rule] = Counter()
        self.num_left_window = 0
        self.num_with_pages = 0
        self.languages: Counter[str] = Counter()
        self.ratings: dict[int, Histogram] = {}
        self.predictions: dict[int, Histogram] = {}
        self.confidences: dict[int, Histogram] = {}
        self.drives: dict[int, Histogram] = {}

    def add(self, person: PersonSummary) -> None:
        """Count somebody in."""
        self._count(person, 1)
        if person.end is None:
            self.open[person.id] = person
        for kind, time in _timed(person):
            self.times.setdefault(kind, SortedNumbers()).add(time)

    def remove(self, person: PersonSummary) -> None:
        """Undo `add` of the same summary."""
        self._count(person, -1)
        self.open.pop(person.id, None)
        for kind, time in _timed(person):
            self.times[kind].remove(time)

    def _count(self, person: PersonSummary, sign: int) -> None:
        self.ends[person.end] += sign
        self.num_excluded += sign * person.is_excluded
        self.steps[person.num_steps] += sign
        self.num_left_window += sign * (person.num_left_window > 0)
        self.num_with_pages += sign * (person.num_stored > 0)
        self.languages[person.language] += sign
        for flag in person.flags:
            self.flagged[flag.rule] += sign
        for rule in person.judged:
            self.judged[rule] += sign
        self._count_trials(person, sign)
        self._count_places(person, sign)
        if not person.is_excluded:
            self._count_results(person, sign)

    def _count_trials(self, person: PersonSummary, sign: int) -> None:
        plan, num_finished = person.plan, person.plan.num_finished(person.num_stored)
        for cell in plan.cells:
            self.assigned[cell] += sign
        for cell in plan.cells[:num_finished]:
            self.done[cell] += sign
        for arm in plan.arms[: person.num_started]:
            self.started[arm] += sign
        for arm in plan.arms[:num_finished]:
            self.finished[arm] += sign
        at_hand = person.trial_at_hand
        if person.end == "withdrawn" and at_hand is not None:
            self.dropped[plan.arms[at_hand]] += sign

    def _count_places(self, person: PersonSummary, sign: int) -> None:
        for place in person.places:
            self.uses[place] += sign
            self.held[place] += sign * person.holds_place
            self.completed[place] += sign * (person.end == "completed")
            self.lost[place] += sign * (person.end in ("withdrawn", "screened_out"))

    def _count_results(self, person: PersonSummary, sign: int) -> None:
        for histograms, numbers, size in (
            (self.ratings, person.ratings, 3),
            (self.predictions, person.predictions, 4),
            (self.confidences, person.confidences, 3),
            (self.drives, person.drives, DRIVE_NUMBERS),
        ):
            for start in range(0, len(numbers), size):
                histogram = histograms.setdefault(numbers[start], Counter())
                gave = tuple(numbers[start + 1 : start + size])
                histogram[gave] += sign
                if not histogram[gave]:
                    del histogram[gave]


def quantile(in_order: Sequence[int], share: float) -> float:
    """Return a quantile by linear interpolation between the nearest two of at least one sorted number."""
    place = share * (len(in_order) - 1)
    below = int(place)
    above = min(below + 1, len(in_order) - 1)
    return in_order[below] + (place - below) * (in_order[above] - in_order[below])


def _timed(person: PersonSummary) -> Iterator[tuple[str, int]]:
    """Yield kind and microseconds of the pages whose time counts."""
    for place in range(0, len(person.times), 2):
        yield person.plan.page_kinds[person.times[place] - 1], person.times[place + 1]
