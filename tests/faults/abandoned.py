"""Let people stop half-way and some come back late: their places go to others, and the arms stay balanced (F14).

    python -m tests.faults.abandoned [--full] [--rounds 1] [--people 48]

Of those who agree, 30 % stop at a page of their own. An hour later, by a clock that the test sets, newcomers fill their
places, of whom 30 % stop too, and so on until as many have finished as were wanted. Then one in ten of all comes back
late and finishes, and newcomers even out what that unbalanced. `--full` is 10 rounds of 48 people for each design.
"""

import argparse
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from unittest import mock

from tests.faults.assignment import KINDS
from tests.faults.oracle import evidence
from tests.web.bundles import FILLED_IN, write_bundle
from tests.web.people import Clock, Visitor, filled
from tests.web.reading import ask, place
from tests.web.studies import a_study, one_experiment
from webapp.app import create_app
from webapp.storage import answer_rows, enrolment
from webapp.storage.verification import verify_log
from webapp.views.services import services_of

DESIGNS = {2: (2, 1), 6: (3, 3), 24: (4, 3)}
"""By the number of cells: of how many kinds and layouts it is the number of arrangements."""

STOPPING, LATE = 0.3, 0.1
SURPLUS = 5
_CELL = "SELECT participant_id, arrangement FROM arrangements ORDER BY participant_id DESC LIMIT 1"
_SHOWN = "SELECT arrangement, layout_order FROM arrangements WHERE participant_id = ?"
_TRIALS = "SELECT * FROM trials WHERE participant_id = ? ORDER BY number"
_EVENTS = "SELECT action, count(*) FROM records WHERE action IN ('slot_released', 'slot_resumed') GROUP BY action"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of it; sums over rounds, but for the spreads.

    Attributes:
        num_people: How many agreed.
        num_stopped: How many stopped half-way.
        num_late: How many of these came back late, and finished.
        refilled_spread: By how many the fullest and the emptiest cell differed at most, of those who had finished.
        final_spread: The same after the late ones, and newcomers to even them out.
        num_refused: How many found all places taken, where there is a quota.
        over_allocated: How many finished beyond the quota.
        num_changed: How many late ones were shown anything else than before.
        num_released: How many places were given back; one for everybody who stopped.
        num_resumed: How many of them were taken again; one for everybody who came late.
        num_problems: What is wrong with the chain of records.
    """

    num_people: int = 0
    num_stopped: int = 0
    num_late: int = 0
    refilled_spread: int = 0
    final_spread: int = 0
    num_refused: int = 0
    over_allocated: int = 0
    num_changed: int = 0
    num_released: int = 0
    num_resumed: int = 0
    num_problems: int = 0

    @property
    def is_clean(self) -> bool:
        """Whether everything is as promised."""
        is_even = self.refilled_spread <= 1 and self.final_spread <= 1 and self.over_allocated <= self.num_late
        is_once = self.num_released <= self.num_stopped and self.num_resumed <= self.num_late
        return is_even and is_once and self.num_changed == self.num_problems == 0

    @property
    def is_complete(self) -> bool:
        """Whether everybody who stopped lost the place, and everybody who came late has it again."""
        return self.num_released == self.num_stopped and self.num_resumed == self.num_late

    def __add__(self, other: "Outcome") -> "Outcome":
        worst = {"refilled_spread", "final_spread"}
        mine, theirs = self.to_json(), other.to_json()
        return Outcome(
            *((max if name in worst else lambda *both: sum(both))(mine[name], theirs[name]) for name in self.__slots__)
        )

    def to_json(self) -> dict[str, int]:
        """Return the counts by name."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass
class _Person:
    number: int
    cell: int
    visitor: Visitor
    stops_before: int | None
    next_page: int = 1


@dataclass
class _Study:
    """A study with a clock that is set, and everybody who takes part in it."""

    instance: Path
    num_cells: int
    rng: random.Random
    quota: int | None = None
    num_refused: int = 0
    clock: Clock = field(default_factory=Clock)
    finished: list[_Person] = field(default_factory=list)
    stopped: list[_Person] = field(default_factory=list)

    def __post_init__(self) -> None:
        num_kinds, num_layouts = DESIGNS[self.num_cells]
        experiments = one_experiment(list(KINDS[:num_kinds]), num_layouts, layout_order="fixed")
        write_bundle(self.instance, a_study(experiments=experiments, quota=self.quota, **FILLED_IN))
        self.num_pages = 1 + 2 * num_layouts
        self.app = create_app(replace(place(self.instance), live=self.quota is not None), clock=self.clock)

    def arrive(self, num_people: int, *, may_stop: bool = True) -> None:
        """Let people agree, one after the other, while those who did before answer; in the end all are through."""
        here: list[_Person] = []
        while num_people or here:
            if num_people and self.rng.random() < 0.5:
                num_people -= 1
                here += self._newcomers(may_stop=may_stop)
            elif here:
                person = self.rng.choice(here)
                if self._goes_on(person):
                    here.remove(person)

    def late(self, people: Sequence[_Person]) -> int:
        """Let people come back and finish; return how many were shown anything else than before."""
        num_changed = 0
        for person in people:
            trials, shown = ask(self.instance, _TRIALS, person.number), ask(self.instance, _SHOWN, person.number)
            assert person.visitor.place() == f"/study/{person.next_page}"
            self.stopped.remove(person)
            person.stops_before = None
            while not self._goes_on(person):
                pass
            after = ask(self.instance, _TRIALS, person.number), ask(self.instance, _SHOWN, person.number)
            num_changed += after != (trials, shown)
        return num_changed

    def counts(self) -> list[int]:
        """Return by cell how many have finished."""
        counted = Counter(person.cell for person in self.finished)
        return [counted[cell] for cell in range(self.num_cells)]

    @property
    def num_missing(self) -> int:
        """How many have to finish until all cells are as full as the fullest."""
        return self.num_cells * max(self.counts()) - len(self.finished)

    @property
    def spread(self) -> int:
        """By how many the fullest and the emptiest cell differ."""
        return max(self.counts()) - min(self.counts())

    def _newcomers(self, *, may_stop: bool) -> list[_Person]:
        """Let somebody agree; nobody comes of it if all places are taken."""
        visitor = Visitor(self.app)
        status = visitor.agree().status_code
        if self.quota is not None and status == 503:
            self.num_refused += 1
            return []
        assert status == 303
        ((number, cell),) = ask(self.instance, _CELL)
        assert isinstance(number, int)
        assert isinstance(cell, int)
        stops = may_stop and self.rng.random() < STOPPING
        return [_Person(number, cell, visitor, self.rng.randint(1, self.num_pages) if stops else None)]

    def _goes_on(self, person: _Person) -> bool:
        """Let somebody send the next page, or stop; tell whether nothing more is to come."""
        if person.next_page == person.stops_before:
            self.stopped.append(person)
            return True
        form = filled(person.next_page, person.visitor.nonce(person.next_page))
        assert person.visitor.post(f"/study/{person.next_page}", form).status_code == 303
        person.next_page += 1
        if person.next_page <= self.num_pages:
            return False
        assert person.visitor.place() == "/done"
        self.finished.append(person)
        return True


def abandon_and_refill(instance: Path, num_cells: int, num_people: int, seed: int, *, has_quota: bool) -> Outcome:
    """Let people stop, refill their places, and let some come back late.

    Args:
        instance: Where to make the instance.
        num_cells: One of `DESIGNS`.
        num_people: How many are to finish before anybody comes late.
        seed: Of who stops where, and who comes back.
        has_quota: Whether the study has so many places, and more people come than that; nobody evens out then.
    """
    study = _Study(instance, num_cells, random.Random(seed), num_people if has_quota else None)
    surplus = SURPLUS if has_quota else 0
    try:
        while len(study.finished) < num_people:
            study.arrive(num_people - len(study.finished) + surplus)
            study.clock.wait(minutes=61)
        refilled, num_stopped = study.spread, len(study.stopped)
        if not has_quota:
            study.arrive(1, may_stop=False)  # The last to stop have kept their places, since nobody came after them.
        num_late = min(num_stopped, round(LATE * (num_stopped + len(study.finished))))
        num_changed = study.late(study.rng.sample(study.stopped, num_late))
        study.arrive(surplus if has_quota else study.num_missing, may_stop=False)
        over_allocated = len(study.finished) - num_people if has_quota else 0
        events = {str(action): int(str(number)) for action, number in ask(instance, _EVENTS)}
        problems = verify_log(services_of(study.app).database).problems
    finally:
        services_of(study.app).database.close()
    return Outcome(
        num_stopped + len(study.finished) - num_late,
        num_stopped,
        num_late,
        refilled,
        0 if has_quota else study.spread,
        study.num_refused,
        over_allocated,
        num_changed,
        events.get("slot_released", 0),
        events.get("slot_resumed", 0),
        len(problems),
    )


@contextmanager
def never_freed() -> Iterator[None]:
    """As a control, keep the places of those who stopped."""
    with mock.patch.object(enrolment, "release_abandoned"):
        yield


@contextmanager
def never_taken_again() -> Iterator[None]:
    """As a control, count nobody who came back late."""
    with mock.patch.object(answer_rows, "resume_slot"):
        yield


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if the arms stayed balanced, and those of the controls did not."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="10 rounds of 48 people")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--people", type=int, default=24)
    options = parser.parse_args(arguments)
    num_rounds, num_people = (10, 48) if options.full else (options.rounds, options.people)
    with tempfile.TemporaryDirectory() as scratch:

        def rounds(name: str, num_cells: int, number: int, *, has_quota: bool = False) -> Outcome:
            seeds = range(1, number + 1)
            tries = [(Path(scratch, f"{name}-{num_cells}-{seed}"), seed) for seed in seeds]
            outcomes = (
                abandon_and_refill(folder, num_cells, num_people, seed, has_quota=has_quota) for folder, seed in tries
            )
            return sum(outcomes, Outcome())

        found = {f"{cells} cells": rounds("real", cells, num_rounds) for cells in DESIGNS}
        limited = {f"{cells} cells, quota": rounds("quota", cells, num_rounds, has_quota=True) for cells in DESIGNS}
        with never_freed():
            kept = rounds("kept", 6, 3)
        with never_taken_again():
            forgotten = rounds("forgotten", 6, 3)
    both = found | limited
    print(
        evidence(
            "F14 abandoned places",
            {name: outcome.to_json() for name, outcome in both.items()},
            wanted=num_people,
            seeds=[1, num_rounds],
            control={"never freed": kept.to_json(), "late ones not counted again": forgotten.to_json()},
        )
    )
    is_clean = all(outcome.is_clean for outcome in both.values())
    is_complete = all(outcome.is_complete for outcome in found.values())
    is_noticed = kept.refilled_spread > 1 and forgotten.final_spread > 1
    return 0 if is_clean and is_complete and is_noticed else 1


if __name__ == "__main__":
    sys.exit(main())
