"""What the log holds of the published versions of studies."""

from sqlalchemy import Connection, select

from webapp.storage.tables import records


def latest_published(connection: Connection, study: str) -> str | None:
    """Return the version of a study that was recorded last as published; None if none was."""
    log = records.c
    query = select(log.study_version).where(log.action == "published", log.study == study).order_by(log.number.desc())
    found: str | None = connection.execute(query.limit(1)).scalar_one_or_none()
    return found
