"""Corrections: what a researcher decided should stand in the data, put in the place of what was answered."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

import pandas as pd

from webapp.study.protocol import Study
from webapp.study.session import Page, Trial, pages

_QUESTION = {"ratings": "item", "answers": "question", "probes": "question"}
_VALUE = {"ratings": "rating", "answers": "answer", "probes": "predicted"}
"""The columns of each file that say what was asked and what was answered."""


@dataclass(frozen=True, slots=True)
class Correction:
    """A correction.

    Attributes:
        participant: Whose answer it is.
        file: The file that holds it.
        question: The item or question.
        before: What was answered.
        after: What should stand there.
        reason: The researcher's.
        problem: Why it was not made; None if it was.
    """

    participant: str
    file: str
    question: str
    before: str
    after: str
    reason: str
    problem: str | None = None


def apply_corrections(
    tables: Mapping[str, pd.DataFrame],
    study: Study | None,
    points: Mapping[tuple[str, str], int],
    name_of: Callable[[str], str],
) -> tuple[dict[str, pd.DataFrame], tuple[Correction, ...]]:
    """Make the corrections, oldest first, so that the last one of an answer stands.

    Args:
        tables: The tables of one version and mode, by name, each with a plain index.
        study: The study as declared; it tells on which page a trial was.
        points: The points of each item's scale, by experiment and item.
        name_of: Tells the file of a table, for messages.

    Returns:
        The tables, those that are corrected as copies, and what was done.
    """
    decisions = tables.get("decisions")
    if decisions is None:
        return dict(tables), ()
    corrected = decisions[decisions["action"] == "corrected"].sort_values("record", kind="stable")
    changed = {name: table.copy() for name, table in tables.items() if name in _VALUE}
    done = []
    for decision in corrected.to_dict("records"):
        told = {str(name): None if pd.isna(value) else value for name, value in decision.items()}
        is_there = told["file"] in changed
        missing = f"there is no {name_of(str(told['file']))}"
        problem = _correct(tables, changed, told, study, points) if is_there else missing
        said = {name: "" if value is None else str(value) for name, value in told.items()}
        who, file, question = said["participant"], said["file"], said["question"]
        done.append(Correction(who, file, question, said["from"], said["to"], said["reason"], problem))
    return {**tables, **changed}, tuple(done)


def _correct(
    given: Mapping[str, pd.DataFrame],
    changed: Mapping[str, pd.DataFrame],
    told: Mapping[str, object],
    study: Study | None,
    points: Mapping[tuple[str, str], int],
) -> str | None:
    """Make one correction, and return why it cannot be made."""
    file = str(told["file"])
    if told["to"] is None:
        return "the value is in the participant's own words and was left out"
    rows = _rows(given, file, told, study)
    if len(rows) != 1:
        return "no such answer is there" if rows.empty else f"{len(rows)} answers fit, and their pages are not known"
    row, value = int(rows[0]), str(told["to"])
    was = given[file][_VALUE[file]].iat[row]
    if told["from"] is not None and str(was) != str(told["from"]):
        return f"the file has {str(was)!r} there, and not {told['from']!r}"
    match file:
        case "ratings":
            return _set_rating(changed[file], row, value, points)
        case "probes":
            _set_prediction(changed[file], row, value)
        case _:
            changed[file].loc[row, "answer"] = value
            changed[file].loc[row, "is_correct"] = _is_right(study, str(told["question"]), value)
    return None


def _rows(given: Mapping[str, pd.DataFrame], file: str, told: Mapping[str, object], study: Study | None) -> pd.Index:
    """Return the rows that a correction can be about: one, if its page tells the trial or nothing else fits."""
    table = given[file]
    asked = table[_QUESTION[file]].astype("str")
    fits = (table["participant"] == told["participant"]) & (asked == str(told["question"]))
    page = _page(given.get("participants"), told, study)
    if page is not None and page.trial is not None:
        fits &= (table["experiment"] == page.trial.experiment) & (table["trial"] == page.trial.position).fillna(
            value=False
        )
    elif page is None and told["from"] is not None:
        fits &= table[_VALUE[file]].astype("str") == str(told["from"])
    found = table[fits]
    # Of the attempts at a quiz the last one is corrected.
    return found.sort_values("attempt", kind="stable").index[-1:] if file == "answers" else found.index


def _page(people: pd.DataFrame | None, told: Mapping[str, object], study: Study | None) -> Page | None:
    """Return the page of a correction, None where it is not known."""
    if people is None or study is None or told["page"] is None:
        return None
    drawn = people.loc[people["participant"] == told["participant"], "assignment"].dropna()
    number = int(str(told["page"]))
    try:
        own = pages(study, _trials(drawn.iat[0])) if len(drawn) else ()
    except (ValueError, KeyError):
        return None
    return own[number - 1] if 1 <= number <= len(own) else None


def _trials(assignment: str) -> tuple[Trial, ...]:
    """Read `experiment/layout/kind` or `experiment/layout/kind/draw` of each trial.

    Raises:
        ValueError: It is something else.
    """
    drawn = [trial.split("/") for trial in assignment.split()]
    experiments = [parts[0] for parts in drawn]
    trials = []
    for place, (experiment, layout, kind, *draw) in enumerate(drawn):
        position = experiments[: place + 1].count(experiment)
        number = int(draw[0]) if draw else None
        trials.append(Trial(experiment, position, experiments.count(experiment), layout, kind, number))
    return tuple(trials)


def _set_rating(table: pd.DataFrame, row: int, value: str, points: Mapping[tuple[str, str], int]) -> str | None:
    most = points[cast("str", table["experiment"].iat[row]), cast("str", table["item"].iat[row])]
    if not re.fullmatch(r"[0-9]{1,2}", value) or not 1 <= int(value) <= most:
        return f"{value!r} is no rating from 1 to {most}"
    table.loc[row, "rating"] = int(value)
    return None


def _set_prediction(table: pd.DataFrame, row: int, value: str) -> None:
    is_correct = bool(value == table["action"].iat[row])
    table.loc[row, "predicted"] = value
    table.loc[row, "is_correct"] = is_correct
    # Whether another action than the agent's is as good stands in the bundle alone.
    table.loc[row, "is_as_good"] = True if is_correct else pd.NA


def _is_right(study: Study | None, question: str, value: str) -> object:
    """Tell whether an answer is right; missing where nothing is, or it is not known."""
    quiz = () if study is None or study.quiz is None else study.quiz.questions
    right = {each.id: each.answer for each in quiz}
    right |= {} if study is None else {check.id: str(check.answer) for check in study.attention_checks}
    return value == right[question] if question in right else pd.NA
