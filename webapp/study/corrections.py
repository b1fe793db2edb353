"""Which values can stand in the data instead of what a participant answered: only what could have been answered."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from webapp.study.answers import PREFER_NOT_TO_SAY
from webapp.study.experiments import SATISFACTION_ITEMS, Item
from webapp.study.protocol import Study
from webapp.study.sections import ATTENTION_POINTS, BackgroundQuestion
from webapp.study.session import Page


class ImpossibleAnswerError(ValueError):
    """A value that nobody could have answered; the message says which can be."""


@dataclass(frozen=True, slots=True)
class Asked:
    """What was asked on a page.

    Attributes:
        study: The study.
        page: The page.
        actions: The names of the actions that can be predicted there.
    """

    study: Study
    page: Page
    actions: Sequence[str] = ()

    def check(self, file: str, question: str, value: str) -> None:
        """Make sure that a value could have been answered.

        What the study does not know, such as a question that it does not have, is not looked at.

        Args:
            file: The file of the data, such as `ratings`.
            question: The question or item.
            value: The value as it would stand in the file.

        Raises:
            ImpossibleAnswerError: It could not.
        """
        match file:
            case "ratings":
                self._check_rating(question, value)
            case "probes":
                _check_choice(value, self.actions)
            case "answers":
                self._check_answer(question, value)

    def _check_rating(self, question: str, value: str) -> None:
        trial = self.page.trial
        items = () if trial is None else self.study.experiment(trial.experiment).items
        points = {item.id: item.points for item in (*items, *(Item(id=name) for name in SATISFACTION_ITEMS))}
        if question in points:
            _check_number(value, 1, points[question])

    def _check_answer(self, question: str, value: str) -> None:
        study = self.study
        if any(check.id == question for check in study.attention_checks):
            _check_number(value, 1, ATTENTION_POINTS)
        background = () if study.background is None or self.page.kind != "background" else study.background.questions
        for asked in background:
            if asked.id == question and value != PREFER_NOT_TO_SAY:
                _check_background(asked, value)
        quiz = () if study.quiz is None or self.page.kind != "quiz" else study.quiz.questions
        for entry in quiz:
            if entry.id == question:
                _check_choice(value, entry.choices)


def _check_background(asked: BackgroundQuestion, value: str) -> None:
    if asked.type == "choice":
        _check_choice(value, (*asked.choices, PREFER_NOT_TO_SAY))
    elif asked.type == "number":
        _check_number(value, asked.minimum, asked.maximum)


def _check_number(value: str, least: int, most: int) -> None:
    if not re.fullmatch(r"0|-?[1-9][0-9]{0,8}", value) or not least <= int(value) <= most:
        raise ImpossibleAnswerError(f"{value!r} cannot be answered there; use a whole number from {least} to {most}")


def _check_choice(value: str, choices: Sequence[str]) -> None:
    if value not in choices:
        raise ImpossibleAnswerError(f"{value!r} cannot be answered there; use {', '.join(choices)}")
