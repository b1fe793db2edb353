"""A migration that ends itself, in a process of its own."""

import os
import signal
import sqlite3
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, event

from tests.unit.storage.people import NOW
from webapp.storage.migrating import migrate


def migrate_counting(path: Path, kept: Path, before: int, is_naive: bool, count: Any) -> None:  # noqa: ANN401
    @event.listens_for(Engine, "before_cursor_execute")
    def _count(connection: Connection, _cursor: Any, statement: str, *_rest: Any) -> None:  # noqa: ANN401
        if not statement.startswith(("CREATE", "ALTER", "DROP", "INSERT", "UPDATE", "DELETE", "SELECT")):
            return
        if count.value == before:
            os.kill(os.getpid(), signal.SIGKILL)
        count.value += 1
        driver = connection.connection.driver_connection
        if is_naive and isinstance(driver, sqlite3.Connection) and driver.in_transaction:
            driver.execute("COMMIT")
            driver.execute("BEGIN")

    migrate(path, kept, NOW)
    if count.value == before:
        os.kill(os.getpid(), signal.SIGKILL)
