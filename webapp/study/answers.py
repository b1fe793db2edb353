"""What a participant sends with a page, parsed: ratings, answers, predictions, drives and events."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from webapp.study.questionnaire import Ratings

PREFER_NOT_TO_SAY = "prefer_not_to_say"
"""The answer of somebody who would rather not answer; offered with every background question."""

DriveEnd = Literal["reached", "gave_up", "step_limit", "failed"]
"""How a drive ended: at the goal, by the participant's wish, when no action was left, or at an end that is no goal."""


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer that is no rating of an explanation.

    Attributes:
        question: The question's id in the study file.
        answer: The choice's id, the number, the participant's own words, or `PREFER_NOT_TO_SAY`.
        is_correct: For a quiz or an attention check whether it is right; None where nothing is right or wrong.
    """

    question: str
    answer: str
    is_correct: bool | None = None


@dataclass(frozen=True, slots=True)
class Prediction:
    """An answer to "what will the agent do next?".

    Attributes:
        question: The question's place on the page, from 1.
        state: The state asked about, an index into the layout's table.
        predicted: The action the participant chose.
        action: The action that the agent's policy takes.
        is_correct: Whether the two are the same.
        is_as_good: Whether the goal can be reached from there in as few steps with the chosen action.
        confidence: From 1 to 5.
        response_time_ms: From the first paint to the last change of the action; None where it was not measured.
    """

    question: int
    state: int
    predicted: str
    action: str
    is_correct: bool
    is_as_good: bool
    confidence: int
    response_time_ms: int | None

    def __post_init__(self) -> None:
        if self.is_correct != (self.predicted == self.action):
            raise ValueError(f"{self.predicted!r} and {self.action!r} do not fit with is_correct = {self.is_correct}")


@dataclass(frozen=True, slots=True)
class DriveStep:
    """One action of a drive.

    Attributes:
        number: From 1.
        action: Its name.
        elapsed_ms: Milliseconds since the first paint of the page; None where it was not measured.
    """

    number: int
    action: str
    elapsed_ms: int | None


@dataclass(frozen=True, slots=True)
class DriveResult:
    """How a drive went.

    Attributes:
        phase: `practice`; `before` the explanation; `after` it.
        layout: The layout's name.
        end: How it ended.
        num_steps: How many actions were taken.
        optimum: The fewest actions that would have done.
        step_limit: How many actions there were.
        subgoals_passed: The subgoals whose state and action occur in the drive, as steps of the agent's path.
        key_points: The subgoals that a drive that did not arrive misses; empty for one that did.
    """

    phase: Literal["practice", "before", "after"]
    layout: str
    end: DriveEnd
    num_steps: int
    optimum: int
    step_limit: int
    subgoals_passed: Sequence[int]
    key_points: Sequence[int]

    def __post_init__(self) -> None:
        if not 0 <= self.num_steps <= self.step_limit:
            raise ValueError(f"a drive has from 0 to {self.step_limit} steps, not {self.num_steps}")
        if self.end == "reached" and self.key_points:
            raise ValueError(f"a drive that arrived misses nothing, and these are key points: {self.key_points}")


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened in the browser while a page was open.

    Attributes:
        name: One of `webapp.study.events.EVENTS`.
        target: What it happened to, such as an item or the number of a picture; empty for the page.
        value: What came of it; empty where there is nothing to say.
        at_ms: Milliseconds since the first paint of the page, on the browser's own clock.
    """

    name: str
    target: str
    value: str
    at_ms: int


@dataclass(frozen=True, slots=True)
class PageContent:
    """Everything that is stored with a page.

    Attributes:
        ratings: Of a rating or a satisfaction page.
        answers: To questions that are no ratings.
        attempt: Which attempt at the page the answers belong to, from 1.
        predictions: Of a probe page.
        drive: The result of a drive.
        events: What happened in the browser.
        is_final: False where an attempt failed and the page stays due.
        failed: Whether a quiz was not passed, and no attempt is left.
        screens_out: Whether the study ends here for the participant.
    """

    ratings: Ratings | None = None
    answers: Sequence[Answer] = ()
    attempt: int = 1
    predictions: Sequence[Prediction] = ()
    drive: DriveResult | None = None
    events: Sequence[Event] = ()
    is_final: bool = True
    failed: bool = False
    screens_out: bool = False
