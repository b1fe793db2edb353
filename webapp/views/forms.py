"""From a sent form to what it says."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from webapp.study.protocol import Item
from webapp.study.questionnaire import RatingProblem, rating_field
from webapp.study.session import Page, decide
from webapp.study.texts import Texts
from webapp.views.tokens import same
from webapp.views.visit import Visit

Refusal = Literal["already_answered", "too_early", "stale"]
"""Why a page is not even looked at; also the name of the notice."""


_REASONS = {"missing": "errors.rating_missing", "invalid": "errors.rating_invalid"}


@dataclass(frozen=True, slots=True)
class FormError:
    """One line of the error summary.

    Attributes:
        field: The field to mend.
        message: What to do.
    """

    field: str
    message: str


@dataclass(frozen=True, slots=True)
class RatingField:
    """One question as a page shows it.

    Attributes:
        id: The item's id.
        legend: The question.
        points: The number of answers to choose from.
        low: What the lowest means.
        high: What the highest means.
        value: The answer already given on this page, or None.
        error: What is wrong with it, or None.
    """

    id: str
    legend: str
    points: int
    low: str
    high: str
    value: int | None
    error: str | None


def agrees(form: Mapping[str, str]) -> bool:
    """Tell whether the box on the welcome page was ticked."""
    return form.get("agree") == "yes"


def consent_nonce(form: Mapping[str, str]) -> str | None:
    """Return the nonce of the welcome page that was sent, or None if it has none."""
    nonce = form.get("nonce", "")
    return nonce if re.fullmatch(r"[0-9a-f]{32}", nonce) else None


def refusal_of(form: Mapping[str, str], visit: Visit, page: Page) -> Refusal | None:
    """Say why a sent page is not to be stored, or None if it is this page's turn.

    The nonce shows that the page was shown to this very participant: what an earlier visitor left open in another
    window of the same browser is not this participant's answer.
    """
    decision = decide(page.number, visit.participant.num_stored, visit.participant.num_pages)
    if decision == "too_early":
        return "too_early"
    if not same(form.get("nonce", ""), visit.nonce(page)):
        return "stale"
    return None if decision == "accept" else "already_answered"


def rating_fields(
    form: Mapping[str, str], items: Sequence[Item], problems: Sequence[RatingProblem], experiment: str, t: Texts
) -> list[RatingField]:
    """Return the questions of a rating page, with the answers that a sent form has given already."""
    reasons = {problem.item: problem.reason for problem in problems}
    fields = []
    for item in items:
        wording = t.item(item.id, experiment)
        reason = reasons.get(item.id)
        error = None if reason is None else t(_REASONS[reason], legend=wording.legend)
        value = None if reason is not None or not form else int(form[rating_field(item.id)])
        fields.append(RatingField(item.id, wording.legend, item.points, wording.low, wording.high, value, error))
    return fields


def rating_errors(fields: Sequence[RatingField]) -> list[FormError]:
    """Return the error summary of a rating page."""
    return [FormError(field.id, field.error) for field in fields if field.error is not None]
