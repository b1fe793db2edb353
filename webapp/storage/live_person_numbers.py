"""What the dashboard shows of one participant: a line in the list, and the page behind it."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from webapp.storage.live_numbers import State
from webapp.storage.people import Exclusion
from webapp.study.quality import Flag


@dataclass(frozen=True, slots=True)
class PersonLine:
    """One participant in the list.

    Attributes:
        code: The participant's public code.
        state: Where they are.
        progress: The number of pages sent.
        num_pages: The number of pages there are.
        consented_at: The time of the consent.
        last_seen: The time of the latest thing that the participant sent.
        minutes: From the consent to the latest thing sent.
        flags: The names of the declared rules that flag them.
        excluded: Present if a researcher excluded them.
        is_late: Whether they came back after their place was given to others.
    """

    code: str
    state: State
    progress: int
    num_pages: int
    consented_at: datetime
    last_seen: datetime
    minutes: float
    flags: tuple[str, ...]
    excluded: Exclusion | None
    is_late: bool


@dataclass(frozen=True, slots=True)
class PeoplePage:
    """A page of the list, the latest arrivals first.

    Attributes:
        lines: The participants on it.
        num_found: How many there are on all pages.
        page: Its number, from 1; the last one where a later one was asked for.
        num_pages: How many there are, at least 1.
    """

    lines: tuple[PersonLine, ...]
    num_found: int
    page: int
    num_pages: int


@dataclass(frozen=True, slots=True)
class PageVisit:
    """One page that was sent.

    Attributes:
        number: From 1.
        kind: What stands on it.
        trial: The number of its trial, from 1; None before the trials.
        submitted_at: When it was sent.
        seconds: Since the page before it, or since the consent.
        was_away: Whether that is longer than the lease, so that it is no time of working.
        num_left_window: How often the window was left.
        away_s: For how long altogether, in seconds, as far as the browser saw it come back.
    """

    number: int
    kind: str
    trial: int | None
    submitted_at: datetime
    seconds: float
    was_away: bool
    num_left_window: int
    away_s: float


@dataclass(frozen=True, slots=True)
class PersonTrial:
    """One trial of a person.

    Attributes:
        number: From 1, over all experiments.
        experiment: The experiment's id.
        position: The place within the experiment, from 1.
        layout: The layout's name.
        kind: The kind of explanation; None while blind.
        draw: Which draw of the random kind is shown; None for other kinds and while blind.
        first_page: The number of its first page; None while blind, because arms differ in their pages.
        is_done: Whether its last page was sent.
    """

    number: int
    experiment: str
    position: int
    layout: str
    kind: str | None
    draw: int | None
    first_page: int | None
    is_done: bool


@dataclass(frozen=True, slots=True)
class GivenRating:
    """One rating.

    Attributes:
        page: The page's number.
        trial: The trial's number.
        item: The item's id.
        rating: From 1.
        response_time_ms: From the first paint to the last change; None where it was not measured.
    """

    page: int
    trial: int
    item: str
    rating: int
    response_time_ms: int | None


@dataclass(frozen=True, slots=True)
class GivenPrediction:
    """One prediction.

    Attributes:
        page: The page's number.
        trial: The trial's number.
        question: The question's place on the page, from 1.
        predicted: The action that the participant chose.
        action: What the agent does.
        is_correct: Whether the two are the same.
        is_as_good: Whether the goal can be reached as fast with the chosen one.
        confidence: From 1 to 5.
        response_time_ms: None where it was not measured.
    """

    page: int
    trial: int
    question: int
    predicted: str
    action: str
    is_correct: bool
    is_as_good: bool
    confidence: int
    response_time_ms: int | None


@dataclass(frozen=True, slots=True)
class GivenDrive:
    """One finished drive.

    Attributes:
        page: The page's number.
        trial: The trial's number; None for the practice.
        phase: `practice`, `before` or `after`.
        end: `reached`, `gave_up`, `step_limit` or `failed`.
        num_steps: How many actions were taken.
        optimum: The fewest that would have done.
        step_limit: How many there were.
        subgoals_passed: Which subgoals of the agent's path the drive passed, by step; empty while blind.
    """

    page: int
    trial: int | None
    phase: str
    end: str
    num_steps: int
    optimum: int
    step_limit: int
    subgoals_passed: Sequence[int]


@dataclass(frozen=True, slots=True)
class GivenAnswer:
    """One answer that is no rating of an explanation: background, quiz or attention check.

    Attributes:
        page: The page's number.
        purpose: `background`, `quiz` or `attention`.
        attempt: Which attempt at the page, from 1.
        question: The question's id.
        answer: What was answered.
        is_correct: None where nothing is right or wrong.
        submitted_at: When.
    """

    page: int
    purpose: str
    attempt: int
    question: str
    answer: str
    is_correct: bool | None
    submitted_at: datetime


@dataclass(frozen=True, slots=True)
class PersonNumbers:
    """Everything about one participant.

    Attributes:
        line: What stands in the list.
        id: The row's number, for other queries; it never leaves the server.
        language: The code of the language read.
        withdrawn_at: When they left; None for everyone else.
        completed_at: When the last page was stored; None before.
        screened_out_at: When the quiz ended the study; None for everyone else.
        flags: The declared rules that flag them, with values and limits.
        pages: The pages sent, in order.
        trials: In order.
        ratings: In order of pages, then items.
        predictions: In order.
        drives: In order.
        answers: In order of pages and attempts. Background answers are among them.
        num_left_window: How often the window was left, on all pages.
        away_s: For how long altogether, in seconds.
    """

    line: PersonLine
    id: int
    language: str
    withdrawn_at: datetime | None
    completed_at: datetime | None
    screened_out_at: datetime | None
    flags: tuple[Flag, ...]
    pages: tuple[PageVisit, ...]
    trials: tuple[PersonTrial, ...]
    ratings: tuple[GivenRating, ...]
    predictions: tuple[GivenPrediction, ...]
    drives: tuple[GivenDrive, ...]
    answers: tuple[GivenAnswer, ...]
    num_left_window: int
    away_s: float
