"""Who may see which arm is which: nobody, until an owner opens the mask for themselves, which is recorded for ever."""

import functools
import hashlib
import hmac
from collections.abc import Mapping
from datetime import datetime
from typing import cast

from sqlalchemy import select

from webapp.storage.database import Database
from webapp.storage.participants import Participant
from webapp.storage.people import checked
from webapp.storage.records import Entry, append, told_by
from webapp.storage.scope import Scope
from webapp.storage.tables import records
from webapp.study.protocol import Study


def unblinded_at(database: Database, account: str, scope: Scope) -> datetime | None:
    """Return since when an account sees which arm is which; None while it does not."""
    with database.read() as connection:
        told = told_by(connection, "unblinded", scope=scope)
        return next((cast("datetime", at) for _, at, actor, *_ in told if actor == account), None)


def unblind(database: Database, account: str, scope: Scope, reason: str, now: datetime) -> None:
    """Show an account from now on which arm is which.

    Raises:
        webapp.storage.people.PersonError: The reason is missing or too long.
    """
    content = {"reason": checked("reason", reason)}
    with database.write() as connection:
        append(connection, Entry(now, account, "unblinded", scope, content=content))


def is_person_unblinded(database: Database, account: str, person: Participant) -> bool:
    """Tell whether an account sees what one participant was shown."""
    with database.read() as connection:
        return any(
            actor == account and participant_id == person.id
            for _, _, actor, _, participant_id, *_ in told_by(connection, "person_unblinded", scope=person.scope)
        )


def unblind_person(database: Database, account: str, person: Participant, reason: str, now: datetime) -> None:
    """Show an account what one participant was shown, such as to help them.

    Raises:
        webapp.storage.people.PersonError: The reason is missing or too long.
    """
    content = {"reason": checked("reason", reason)}
    with database.write() as connection:
        append(connection, Entry(now, account, "person_unblinded", person.scope, person.subject, content=content))


def has_looked(database: Database, account: str, scope: Scope) -> bool:
    """Tell whether an account ever saw what a participant of these data was shown, erased since or not."""
    looked = records.c.action == "person_unblinded", records.c.actor == account, scope.of(records)
    with database.read() as connection:
        return connection.execute(select(records.c.number).where(*looked).limit(1)).first() is not None


def arm_labels(secret: bytes, scope: Scope, study: Study) -> Mapping[tuple[str, str], str]:
    """Return what the kinds of explanation are called while they are masked, by experiment and kind.

    Each experiment has its own `Arm A`, `Arm B` and so on: letters that were the same in all of them would be told by
    which kinds an experiment lacks. Which letter a kind gets follows from the instance's secret, so that it stays the
    same and cannot be guessed.
    """
    place = f"mask|{scope.study}|{scope.study_version}|{scope.mode}"

    def lot(experiment: str, kind: str) -> bytes:
        return hmac.new(secret, f"{place}|{experiment}|{kind}".encode(), hashlib.sha256).digest()

    return {
        (experiment.id, kind): f"Arm {_letters(number)}"
        for experiment in study.experiments
        for number, kind in enumerate(sorted(experiment.kinds, key=functools.partial(lot, experiment.id)))
    }


def _letters(number: int) -> str:
    """Return A to Z, then AA, AB and so on."""
    rest, letter = divmod(number, 26)
    return (_letters(rest - 1) if rest else "") + chr(ord("A") + letter)
