"""Everything that a request of a participant needs to know."""

import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

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


class RecentTrials:
    """The trials of those who asked last. They are planned once, with the consent, and never change.

    Threads may share it.
    """

    def __init__(self, most: int = 500) -> None:
        """Remember the trials of `most` participants."""
        self._most = most
        self._lock = threading.Lock()
        self._known: OrderedDict[tuple[int, str], Sequence[Trial]] = OrderedDict()

    def of(self, connection: Connection, participant: Participant) -> Sequence[Trial]:
        """Return a participant's trials, remembered or read within a transaction."""
        key = participant.id, participant.code
        with self._lock:
            if key in self._known:
                self._known.move_to_end(key)
                return self._known[key]
        trials = read_trials(connection, participant)
        if not trials:  # The participant was erased a moment ago.
            return trials
        with self._lock:
            self._known[key] = trials
            if len(self._known) > self._most:
                self._known.popitem(last=False)
        return trials


def find_visit(database: Database, token_hash: str, recent: RecentTrials) -> StoredVisit | None:
    """Return what is stored of the participant whose token has this hash, or None; not quite as of one moment."""
    with database.look() as connection:
        participant = read_participant(connection, token_hash)
        if participant is None:
            return None
        if not participant.has_restarts:
            return StoredVisit(participant, recent.of(connection, participant), {})
    with database.read() as connection:
        participant = read_participant(connection, token_hash)
        if participant is None:
            return None
        return StoredVisit(participant, recent.of(connection, participant), read_restarts(connection, participant))
