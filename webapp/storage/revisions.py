"""The revisions of the schema that this program knows."""

from functools import cache
from pathlib import Path

from alembic.script import ScriptDirectory

_MIGRATIONS = Path(__file__).parent / "migrations"


@cache
def known_revisions() -> tuple[str, ...]:
    """Return the revisions, the newest first."""
    return tuple(script.revision for script in ScriptDirectory(str(_MIGRATIONS)).walk_revisions())
