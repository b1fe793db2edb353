"""The look at how the server is doing costs the same however long the log is."""

from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import psycopg
import pytest
from sqlalchemy import event

from tests import postgres
from webapp.storage.condition import condition
from webapp.storage.database import Database

NUM_RECORDS = 5_000
_FILL = """
INSERT INTO records (number, at, actor, action, content_digest, previous_hash, hash)
SELECT number, '2031-01-01 09:00:00.000000', 'participant', CASE WHEN number %% 3 = 0 THEN 'sent' ELSE 'noted' END,
       'a', 'b', 'c'
FROM generate_series(1, %s) AS number
"""


@pytest.fixture
def url(postgres_server: postgres.Server) -> Iterator[str]:
    """The address of a database with a long log, of which the server has no statistics yet."""
    name = postgres_server.make()
    with closing(postgres_server.connect(name)) as connection:
        connection.execute("ALTER TABLE records DISABLE TRIGGER ALL")
        connection.execute("ALTER TABLE records SET (autovacuum_enabled = off)")
        connection.execute(_FILL, (NUM_RECORDS,))
    yield postgres_server.url(name)
    postgres_server.drop(name)


def test_of_a_long_log_in_postgresql_only_the_end_is_read(url: str, tmp_path: Path) -> None:
    """Two of the three kinds of answers are not in the log at all, and nothing may walk through all of it for them."""
    asked: list[tuple[str, Any]] = []
    with closing(Database(tmp_path / "xar.sqlite3", url)) as database:
        with database.read() as connection:
            event.listen(connection.engine, "before_cursor_execute", lambda *told: asked.append((told[2], told[3])))
        found = condition(database, tmp_path / "backups", datetime(2031, 1, 2, tzinfo=UTC), is_live=False)
    assert found.last_answer_at == datetime(2031, 1, 1, 9, tzinfo=UTC)
    asked = [(statement, values) for statement, values in asked if "FROM records" in statement]
    assert asked
    with closing(psycopg.connect(url, autocommit=True)) as connection:
        for statement, values in asked:
            told = connection.execute(f"EXPLAIN (ANALYZE, FORMAT JSON) {statement}".encode(), values).fetchone()
            assert told is not None
            assert num_read(told[0][0]["Plan"]) < 10, statement


def num_read(plan: dict[str, Any]) -> int:
    """Return how many rows a plan's steps returned or passed over."""
    own = plan["Actual Rows"] + plan.get("Rows Removed by Filter", 0)
    return int(own) + sum(num_read(step) for step in plan.get("Plans", ()))
