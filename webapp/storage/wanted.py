"""What of the data is wanted: of which study, version and participants, and whether with their own words."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from sqlalchemy import ColumnElement, FromClause, and_, true

from webapp.stimuli.catalogue import BundleError, Catalogue
from webapp.storage.scope import Mode
from webapp.study.answers import PREFER_NOT_TO_SAY

FindBundle = Callable[[str], Catalogue | None]
"""Finds the bundle of a study version; None where it is not there any more."""


def no_bundle(version: str) -> None:
    """Find no bundle."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which rows of the files are wanted.

    Attributes:
        study: Of this study; None for all.
        study_version: Of this version, or of versions that begin like this; None for all.
        mode: Of these participants; None for all.
        with_free_text: Whether answers in participants' own words are wanted too.
        find_bundle: Tells what was declared: which answers are own words, which rules there are, which columns.
    """

    study: str | None = None
    study_version: str | None = None
    mode: Mode | None = None
    with_free_text: bool = False
    find_bundle: FindBundle = no_bundle

    def of(self, table: FromClause) -> ColumnElement[bool]:
        """Return the condition that a row of a table with study, version and mode is wanted."""
        conditions: list[ColumnElement[bool]] = [true()]
        if self.study is not None:
            conditions.append(table.c.study == self.study)
        if self.study_version is not None:
            conditions.append(table.c.study_version.startswith(self.study_version, autoescape=True))
        if self.mode is not None:
            conditions.append(table.c.mode == self.mode)
        return and_(*conditions)

    def has(self, study: object, version: object, mode: object) -> bool:
        """Tell the same of one row."""
        return (
            self.study in (None, study)
            and str(version).startswith(self.study_version or "")
            and self.mode in (None, mode)
        )

    def withholds(self, version: str, question: str, answer: str) -> bool:
        """Tell whether the answer to a background question is in the participant's own words and not wanted.

        Where the bundle is gone, everything that is no number might be.
        """
        if self.with_free_text or answer == PREFER_NOT_TO_SAY:
            return False
        bundle = self.find_bundle(version)
        if bundle is None:
            return not answer.removeprefix("-").isdecimal()
        background = bundle.study.background
        return background is not None and any(
            asked.id == question and asked.type == "text" for asked in background.questions
        )


AS_STORED = Wanted(with_free_text=True)
"""Everything."""


def bundles_in(instance: Path) -> FindBundle:
    """Return what finds bundles in the folder of an instance; each is opened once."""

    @lru_cache(maxsize=64)
    def find(version: str) -> Catalogue | None:
        try:
            return Catalogue.open(instance / "bundles" / version)
        except BundleError:
            return None

    return find
