"""The wish of one participant to be forgotten."""

from datetime import datetime

from sqlalchemy import delete, select, update

from webapp.storage.database import Database
from webapp.storage.ledger import slot_of
from webapp.storage.people import read_person
from webapp.storage.records import LEDGER, Entry, append
from webapp.storage.snapshot import remove_stale
from webapp.storage.tables import ANSWER_TABLES, participant_tokens, participants, record_contents, records


def erase(database: Database, code: str, actor: str, now: datetime) -> bool:
    """Withdraw a participant and erase every row of theirs; what is left tells neither who it was nor what they said.

    The chain keeps salted digests, whose salt is erased too, and the ledger the place that was given out.

    Returns:
        Whether nothing is left on the disk. If not, `edition.last_traces` of the database tells when the rest goes.

    Raises:
        PersonError: There is no such participant.
    """
    remove_stale(database)
    with database.write() as connection:
        person = read_person(connection, code)
        slot = slot_of(connection, person.id)
        theirs = participants.c.id == person.id
        connection.execute(update(participants).where(theirs).values(withdrawn_at=person.withdrawn_at or now))
        of_ledger = select(records.c.number).where(records.c.action.in_(LEDGER))
        told = record_contents.c.participant_id == person.id
        connection.execute(
            update(record_contents).where(told, record_contents.c.number.in_(of_ledger)).values(participant_id=None)
        )
        connection.execute(delete(record_contents).where(told))
        for table in (participant_tokens, *reversed(ANSWER_TABLES)):
            connection.execute(delete(table).where(table.c.participant_id == person.id))
        connection.execute(delete(participants).where(theirs))
        append(connection, Entry(now, actor, "erased", person.scope, content={"slot": slot}))
    return database.forget()
