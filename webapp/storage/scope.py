"""Whose data: one version of a study in one mode."""

from dataclasses import dataclass
from typing import Literal

from sqlalchemy import ColumnElement, FromClause, and_

Mode = Literal["live", "test", "bot"]
"""Who takes part: people whose answers are data, somebody trying the study out, or a program."""


@dataclass(frozen=True, slots=True)
class Scope:
    """One version of a study in one mode. Balance, numbers and unblinding never reach beyond it.

    Attributes:
        study: The study's name.
        study_version: The hash of its bundle.
        mode: Who takes part.
    """

    study: str
    study_version: str
    mode: Mode

    def of(self, table: FromClause) -> ColumnElement[bool]:
        """Return the condition that a row of a table with these three columns belongs here."""
        return and_(table.c.study == self.study, table.c.study_version == self.study_version, table.c.mode == self.mode)
