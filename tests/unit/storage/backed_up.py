"""What tests of backups look into and change."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

from webapp.storage.backup_manifests import digest, read_manifest, write_manifest


def dump(path: Path) -> list[str]:
    with closing(sqlite3.connect(path)) as connection:
        return list(connection.iterdump())


@contextmanager
def changed(path: Path) -> Iterator[sqlite3.Connection]:
    """Change a backup as somebody would who knows how manifests are made: the triggers go, the digest is made anew."""
    with closing(sqlite3.connect(path)) as connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'trigger'").fetchall():
            connection.execute(f"DROP TRIGGER {name}")
        yield connection
        connection.commit()
    manifest = read_manifest(path)
    write_manifest(path, replace(manifest, sha256=digest(path), num_bytes=path.stat().st_size))
