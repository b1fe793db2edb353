"""The answers to the questionnaire, from a form to numbers."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from webapp.study.experiments import Item

MAX_RESPONSE_TIME_MS = 86_400_000
"""A day; a longer time is no measurement."""


@dataclass(frozen=True, slots=True)
class Ratings:
    """The whole answer to one explanation: every item, none left out.

    Attributes:
        values: By item id: the chosen point of the scale, from 1.
        response_times: By item id: milliseconds from the paint of the explanation to the last change of the item;
            None where the browser did not measure.
    """

    values: Mapping[str, int]
    response_times: Mapping[str, int | None]


@dataclass(frozen=True, slots=True)
class RatingProblem:
    """An item that cannot be stored.

    Attributes:
        item: The item's id.
        reason: `missing`: nothing was chosen. `invalid`: what came is no point of the scale.
    """

    item: str
    reason: Literal["missing", "invalid"]


def rating_field(item_id: str) -> str:
    """Return the name of the form field that holds an item's rating."""
    return f"rating-{item_id}"


def time_field(item_id: str) -> str:
    """Return the name of the form field that holds an item's response time in milliseconds."""
    return f"time-{item_id}"


def parse_ratings(form: Mapping[str, str], items: Sequence[Item]) -> Ratings | tuple[RatingProblem, ...]:
    """Read the ratings from a sent form.

    A response time that makes no sense is taken for not measured: a rating is never refused for it.

    Args:
        form: The form's fields.
        items: What was asked.

    Returns:
        The ratings, or if any is missing or invalid the problems in the order of the items.
    """
    values = {item.id: _rating(form, item) for item in items}
    problems = tuple(RatingProblem(item, value) for item, value in values.items() if isinstance(value, str))
    if problems:
        return problems
    return Ratings(
        values={item: value for item, value in values.items() if isinstance(value, int)},
        response_times={item.id: measured_time(form.get(time_field(item.id), "")) for item in items},
    )


def _rating(form: Mapping[str, str], item: Item) -> int | Literal["missing", "invalid"]:
    text = form.get(rating_field(item.id), "").strip()
    if not text:
        return "missing"
    if not re.fullmatch(r"[0-9]{1,2}", text) or not 1 <= int(text) <= item.points:
        return "invalid"
    return int(text)


def measured_time(text: str) -> int | None:
    """Return a time in milliseconds as a form gives it, or None if it makes no sense."""
    if not re.fullmatch(r"[0-9]{1,10}", text):
        return None
    milliseconds = int(text)
    return milliseconds if milliseconds <= MAX_RESPONSE_TIME_MS else None
