"""The revisions of the schema that this program knows, and how a database gets to the newest."""

from functools import cache
from pathlib import Path

from sqlalchemy import Connection, inspect, text

CURRENT = "0003"
"""The newest revision. A server compares with it and needs no more; reading the steps' files takes 10 MB."""

_MIGRATIONS = Path(__file__).parent / "migrations"


@cache
def known_revisions() -> tuple[str, ...]:
    """Return the revisions, the newest first."""
    from alembic.script import ScriptDirectory  # noqa: PLC0415 - see CURRENT.

    return tuple(script.revision for script in ScriptDirectory(str(_MIGRATIONS)).walk_revisions())


def revision_of(connection: Connection) -> str | None:
    """Return the revision of the tables; None without tables of ours."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    found: str | None = connection.execute(text("SELECT version_num FROM alembic_version")).scalar_one_or_none()
    return found


def run_migrations(connection: Connection) -> None:
    """Bring the tables to the newest revision, within a transaction."""
    from alembic import command  # noqa: PLC0415 - see CURRENT.
    from alembic.config import Config  # noqa: PLC0415

    config = Config()
    config.set_main_option("script_location", str(_MIGRATIONS))
    config.attributes["connection"] = connection
    command.upgrade(config, "head")
