"""What the database itself refuses, whoever asks."""

import sqlite3
from contextlib import closing

import pytest
from sqlalchemy import Table

from tests.unit.storage.rows import write_rows
from webapp.storage.database import Database
from webapp.storage.tables import ANSWER_TABLES, metadata

FINISHED, LEFT, CONSENTED, SCREENED_OUT = 1, 2, 3, 4
BY_NAME = pytest.mark.parametrize("table", ANSWER_TABLES, ids=lambda table: table.name)


def num_rows(connection: sqlite3.Connection, table: Table, participant: int) -> int:
    query = f"SELECT count(*) FROM {table.name} WHERE participant_id = ?"  # noqa: S608
    return int(connection.execute(query, (participant,)).fetchone()[0])


def test_every_table_of_a_participant_is_protected() -> None:
    of_participants = {table for table in metadata.tables.values() if "participant_id" in table.columns}
    assert of_participants == set(ANSWER_TABLES)


@BY_NAME
def test_what_was_answered_never_changes(database: Database, table: Table) -> None:
    write_rows(database)
    with closing(sqlite3.connect(database.path)) as connection:
        for participant in (FINISHED, LEFT):
            assert num_rows(connection, table, participant) > 0
            for column in table.columns:
                update = f'UPDATE {table.name} SET "{column.name}" = "{column.name}" WHERE participant_id = ?'  # noqa: S608
                with pytest.raises(sqlite3.IntegrityError, match=f"rows of {table.name} never change"):
                    connection.execute(update, (participant,))


@BY_NAME
def test_what_was_answered_stays_unless_the_participant_left(database: Database, table: Table) -> None:
    write_rows(database)
    delete = f"DELETE FROM {table.name} WHERE participant_id = ?"  # noqa: S608
    with closing(sqlite3.connect(database.path)) as connection:
        for participant in (FINISHED, CONSENTED, SCREENED_OUT):
            if num_rows(connection, table, participant):
                with pytest.raises(sqlite3.IntegrityError, match=f"rows of {table.name} stay"):
                    connection.execute(delete, (participant,))
        assert num_rows(connection, table, FINISHED) > 0
        assert connection.execute(delete, (LEFT,)).rowcount > 0


def test_a_participant_who_left_can_be_forgotten_whole(database: Database) -> None:
    write_rows(database)
    with database.write() as connection:
        for table in reversed(ANSWER_TABLES):
            connection.execute(table.delete().where(table.c.participant_id == LEFT))
        connection.exec_driver_sql("DELETE FROM participants WHERE id = ?", (LEFT,))
    with closing(sqlite3.connect(database.path)) as connection:
        assert all(num_rows(connection, table, LEFT) == 0 for table in ANSWER_TABLES)
        assert connection.execute("PRAGMA foreign_key_check").fetchall() == []
