"""Who did what on the dashboard, and when."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from sqlalchemy import Connection, insert, select

from webapp.storage.database import Database
from webapp.storage.tables import audit_log

Action = Literal["created", "signed_in", "signed_out", "revealed", "downloaded"]


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """One line of the log.

    Attributes:
        at: When it happened.
        researcher: The name of the account.
        action: What was done.
        detail: What it was done to, such as the name of a downloaded file.
    """

    at: datetime
    researcher: str
    action: Action
    detail: str | None


def log_action(connection: Connection, entry: AuditEntry) -> None:
    """Add a line to the log, within the transaction of what it tells about."""
    row = {name: getattr(entry, name) for name in AuditEntry.__slots__}
    connection.execute(insert(audit_log).values(row))


def audit_entries(database: Database) -> Sequence[AuditEntry]:
    """Return the whole log, oldest first."""
    query = select(audit_log.c.at, audit_log.c.researcher, audit_log.c.action, audit_log.c.detail)
    with database.read() as connection:
        return [AuditEntry(*row) for row in connection.execute(query.order_by(audit_log.c.id))]
