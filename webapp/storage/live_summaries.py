"""What is kept of each participant: little enough that ten thousand of them take a few megabytes.

Numbers stand in arrays, several to an entry; what many participants share, they hold together.
"""

from array import array
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Literal

from webapp.storage.live_numbers import State
from webapp.storage.live_plans import Plan
from webapp.study.quality import Flag, Rule

End = Literal["completed", "withdrawn", "screened_out"]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


@dataclass(frozen=True, slots=True)
class PersonSummary:
    """One participant, as far as the dashboard's numbers depend on them.

    Attributes:
        id: The row's number.
        code: The public code.
        language: The code of the language read.
        plan: The trials, with the pages that follow.
        places: What allocation gave: experiment, arrangement and order, for each experiment.
        num_stored: The number of pages sent.
        num_pages: The number of pages there are.
        consented: The time of the consent, in microseconds since 1970.
        last_seen: The time of the latest sign of life, likewise.
        end: How the study ended; None for whoever may still go on.
        holds_place: Whether the place counts for the balance.
        is_late: Whether they came back after it was given to others.
        is_excluded: Whether a researcher excluded them, so that their answers stay out of the results.
        times: Two numbers for each page that counts for the time per page: its number and its microseconds.
        num_left_window: How often they left the window, on pages that they sent.
        ratings: Three numbers for each item in each arm: the place of its key, the sum, and how many.
        predictions: Four numbers for each arm: the arm's place, how many, how many right, how many as good.
        confidences: Three numbers for each prediction: the arm's place, the confidence, and 1 if it is right, else 0.
        drives: Nine numbers for each arm, see `DRIVE_NUMBERS`.
        flags: The declared rules that flag them; `incomplete` is missing for whoever may still go on.
        judged: The declared rules by which they can be judged; likewise.
    """

    id: int
    code: str
    language: str
    plan: Plan
    places: tuple[tuple[str, int, int], ...]
    num_stored: int
    num_pages: int
    consented: int
    last_seen: int
    end: End | None
    holds_place: bool
    is_late: bool
    is_excluded: bool
    times: "array[int]"
    num_left_window: int
    ratings: "array[int]"
    predictions: "array[int]"
    confidences: "array[int]"
    drives: "array[int]"
    flags: tuple[Flag, ...]
    judged: tuple[Rule, ...]

    def state(self, silent_before: int) -> State:
        """Say where they are.

        Args:
            silent_before: In microseconds since 1970; whoever gave no sign of life since then is stalled.
        """
        if self.end is not None:
            return self.end
        if self.last_seen < silent_before:
            return "stalled"
        return "in_progress" if self.num_stored else "consented"

    @property
    def trial_at_hand(self) -> int | None:
        """The trial that was started and not finished, from 0; None before the trials and after them."""
        started = self.num_started
        return started - 1 if started > self.plan.num_finished(self.num_stored) else None

    @property
    def num_started(self) -> int:
        """How many trials they reached."""
        return 0 if self.end == "screened_out" else self.plan.num_started(self.num_stored)

    @property
    def num_steps(self) -> int:
        """How many steps of the funnel they made, the consent included."""
        milestones = self.plan.milestones
        made = sum(self.num_stored >= page for page in milestones)
        if self.end == "screened_out" and self.plan.quiz_page is not None:
            made = sum(page < self.plan.quiz_page for page in milestones)
        return 1 + made + (self.end == "completed")


DRIVE_NUMBERS = 9
"""The arm's place; before the explanation how many drives, how many reached the goal, and with how many extra steps;
the same after it; in how many trials both, and the sum of their gains, each -1, 0 or 1."""


def microseconds(time: datetime) -> int:
    """Return a time as whole microseconds since 1970."""
    return (time - _EPOCH) // _MICROSECOND


def to_time(since_1970: int) -> datetime:
    """Return the time that is so many microseconds after the beginning of 1970."""
    return _EPOCH + since_1970 * _MICROSECOND
