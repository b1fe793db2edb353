"""From a sent form to what it says, and back to the fields that a page shows."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from webapp.study.answers import PREFER_NOT_TO_SAY, Answer
from webapp.study.experiments import Item
from webapp.study.question_forms import FieldProblem, answer_field, refusal_field
from webapp.study.questionnaire import RatingProblem, rating_field
from webapp.study.sections import BackgroundQuestion, QuizQuestion
from webapp.study.session import Page, decide
from webapp.study.texts import ItemTexts, Texts
from webapp.views.tokens import same
from webapp.views.visit import Visit

Refusal = Literal["already_answered", "too_early", "stale"]
"""Why a page is not even looked at; also the name of the notice."""

_RATING_REASONS = {"missing": "errors.rating_missing", "invalid": "errors.rating_invalid"}
_QUESTION_REASONS = {
    "missing": "errors.answer_missing",
    "invalid": "errors.answer_invalid",
    "too_long": "errors.answer_too_long",
}


@dataclass(frozen=True, slots=True)
class FormError:
    """One line of the error summary.

    Attributes:
        control: The id of the control to mend.
        message: What to do.
    """

    control: str
    message: str


@dataclass(frozen=True, slots=True)
class RatingField:
    """One question of the rating kind as a page shows it.

    Attributes:
        id: The item's id.
        legend: The question.
        points: The number of answers to choose from.
        low: What the lowest means.
        high: What the highest means.
        value: The answer already given on this page, or None.
        error: What is wrong with it, or None.
        labels: A label for every point; empty where only the ends have one.
    """

    id: str
    legend: str
    points: int
    low: str
    high: str
    value: int | None
    error: str | None
    labels: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class QuestionField:
    """One question with choices, or an open one, as a page shows it.

    Attributes:
        name: The name of the form field, and the beginning of its controls' ids.
        type: `choice`, `number` or `text`.
        legend: The question.
        choices: What can be chosen, as value and label.
        value: The answer already given on this page; empty for none.
        refusal: The name of the box with which an open question is not answered; empty where there is none.
        is_refused: Whether that box was ticked.
        error: What is wrong with the answer, or None.
        feedback: What is said about an earlier answer, or None.
        is_right: Whether the earlier answer was right; None where there is none.
    """

    name: str
    type: str
    legend: str
    choices: Sequence[tuple[str, str]]
    value: str = ""
    refusal: str = ""
    is_refused: bool = False
    error: str | None = None
    feedback: str | None = None
    is_right: bool | None = None

    @property
    def control(self) -> str:
        """The id of the control that an error leads to."""
        return f"{self.name}-1" if self.choices else self.name


def consent_nonce(form: Mapping[str, str]) -> str | None:
    """Return the nonce of the welcome page that was sent, or None if it has none."""
    nonce = form.get("nonce", "")
    return nonce if re.fullmatch(r"[0-9a-f]{32}", nonce) else None


def refusal_of(form: Mapping[str, str], visit: Visit, page: Page, attempt: int) -> Refusal | None:
    """Say why a sent page is not to be stored, or None if it is this page's turn.

    The nonce shows that the page was shown to this very participant: what an earlier visitor left open in another
    window of the same browser is not this participant's answer.

    Args:
        form: The form's fields.
        visit: Who sent it.
        page: The page.
        attempt: Which attempt at the page is due, from 1.
    """
    decision = decide(page.number, visit.participant.num_stored, visit.participant.num_pages)
    if decision == "too_early":
        return "too_early"
    nonce = form.get("nonce", "")
    if any(same(nonce, visit.nonce(page, earlier)) for earlier in range(1, attempt)):
        return "already_answered"
    if not same(nonce, visit.nonce(page, attempt)):
        return "stale"
    return None if decision == "accept" else "already_answered"


def rating_field_of(
    form: Mapping[str, str], item: Item, wording: ItemTexts, reason: str | None, t: Texts, labels: Sequence[str] = ()
) -> RatingField:
    """Return a question of the rating kind, with the answer that a sent form has given already."""
    error = None if reason is None else t(_RATING_REASONS[reason], legend=wording.legend)
    given = form.get(rating_field(item.id), "").strip()
    value = int(given) if reason is None and given.isascii() and given.isdigit() else None
    return RatingField(item.id, wording.legend, item.points, wording.low, wording.high, value, error, labels)


def rating_errors(fields: Sequence[RatingField]) -> list[FormError]:
    """Return the lines of the error summary for ratings."""
    return [FormError(f"{rating_field(field.id)}-1", field.error) for field in fields if field.error is not None]


def rating_reasons(problems: Sequence[RatingProblem]) -> Mapping[str, str]:
    """Return by item what is wrong with it."""
    return {problem.item: problem.reason for problem in problems}


def question_errors(fields: Sequence[QuestionField]) -> list[FormError]:
    """Return the lines of the error summary for other questions."""
    return [FormError(field.control, field.error) for field in fields if field.error is not None]


def background_fields(
    form: Mapping[str, str], questions: Sequence[BackgroundQuestion], problems: Sequence[FieldProblem], t: Texts
) -> list[QuestionField]:
    """Return the background questions, with the answers that a sent form has given already."""
    refuse = (PREFER_NOT_TO_SAY, t("background.prefer_not_to_say"))
    fields = []
    for question in questions:
        name, refusal = answer_field(question.id), refusal_field(question.id)
        legend = t(f"background.{question.id}.question")
        choices = [(choice, t(f"background.{question.id}.choices.{choice}")) for choice in question.choices]
        is_open = question.type != "choice"
        fields.append(
            QuestionField(
                name=name,
                type=question.type,
                legend=legend,
                choices=() if is_open else (*choices, refuse),
                value=form.get(name, ""),
                refusal=refusal if is_open else "",
                is_refused=form.get(refusal) == "yes",
                error=question_error(name, legend, problems, t),
            )
        )
    return fields


def quiz_fields(
    form: Mapping[str, str],
    questions: Sequence[QuizQuestion],
    problems: Sequence[FieldProblem],
    earlier: Mapping[str, Answer],
    t: Texts,
) -> list[QuestionField]:
    """Return the questions of a quiz; after a failed attempt with what was right in it and feedback on the rest."""
    fields = []
    for question in questions:
        name, before = answer_field(question.id), earlier.get(question.id)
        legend = t(f"quiz.{question.id}.question")
        is_right = None if before is None else before.is_correct
        kept = before.answer if before is not None and is_right else ""
        feedback = None
        if before is not None:
            feedback = t("quiz.right") if is_right else t(f"quiz.{question.id}.feedback")
        fields.append(
            QuestionField(
                name=name,
                type="choice",
                legend=legend,
                choices=[(choice, t(f"quiz.{question.id}.choices.{choice}")) for choice in question.choices],
                value=form.get(name, kept),
                error=question_error(name, legend, problems, t),
                feedback=feedback,
                is_right=is_right,
            )
        )
    return fields


def question_error(name: str, legend: str, problems: Sequence[FieldProblem], t: Texts) -> str | None:
    """Return what is wrong with a question, in words, or None."""
    for problem in problems:
        if problem.field == name:
            return t(_QUESTION_REASONS[problem.reason], legend=legend)
    return None
