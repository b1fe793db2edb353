"""The participants of one scope, kept up to date: only those whom new records name are read again."""

from collections.abc import Collection, Iterator, Mapping
from itertools import islice

from sqlalchemy import Connection, func, select

from webapp.storage.database import Database
from webapp.storage.decided import duplicates, released_pages
from webapp.storage.live_plans import Plans
from webapp.storage.live_reading import Decided, read_summaries
from webapp.storage.live_summaries import PersonSummary
from webapp.storage.live_tally import Tally
from webapp.storage.people import Exclusion, exclusion_states
from webapp.storage.records import Head, head
from webapp.storage.scope import Scope
from webapp.storage.tables import participants, record_contents, records
from webapp.study.protocol import Study

CHUNK = 250
"""How many participants are read in one transaction."""


class ScopePeople:
    """Everybody of one scope, with what is summed up over them. Not for several threads at once.

    Attributes:
        plans: The plans of the study version.
        people: The summaries, by the rows' numbers.
        tally: The sums over them.
        excluded: Who is excluded and why, by the rows' numbers.
        head: The end of the log up to which everything is counted; None before the first look.
        num_elsewhere: How many participants of other scopes the database holds.
        version: A number that grows whenever `tally` changes.
    """

    def __init__(self, database: Database, study: Study, scope: Scope) -> None:
        self.plans = Plans(study)
        self.people: dict[int, PersonSummary] = {}
        self.tally = Tally()
        self.excluded: Mapping[int, Exclusion] = {}
        self.head: Head | None = None
        self.num_elsewhere = 0
        self.version = 0
        self._database = database
        self._scope = scope
        self._decided = Decided()

    def refresh(self) -> Head:
        """Read what is new, in several short transactions, and return the end of the log that is reached.

        What comes in meanwhile may be counted already; the next look reads it again. If a look fails half-way, the next
        one begins where it began.
        """
        with self._database.read() as connection:
            latest = head(connection)
            if latest == self.head:
                return latest
            touched = self._touched(connection)
            num_here = _count(connection, self._scope)
            self.num_elsewhere = _count(connection) - num_here
            decided, excluded = self._decide(connection)
        changed = set(decided.duplicates) ^ set(self._decided.duplicates)
        self._read(touched | (changed & self.people.keys()), decided)
        if len(self.people) != num_here:
            self._compare_with_all(decided)
        self.excluded, self._decided, self.head = excluded, decided, latest
        return latest

    def _touched(self, connection: Connection) -> set[int]:
        """Return whom the records since the last look name; at the first look, everybody."""
        if self.head is None:
            return _ids(connection, self._scope)
        query = (
            select(record_contents.c.participant_id)
            .join(records, records.c.number == record_contents.c.number)
            .where(
                records.c.number > self.head.number,
                self._scope.of(records),
                record_contents.c.participant_id.is_not(None),
            )
            .distinct()
        )
        return set(connection.execute(query).scalars())

    def _decide(self, connection: Connection) -> tuple[Decided, Mapping[int, Exclusion]]:
        """Read what researchers decided and who is a duplicate, where that may have changed."""
        since = 0 if self.head is None else self.head.number
        query = select(records.c.action).where(records.c.number > since).distinct()
        actions = set(connection.execute(query).scalars())
        known = self._decided
        excluded, released, twice = self.excluded, known.released, known.duplicates
        if actions & {"excluded", "included", "erased"}:
            excluded = exclusion_states(connection, self._scope)
        if actions & {"page_released", "erased"}:
            released = released_pages(connection, self._scope)
        if self.plans.study.quality.duplicates and actions & {"consented", "erased"}:
            twice = duplicates(connection)
        return Decided(excluded=excluded, released=released, duplicates=twice), excluded

    def _read(self, ids: Collection[int], decided: Decided) -> None:
        for chunk in _chunks(sorted(ids)):
            with self._database.read() as connection:
                found = list(read_summaries(connection, self.plans, self._scope, chunk, decided))
            self._forget(chunk)
            for person in found:
                self.people[person.id] = person
                self.tally.add(person)

    def _forget(self, ids: Collection[int]) -> None:
        self.version += 1
        for number in ids:
            known = self.people.pop(number, None)
            if known is not None:
                self.tally.remove(known)

    def _compare_with_all(self, decided: Decided) -> None:
        """Drop whoever is there no more, and read whoever was missed."""
        with self._database.read() as connection:
            ids = _ids(connection, self._scope)
        self._forget(self.people.keys() - ids)
        self._read(ids - self.people.keys(), decided)


def _ids(connection: Connection, scope: Scope) -> set[int]:
    return set(connection.execute(select(participants.c.id).where(scope.of(participants))).scalars())


def _count(connection: Connection, scope: Scope | None = None) -> int:
    query = select(func.count()).select_from(participants)
    return connection.execute(query if scope is None else query.where(scope.of(participants))).scalar_one()


def _chunks(ids: list[int]) -> Iterator[list[int]]:
    rest = iter(ids)
    while chunk := list(islice(rest, CHUNK)):
        yield chunk
