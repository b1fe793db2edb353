"""What the database itself refuses, whoever asks."""

from typing import Literal

import pytest
from sqlalchemy import Table

from tests.outside import REFUSALS, Outside, outside
from tests.unit.storage.rows import START, subject_of, write_rows
from webapp.storage.database import Database
from webapp.storage.erasure import erase
from webapp.storage.records import Entry, append
from webapp.storage.schema import metadata
from webapp.storage.tables import ANSWER_TABLES, participant_tokens, record_contents

FINISHED, LEFT, CONSENTED, SCREENED_OUT = 1, 2, 3, 4
BY_NAME = pytest.mark.parametrize("table", ANSWER_TABLES, ids=lambda table: table.name)


def num_rows(connection: Outside, table: Table, participant: int) -> int:
    query = f"SELECT count(*) FROM {table.name} WHERE participant_id = ?"  # noqa: S608
    return int(connection.execute(query, (participant,)).fetchone()[0])


def test_every_table_of_a_participant_is_protected() -> None:
    of_participants = {table for table in metadata.tables.values() if "participant_id" in table.columns}
    assert of_participants == {*ANSWER_TABLES, participant_tokens, record_contents}


@BY_NAME
def test_what_was_answered_never_changes(database: Database, table: Table) -> None:
    write_rows(database)
    with outside(database) as connection:
        for participant in (FINISHED, LEFT):
            assert num_rows(connection, table, participant) > 0
            for column in table.columns:
                update = f'UPDATE {table.name} SET "{column.name}" = "{column.name}" WHERE participant_id = ?'  # noqa: S608
                with pytest.raises(REFUSALS, match=f"rows of {table.name} never change"):
                    connection.execute(update, (participant,))


@BY_NAME
def test_what_was_answered_stays_unless_the_participant_left(database: Database, table: Table) -> None:
    write_rows(database)
    delete = f"DELETE FROM {table.name} WHERE participant_id = ?"  # noqa: S608
    with outside(database) as connection:
        for participant in (FINISHED, CONSENTED, SCREENED_OUT):
            if num_rows(connection, table, participant):
                with pytest.raises(REFUSALS, match=f"rows of {table.name} stay"):
                    connection.execute(delete, (participant,))
        assert num_rows(connection, table, FINISHED) > 0
        connection.drop_foreign_keys()
        assert connection.execute(delete, (LEFT,)).rowcount > 0


def test_whoever_wishes_is_forgotten_whole_and_the_others_stay(database: Database) -> None:
    write_rows(database)
    with outside(database) as connection:
        before = [num_rows(connection, table, FINISHED) for table in ANSWER_TABLES]
        (code,) = connection.execute("SELECT code FROM participants WHERE id = ?", (LEFT,)).fetchone()
    erase(database, code, "researcher", START)
    with outside(database) as connection:
        assert all(num_rows(connection, table, LEFT) == 0 for table in ANSWER_TABLES)
        assert [num_rows(connection, table, FINISHED) for table in ANSWER_TABLES] == before
        if database.url is None:
            assert connection.ask("PRAGMA foreign_key_check") == []


@pytest.mark.parametrize("action", ["sent", "noted"])
def test_of_what_was_recorded_only_the_persons_share_can_go_and_only_with_the_person(
    database: Database, action: Literal["sent", "noted"]
) -> None:
    write_rows(database)
    with database.write() as connection:
        for person in (FINISHED, LEFT):
            append(connection, Entry(START, "r", action, subject=subject_of(connection, person), content={"text": "x"}))
        append(connection, Entry(START, "r", "signed_in"))
    with outside(database) as connection:
        for change in (
            "UPDATE record_contents SET participant_id = NULL WHERE participant_id = 1",
            "UPDATE record_contents SET participant_id = NULL, content = 'y' WHERE participant_id = 2",
            "DELETE FROM record_contents WHERE participant_id = 1",
            "DELETE FROM record_contents WHERE participant_id IS NULL",
            "UPDATE records SET actor = 'other'",
            "DELETE FROM records",
        ):
            with pytest.raises(REFUSALS, match="rows of record"):
                connection.execute(change)
        connection.execute("UPDATE record_contents SET participant_id = NULL WHERE participant_id = 2")
