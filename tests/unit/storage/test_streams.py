from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import select

from tests.unit.storage.rows import write_rows
from webapp.storage.database import Database
from webapp.storage.streams import Alongside, stream
from webapp.storage.tables import events, participants


@given(rows=st.lists(st.tuples(st.integers(0, 9), st.integers())), asked=st.sets(st.integers(-1, 10)))
def test_each_key_gets_its_own_rows_whichever_are_asked_for(rows: list[tuple[int, int]], asked: set[int]) -> None:
    alongside = Alongside(iter(sorted(rows)), key=lambda row: row[0])
    for key in sorted(asked):
        assert alongside.of(key) == [row for row in sorted(rows) if row[0] == key]


def test_two_queries_are_read_in_turns_on_one_connection(database: Database) -> None:
    write_rows(database)
    query = select(events.c.participant_id, events.c.number).order_by(events.c.participant_id, events.c.number)
    with database.read() as connection:
        told = Alongside(stream(connection, query), key=lambda row: row[0])
        people = stream(connection, select(participants.c.id).order_by(participants.c.id))
        assert [len(told.of(participant_id)) for (participant_id,) in people] == [5, 5, 0, 0]
