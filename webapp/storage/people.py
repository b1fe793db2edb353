"""What researchers decide about one participant: notes, exclusions, corrections.

Nothing that a participant answered is ever changed: each of these is a record of its own, with who, when and why.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime

from sqlalchemy import Connection, Select, select

from webapp.storage.database import Database
from webapp.storage.participants import Participant, read_by_code
from webapp.storage.records import Action, Entry, append, told_by
from webapp.storage.scope import Scope
from webapp.storage.tables import answers, predictions, ratings
from webapp.study.corrections import Asked, ImpossibleAnswerError

MAX_REASON_LENGTH = 500
"""How many characters a reason or a note may have."""


class PersonError(ValueError):
    """Something that cannot be done about a participant; the message says why."""


@dataclass(frozen=True, slots=True)
class Exclusion:
    """Why a participant's data are not to be analysed.

    Attributes:
        reason: In the researcher's words.
        by: The name of the account.
        at: When it was decided.
    """

    reason: str
    by: str
    at: datetime


@dataclass(frozen=True, slots=True)
class Correction:
    """What should stand in the data instead of what a participant answered.

    Attributes:
        file: The file of the data, such as `answers`.
        asked: What was asked on the page.
        question: The question or item.
        value: What should stand there.
    """

    file: str
    asked: Asked
    question: str
    value: str


CORRECTABLE = ("answers", "ratings", "probes")
"""The files of the data whose values can be corrected."""


def find_person(database: Database, code: str) -> Participant:
    """Return a participant by the public code.

    Raises:
        PersonError: There is none.
    """
    with database.read() as connection:
        return read_person(connection, code)


def exclude(database: Database, code: str, reason: str, actor: str, now: datetime) -> None:
    """Exclude a participant from the analysis.

    Raises:
        PersonError: There is no such participant, the reason is missing or too long, or that was decided already.
    """
    _decide(database, code, "excluded", reason, actor, now)


def include(database: Database, code: str, reason: str, actor: str, now: datetime) -> None:
    """Take an exclusion back.

    Raises:
        PersonError: There is no such participant, the reason is missing or too long, or nobody excluded them.
    """
    _decide(database, code, "included", reason, actor, now)


def note(database: Database, code: str, text: str, actor: str, now: datetime) -> None:
    """Note something about a participant; notes are in no file of the data.

    Raises:
        PersonError: There is no such participant, or the note is missing or too long.
    """
    content = {"text": checked("note", text)}
    with database.write() as connection:
        record_about(connection, read_person(connection, code), Entry(now, actor, "noted", content=content))


def correct(database: Database, code: str, correction: Correction, reason: str, actor: str, now: datetime) -> None:
    """Record what should stand in the data; the answer itself stays as it was given.

    Raises:
        PersonError: There is no such participant or answer, nobody could have answered the value, or the reason or the
            value is missing or too long.
    """
    value = checked("corrected value", correction.value)
    with database.write() as connection:
        person = read_person(connection, code)
        given = _answer(connection, person, correction)
        _check_value(correction, value)
        page = correction.asked.page.number
        place = {"file": correction.file, "page": page, "question": correction.question}
        content = place | {"from": given, "to": value, "reason": checked("reason", reason)}
        record_about(connection, person, Entry(now, actor, "corrected", page=page, content=content))


def exclusion_states(connection: Connection, scope: Scope | None = None) -> Mapping[int, Exclusion]:
    """Return by participant's id who is excluded now."""
    found: dict[int, Exclusion] = {}
    for _, at, actor, action, participant_id, _, content in told_by(connection, "excluded", "included", scope=scope):
        if participant_id is None:
            continue
        if action == "excluded":
            found[participant_id] = Exclusion(content["reason"], actor, at)
        else:
            found.pop(participant_id, None)
    return found


def _decide(database: Database, code: str, action: Action, reason: str, actor: str, now: datetime) -> None:
    content = {"reason": checked("reason", reason)}
    with database.write() as connection:
        person = read_person(connection, code)
        is_excluded = person.id in exclusion_states(connection, person.scope)
        if is_excluded == (action == "excluded"):
            raise PersonError(f"participant {code!r} is {'excluded already' if is_excluded else 'not excluded'}")
        record_about(connection, person, Entry(now, actor, action, content=content))


def record_about(connection: Connection, person: Participant, entry: Entry) -> None:
    """Add a record about a participant."""
    append(connection, replace(entry, scope=person.scope, subject=person.subject))


def read_person(connection: Connection, code: str) -> Participant:
    """Return a participant within a transaction.

    Raises:
        PersonError: There is none.
    """
    person = read_by_code(connection, code)
    if person is None:
        raise PersonError(f"there is no participant {code!r}")
    return person


def checked(what: str, text: str) -> str:
    """Return what somebody wrote, without blanks at the ends and without NUL, which PostgreSQL cannot store.

    Raises:
        PersonError: There is nothing, or too much.
    """
    told = text.replace("\0", "").strip()
    if not told:
        raise PersonError(f"the {what} is missing; say it in up to {MAX_REASON_LENGTH} characters")
    if len(told) > MAX_REASON_LENGTH:
        raise PersonError(f"the {what} has {len(told)} characters; use up to {MAX_REASON_LENGTH}")
    return told


def _check_value(correction: Correction, value: str) -> None:
    try:
        correction.asked.check(correction.file, correction.question, value)
    except ImpossibleAnswerError as error:
        raise PersonError(str(error)) from error


def _answer(connection: Connection, person: Participant, correction: Correction) -> str:
    """Return what a participant answered."""
    of_page = (correction.asked.page.number, correction.question)
    match correction.file:
        case "answers":
            query: Select[tuple[object]] = (
                select(answers.c.answer)
                .where(answers.c.participant_id == person.id)
                .where(answers.c.page_number == of_page[0], answers.c.question == of_page[1])
                .order_by(answers.c.attempt.desc())
                .limit(1)
            )
        case "ratings":
            query = select(ratings.c.rating).where(
                ratings.c.participant_id == person.id, ratings.c.page_number == of_page[0], ratings.c.item == of_page[1]
            )
        case "probes":
            number = int(of_page[1]) if re.fullmatch(r"[0-9]{1,3}", of_page[1]) else 0
            query = select(predictions.c.predicted).where(
                predictions.c.participant_id == person.id,
                predictions.c.page_number == of_page[0],
                predictions.c.question == number,
            )
        case _:
            raise PersonError(f"{correction.file!r} cannot be corrected; use {', '.join(CORRECTABLE)}")
    # Nothing that is asked has a NUL in its name, and PostgreSQL refuses to look for one.
    given = None if "\0" in correction.question else connection.execute(query).scalar_one_or_none()
    if given is None:
        raise PersonError(f"participant {person.code!r} has no answer to {correction.question!r} on page {of_page[0]}")
    return str(given)
