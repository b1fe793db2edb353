"""Everything that a request of a participant needs to know, read in one transaction."""

from collections.abc import Sequence
from dataclasses import dataclass

from webapp.storage.database import Database
from webapp.storage.participants import Participant, read_participant, read_trials
from webapp.storage.restarts import read_restarts
from webapp.study.session import Trial


@dataclass(frozen=True, slots=True)
class StoredVisit:
    """A participant with what was planned for them.

    Attributes:
        participant: How far they are.
        trials: In order.
        restarts: By page, how often a researcher let them begin it anew; pages never begun anew are missing.
    """

    participant: Participant
    trials: Sequence[Trial]
    restarts: dict[int, int]


def find_visit(database: Database, token_hash: str) -> StoredVisit | None:
    """Return what is stored of the participant whose token has this hash, as of one moment, or None."""
    with database.read() as connection:
        participant = read_participant(connection, token_hash)
        if participant is None:
            return None
        return StoredVisit(participant, read_trials(connection, participant), read_restarts(connection, participant))
