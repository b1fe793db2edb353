"""Answers that are no ratings, from a form to what is stored: background, quiz, attention checks, predictions."""

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

from webapp.study.answers import PREFER_NOT_TO_SAY, Answer, Prediction
from webapp.study.experiments import Item
from webapp.study.questionnaire import Ratings, measured_time, rating_field
from webapp.study.sections import ATTENTION_POINTS, MAX_TEXT_LENGTH, AttentionCheck, BackgroundQuestion, QuizQuestion

CONFIDENCE_POINTS = 5

_Question = TypeVar("_Question")
_Read = TypeVar("_Read", Answer, Prediction)

Reason = Literal["missing", "invalid", "too_long"]


@dataclass(frozen=True, slots=True)
class FieldProblem:
    """A question whose answer cannot be stored.

    Attributes:
        field: The name of the form field.
        reason: `missing`: nothing was answered. `invalid`: what came is no possible answer. `too_long`: too many
            characters.
    """

    field: str
    reason: Reason


class Asked(Protocol):
    """One state that a participant is asked about: what will the agent do next?"""

    @property
    def state(self) -> int:
        """An index into the layout's table."""

    @property
    def action(self) -> str:
        """What the agent does."""

    @property
    def as_good(self) -> Sequence[str]:
        """Every action from which the goal is reached in as few steps."""


def answer_field(question_id: str) -> str:
    """Return the name of the form field that holds the answer to a question."""
    return f"answer-{question_id}"


def refusal_field(question_id: str) -> str:
    """Return the name of the box with which somebody prefers not to answer an open question."""
    return f"refuse-{question_id}"


def prediction_field(number: int) -> str:
    """Return the name of the form field that holds the predicted action of a question, from 1."""
    return f"predict-{number}"


def confidence_item(number: int) -> Item:
    """Return the rating of the confidence in a prediction."""
    return Item(id=f"confidence-{number}", points=CONFIDENCE_POINTS)


def check_item(check: AttentionCheck) -> Item:
    """Return an attention check as the rating that it looks like."""
    return Item(id=check.id, points=ATTENTION_POINTS)


def parse_background(
    form: Mapping[str, str], questions: Sequence[BackgroundQuestion]
) -> tuple[Answer, ...] | tuple[FieldProblem, ...]:
    """Read the answers to the background questions; each is answered, or the participant prefers not to say."""
    return _all_or_problems(questions, lambda question: _background_answer(form, question))


def parse_quiz(
    form: Mapping[str, str], questions: Sequence[QuizQuestion]
) -> tuple[Answer, ...] | tuple[FieldProblem, ...]:
    """Read the answers to a quiz, right or wrong; only choices that are offered count as answers."""
    return _all_or_problems(questions, lambda question: _quiz_answer(form, question))


def check_answers(ratings: Ratings, checks: Sequence[AttentionCheck]) -> tuple[Answer, ...]:
    """Take the attention checks out of the ratings among which they stand."""
    return tuple(
        Answer(check.id, str(ratings.values[check.id]), ratings.values[check.id] == check.answer) for check in checks
    )


def without_checks(ratings: Ratings, checks: Sequence[AttentionCheck]) -> Ratings:
    """Return the ratings alone."""
    ids = {check.id for check in checks}
    return Ratings(
        values={item: value for item, value in ratings.values.items() if item not in ids},
        response_times={item: time for item, time in ratings.response_times.items() if item not in ids},
    )


def parse_predictions(
    form: Mapping[str, str], asked: Sequence[Asked], actions: Sequence[str], confidences: Mapping[str, int]
) -> tuple[Prediction, ...] | tuple[FieldProblem, ...]:
    """Read the predicted actions and score them.

    Args:
        form: The form's fields.
        asked: What was asked, in the order of the questions.
        actions: The actions to choose from.
        confidences: The confidence in each answer, by the id of `confidence_item`; a prediction without is a problem.
    """

    def read(number: int) -> Prediction | FieldProblem:
        field = prediction_field(number)
        predicted = form.get(field, "").strip()
        if predicted not in actions:
            return FieldProblem(field, "invalid" if predicted else "missing")
        question, sureness = asked[number - 1], confidence_item(number).id
        if sureness not in confidences:
            return FieldProblem(rating_field(sureness), "missing")
        return Prediction(
            question=number,
            state=question.state,
            predicted=predicted,
            action=question.action,
            is_correct=predicted == question.action,
            is_as_good=predicted in question.as_good,
            confidence=confidences[sureness],
            response_time_ms=measured_time(form.get(f"time-{field}", "")),
        )

    return _all_or_problems(range(1, len(asked) + 1), read)


def _all_or_problems(
    questions: Sequence[_Question], read: Callable[[_Question], _Read | FieldProblem]
) -> tuple[_Read, ...] | tuple[FieldProblem, ...]:
    found = [read(question) for question in questions]
    problems = tuple(entry for entry in found if isinstance(entry, FieldProblem))
    return problems or tuple(entry for entry in found if not isinstance(entry, FieldProblem))


def _background_answer(form: Mapping[str, str], question: BackgroundQuestion) -> Answer | FieldProblem:
    field = answer_field(question.id)
    # No keyboard gives a NUL, and programs that read the data stumble over it.
    text = form.get(field, "").replace("\0", "").strip()
    if form.get(refusal_field(question.id)) == "yes" or text == PREFER_NOT_TO_SAY:
        return Answer(question.id, PREFER_NOT_TO_SAY)
    if not text:
        return FieldProblem(field, "missing")
    if question.type == "choice" and text not in question.choices:
        return FieldProblem(field, "invalid")
    if question.type == "number":
        text = unicodedata.normalize("NFKC", text)  # Japanese keyboards write full-width digits.
        if not re.fullmatch(r"-?[0-9]{1,9}", text) or not question.minimum <= int(text) <= question.maximum:
            return FieldProblem(field, "invalid")
        text = str(int(text))
    if len(text) > MAX_TEXT_LENGTH:
        return FieldProblem(field, "too_long")
    return Answer(question.id, text)


def _quiz_answer(form: Mapping[str, str], question: QuizQuestion) -> Answer | FieldProblem:
    field = answer_field(question.id)
    text = form.get(field, "").strip()
    if text not in question.choices:
        return FieldProblem(field, "invalid" if text else "missing")
    return Answer(question.id, text, text == question.answer)
