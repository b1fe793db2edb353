"""What the parts of a study file have in common: how they are checked, and the kinds of values they hold."""

import re
from datetime import date
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field


class Declared(BaseModel):
    """A part of the study file: unknown keys are refused, numbers are numbers, and nothing changes afterwards."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


def is_placeholder(value: str) -> bool:
    """Tell whether a setting still waits to be filled in: it is written in angle brackets, such as `<address>`."""
    return value.startswith("<") and value.endswith(">")


def _name(value: str) -> str:
    if not re.fullmatch(r"[a-z0-9](?:[a-z0-9_-]{0,62}[a-z0-9])?", value):
        raise ValueError("use up to 64 lower-case letters, digits, - and _, with a letter or digit at either end")
    return value


def _date_or_placeholder(value: str) -> str:
    if not is_placeholder(value):
        try:
            date.fromisoformat(value)
        except ValueError:
            raise ValueError('use a date such as "2030-12-31", or a placeholder in angle brackets') from None
    return value


def _as_tuple(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def _as_text(value: object) -> object:
    return value.isoformat() if isinstance(value, date) else value


Name = Annotated[str, AfterValidator(_name)]
Filled = Annotated[str, Field(min_length=1, pattern=r"\S")]
Day = Annotated[str, BeforeValidator(_as_text), AfterValidator(_date_or_placeholder)]
Seed = Annotated[int, Field(ge=0, lt=2**63)]


def declared_list(least: int) -> list[object]:
    """Return the annotations of a list with at least so many entries: TOML gives a list, and we keep a tuple."""
    return [Field(min_length=least), BeforeValidator(_as_tuple)]
