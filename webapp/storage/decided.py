"""What the exclusion rules need to know of participants from elsewhere than their own answers."""

from collections.abc import Collection, Mapping

from sqlalchemy import Connection, and_, select

from webapp.storage.records import told_by
from webapp.storage.scope import Scope
from webapp.storage.tables import recruits


def released_pages(connection: Connection, scope: Scope) -> Mapping[int, Collection[int]]:
    """Return by participant's id whom a researcher let go on without some pages, and which."""
    found: dict[int, set[int]] = {}
    for *_, participant_id, page, _content in told_by(connection, "page_released", scope=scope):
        if participant_id is not None:
            found.setdefault(participant_id, set()).add(page)
    return found


def duplicates(connection: Connection) -> Collection[int]:
    """Return whose recruiter's id or session somebody else in the live data has too, whatever the study."""
    found: set[int] = set()
    for column in (recruits.c.external_id, recruits.c.external_session):
        other = recruits.alias()
        same = and_(
            other.c.service == recruits.c.service,
            other.c[column.name] == column,
            other.c.participant_id != recruits.c.participant_id,
        )
        query = select(recruits.c.participant_id).join(other, same).where(other.c.mode == "live").distinct()
        found |= set(connection.execute(query).scalars())
    return frozenset(found)
